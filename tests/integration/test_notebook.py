"""In notebooks: the widget without a browser, what results show of themselves, bars,
the notebooks of docs."""

from __future__ import annotations

import asyncio
import builtins
import json
import re
import socket
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taichi_disk import load_sweep, run, run_sweep
from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.progress import reported
from taichi_disk.render import film_problem
from taichi_disk.window.session import HEADER
from tests.browser import Browser
from tests.programs import printed_by, python

ROOT = Path(__file__).parents[2]
SETTINGS = ["lattice.points=60", "impact.velocity=0.05"]


def played(
    settings: list[str],
    act: Callable[[Any, Callable[..., None], list[Any]], Awaitable[None]],
) -> None:
    """Let `act` play with a widget as its view does: it is given the widget, what says
    something, what was sent."""
    from taichi_disk.notebook import Sandbox

    async def notebook() -> None:
        sandbox, sent = Sandbox("exponential_wall", settings), list[Any]()

        def say(kind: str, **more: Any) -> None:
            sandbox._handle_custom_msg({"visitor": 0.5, "do": kind} | more, [])

        def send(message: dict[str, Any], buffers: list[bytes]) -> None:
            sent.append(message.get("text") or buffers[0])
            if buffers:
                say("seen", number=HEADER.unpack(buffers[0][: HEADER.size])[0])

        sandbox.send = send
        say("open")
        await act(sandbox, say, sent)
        sandbox.close()

    asyncio.run(notebook())


async def until(condition: Callable[[], object]) -> None:
    for _ in range(1200):
        if condition():
            return
        await asyncio.sleep(0.05)
    raise AssertionError("it does not come to that")


@pytest.mark.validate
def test_a_widget_is_played_with_while_cells_compute(tmp_path):
    async def act(sandbox: Any, say: Callable[..., None], sent: list[Any]) -> None:
        say("set", key="speed", value=10.0)
        say("press", key="space")
        await until(lambda: sandbox.results)
        result = run(sandbox.scene, video=False, lattices=1)  # a cell
        assert sandbox.results[0].value == result.summary["restitution"]
        say("press", key="t")
        await until(lambda: sandbox.scene.video.theme == "dark")
        say("unheard of")
        states = len(sent)
        say("close")
        say("press", key="t")
        await asyncio.sleep(0.2)
        assert len(sent) <= states + 1 and sandbox.scene.video.theme == "dark"

    played(SETTINGS, act)


def begin_anew() -> None:
    """Play with a widget around the user's own `ti.init`."""
    from taichi_disk.engine import ti

    async def act(sandbox: Any, say: Callable[..., None], sent: list[Any]) -> None:
        def panel() -> dict[str, Any]:
            texts = [json.loads(one) for one in sent if isinstance(one, str)]
            return [one for one in texts if one["kind"] == "panel"][-1]

        def plays() -> bool:
            return not panel()["paused"] and not panel()["atStart"]

        await until(lambda: any(isinstance(one, bytes) for one in sent))
        say("press", key="space")
        await until(plays)
        ti.init(arch=ti.cpu)
        await until(lambda: "at the start again" in panel()["message"])
        say("press", key="space")
        await until(plays)

    played(SETTINGS, act)


@pytest.mark.validate
def test_a_widget_begins_anew_after_the_user_s_own_init_and_says_so():
    name = "tests.integration.test_notebook"
    printed_by("-c", f"from {name} import begin_anew; begin_anew()", cwd=ROOT)


@pytest.mark.validate
def test_a_widget_of_no_scene_says_so_once():
    code = """
import asyncio
from taichi_disk.notebook import Sandbox

async def notebook():
    Sandbox("typo")

asyncio.run(notebook())
"""
    done = python("-c", code)
    assert "typo: no such file" in done.stderr
    assert done.stderr.count("Traceback") == 1


@pytest.mark.validate
def test_a_message_that_another_thread_delivers_is_obeyed_at_once():
    async def act(sandbox: Any, say: Callable[..., None], sent: list[Any]) -> None:
        def press_and_wait() -> None:
            time.sleep(0.2)
            say("press", key="t")
            Browser.wait(lambda: sent, 10.0)

        await until(lambda: any(isinstance(one, bytes) for one in sent))
        await asyncio.sleep(0.2)
        sent.clear()
        # nothing but the message wakes up the loop
        await asyncio.to_thread(press_and_wait)

    played(SETTINGS, act)


FIND_SANDBOX = """
const outputs = [...document.querySelectorAll(".jp-OutputArea-output *")];
window.sandbox = outputs.find((one) => one.sandbox?.drawing.state)?.sandbox;
return Boolean(window.sandbox);
"""


@pytest.mark.validate
@pytest.mark.skipif(find_spec("jupyterlab") is None, reason="no JupyterLab")
def test_in_jupyterlab_a_widget_is_played_with(tmp_path, browser):
    import nbformat  # 2 s

    code = (
        "from taichi_disk.notebook import Sandbox\nSandbox('exponential_wall',"
        f" {SETTINGS})"
    )
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    notebook = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_code_cell(code)], metadata=kernel
    )
    nbformat.write(notebook, tmp_path / "play.ipynb")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    options = [
        "--no-browser",
        "--allow-root",
        "--IdentityProvider.token=",
        f"--port={port}",
    ]
    command = [sys.executable, "-m", "jupyterlab", *options]
    browser.resize((1200, 900))
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as lab:
        try:
            browser.wait(lambda: not socket.socket().connect_ex(("127.0.0.1", port)))
            browser.driver.get(f"http://127.0.0.1:{port}/lab/tree/play.ipynb")
            status = "document.querySelector('#jp-main-statusbar')?.textContent"
            # a cell that is run earlier never ends
            browser.wait(lambda: browser.script(f"return {status}.includes('| Idle')"))
            cell = browser.driver.find_element(
                "css selector", ".jp-Notebook .cm-content"
            )
            cell.send_keys("\ue008\ue007")
            browser.wait(lambda: browser.script(FIND_SANDBOX))
            browser.script("window.sandbox.ui.drop.click()")
            browser.wait(lambda: browser.state("t") > 1.0)
            assert browser.colours() > 50
        finally:
            lab.terminate()


@pytest.mark.validate
def test_without_the_extra_the_message_names_it():
    code = "import sys; sys.modules['anywidget'] = None; import taichi_disk.notebook"
    done = python("-c", code)
    assert "TaichiDiskError: no widget" in done.stderr
    assert "pip install '.[notebook]'" in done.stderr


# ---- what a cell shows of itself

SCENE = {
    "scene": "exponential_wall",
    "lattice": {"points": 60},
    "impact": {"velocity": 0.05},
}


@pytest.mark.validate
def test_a_result_is_a_line_in_a_terminal_and_a_table_with_a_plot_in_a_notebook():
    result = run(SCENE, lattices=1)
    assert (
        repr(result).startswith("Result(exponential_wall, 60 points, restitution 0.")
        and len(repr(result)) < 100
    )
    html = result._repr_html_()
    assert "restitution e" in html and f"{result.error:.0e}"[0] in html
    (image,) = re.findall('data:image/png;base64,[^"]+', html)
    assert len(html) - len(image) < 2500
    figure = result.plot()
    figure.axes[0].set_title("mine")
    assert np.array_equal(
        figure.axes[1].lines[0].get_ydata(), result.series["wall_force"]
    )
    assert figure._repr_png_()[:4] == b"\x89PNG"


@pytest.mark.skipif(film_problem() is not None, reason="no Vulkan driver")
def test_a_film_is_shown_inline_with_controls_and_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    result = run(SCENE, lattices=1)
    assert (
        "<video controls loop"
        in (film := result.show(size=64, seconds=0.1))._repr_html_()
    )
    assert film.data[4:8] == b"ftyp"
    assert repr(film) == f"Film(mp4, {round(len(film.data) / 1000)} kB)"
    assert "<img" in result.show(size=64, format="png")._repr_html_()
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="did you mean size"):
        result.show(sise=64)


@pytest.mark.validate
def test_a_sweep_shows_its_fits_and_gives_a_figure_and_a_table(tmp_path, monkeypatch):
    points = "scene: exponential_wall\nlattice: {points: 60}\n"
    done = run_sweep(
        load_sweep(points + "sweep: {velocity: [0.02, 0.05, 0.1]}"),
        tmp_path / "v",
        jobs=1,
    )
    assert repr(done).startswith(
        "SweepResult(exponential_wall, 3 points, 3 of them computed now, 0 failed, out="
    )
    assert "eq. (5)" in (html := done._repr_html_()) and html.count("<img") == 1
    assert done.plot().axes[0].get_xlabel() == "impact speed  v/c"
    assert done.dataframe()["restitution"].tolist() == [
        row["restitution"] for row in done.rows
    ]
    other = run_sweep(
        load_sweep(points + "sweep: {seed: {range: 2}}"), tmp_path / "seed", jobs=1
    )
    html = other._repr_html_()
    assert "eq. (5)" not in html and html.count("<img") == 1
    assert other.plot().axes[0].get_xlabel() == "seed"
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(TaichiDiskError, match="-m pip install 'pandas'"):
        done.dataframe()


def test_long_work_shows_a_bar_by_itself_in_a_notebook_which_goes_at_the_end(
    monkeypatch,
):
    class ZMQInteractiveShell:
        pass

    class Handle:
        def update(self, shown: Any, **_: Any) -> None:
            told.append(
                shown
                if isinstance(shown, dict)
                else shown._repr_mimebundle_((), ())["text/plain"]
            )

    told: list[Any] = []
    monkeypatch.setattr(builtins, "get_ipython", ZMQInteractiveShell, raising=False)
    monkeypatch.setattr("IPython.display.display", lambda shown, display_id: Handle())
    monkeypatch.setattr("taichi_disk.progress.BAR_INTERVAL", 0.0)

    @reported
    def work(progress: Any = None) -> None:
        for k in range(3):
            progress("sweep", k, 2)

    work()
    assert not told  # too soon
    monkeypatch.setattr("taichi_disk.progress.BAR_DELAY", 0.0)
    with pytest.raises(InputError, match="progress: must be a function"):
        work(3)
    work(lambda stage, done, total: None)
    assert not told
    work()
    assert "sweep" in told[0] and "100%" in told[-2] and told[-1] == {"text/plain": ""}


NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))


@pytest.mark.validate
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_and_print_nothing_that_is_not_theirs(path, tmp_path):
    import nbformat  # 2 s
    from nbclient import NotebookClient

    notebook = nbformat.read(path, 4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs for cell in cells)
    NotebookClient(
        notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    printed = [
        one for cell in cells for one in cell.outputs if one.output_type == "stream"
    ]
    assert all(one.name == "stdout" and "aichi" not in one.text for one in printed)
    assert any(
        "image/png" in one.get("data", {}) for cell in cells for one in cell.outputs
    )
