"""The widget of notebooks, without a browser: what it is told, and what it sends."""

from __future__ import annotations

import asyncio
import io
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from taichi_disk import run
from taichi_disk.render import film_problem

SETTINGS = ["lattice.points=60", "impact.velocity=0.05"]


@pytest.mark.skipif(film_problem() is not None, reason="no Vulkan driver")
def test_a_widget_is_played_with_while_cells_make_films(tmp_path: Path) -> None:
    from taichi_disk.notebook import Sandbox

    sent: list[bytes] = []

    async def notebook() -> None:
        sandbox = Sandbox("exponential_wall", SETTINGS, tmp_path / "out")

        def send(message: dict[str, Any], buffers: list[bytes]) -> None:
            sent.extend(buffers)
            sandbox._frame_feedback = {"index": message["index"], "timestamp": 0.0, "localtime": 0.0}

        async def until(condition: Any) -> None:
            for _ in range(600):
                if condition():
                    return
                await asyncio.sleep(0.05)
            raise AssertionError("it does not come to that")

        def tell(kind: str, **more: Any) -> None:
            sandbox._rfb_handle_msg(sandbox, {"type": kind, "timestamp": 0.0} | more, [])

        sandbox.send, sandbox._has_visible_views = send, True
        tell("resize", pwidth=900, pheight=700, ratio=1)
        await until(lambda: sent)
        for kind in ("key_down", "key_up") * 30:  # faster
            tell(kind, key="f", modifiers=[])
        tell("key_down", key=" ", modifiers=[])
        await until(lambda: sandbox.results)
        # A cell takes the window for a film; the widget has it again afterwards.
        result = run(sandbox.scene, video=False)
        result.film(tmp_path / "one.png")
        shown = len(sent)
        tell("key_down", key="t", modifiers=[])
        await until(lambda: len(sent) > shown + 1)
        assert sandbox.results[0].value == result.summary["restitution"]
        assert sandbox.scene.video.theme == "dark" and (tmp_path / "one.png").exists()
        sandbox.close()
        assert sandbox.get_closed()

    handler = signal.getsignal(signal.SIGINT)
    asyncio.run(notebook())
    signal.signal(signal.SIGINT, handler)  # rendercanvas takes Ctrl-C, and gives it back to a loop that has ended
    picture = np.asarray(Image.open(io.BytesIO(sent[-1])).convert("RGB"))
    assert picture.shape == (700, 900, 3) and picture[2, 500].max() < 40  # dark


def test_without_the_extra_the_message_names_it() -> None:
    code = "import sys; sys.modules['anywidget'] = None; import taichi_disk.notebook"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "TaichiDiskError: no widget" in done.stderr and "pip install 'taichi-disk[notebook]'" in done.stderr
