"""A session on a canvas of rendercanvas, which a page or a notebook shows: its events in, pictures out."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.render.offscreen import give_back, take
from taichi_disk.runtime import alone
from taichi_disk.window.session import Session, laid_out

MOST = 3e6  # pixels of a picture: more take too long to read back
_LEAST = 8  # pixels: a canvas is smaller before its page has told a size
_NAMES = {" ": "space", "Enter": "Return", "Backspace": "BackSpace"}


class SessionCanvas:
    """Draws `session` when something moves or somebody acts; whoever makes a film meanwhile may take the window."""

    def __init__(self, canvas: Any, session: Session) -> None:
        """`canvas`: a `BaseRenderCanvas` with the update mode "ondemand"."""
        self._canvas, self._session, self._context = canvas, session, canvas.get_bitmap_context()
        canvas.add_event_handler(self._act, "pointer_down", "pointer_move", "pointer_up", "wheel", "resize")
        canvas.add_event_handler(self._act, "key_down", "key_up")
        canvas.request_draw(self._draw)

    def end(self) -> None:
        """Let go of everything; a film is completed."""
        self._session.let_go()
        self._session.close()
        give_back(self)

    @alone()  # another thread may make a film
    def _draw(self) -> None:
        width, height = self._canvas.get_logical_size()
        if min(width, height) < _LEAST:
            return
        size = laid_out(width, height, MOST)
        window = take(self, size)
        read = cache(window.get_image_buffer_as_numpy)  # to read ends the picture
        self._session.picture(window.get_canvas(), size, read)
        self._context.set_bitmap(bitmap_of(read()))
        if self._session.controls.closing:
            self._canvas.close()
        elif self._session.busy:
            self._canvas.request_draw()

    @alone()
    def _act(self, event: dict[str, Any]) -> None:
        session, kind = self._session, event["event_type"]
        if kind.startswith("key"):
            key = event["key"].removeprefix("Arrow")
            name = _NAMES.get(key, key.lower() if len(key) == 1 else key)
            if kind == "key_up":
                session.key_up(name)
            elif not set(event["modifiers"]) & {"Control", "Alt", "Meta"}:
                session.key_down(name)
        elif "x" in event:
            width, height = self._canvas.get_logical_size()
            columns, rows = laid_out(width, height, MOST)
            at = event["x"] * columns / width, event["y"] * rows / height
            if kind == "wheel":
                session.wheel(at, event["dy"])
            else:
                session.move(at)
            if kind == "pointer_down":
                session.press(at, right=event["button"] > 1)
            elif kind == "pointer_up":
                session.release()
        self._canvas.request_draw()


def bitmap_of(drawn: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(height, width, 4) bytes, rows downwards, of what was drawn (width, height, 4) from 0 to 1, rows upwards."""
    drawn *= 255.0
    pixels = drawn.astype(np.uint8).view(np.uint32)[..., 0]
    return np.ascontiguousarray(pixels.T[::-1]).view(np.uint8).reshape(*pixels.T.shape, 4)
