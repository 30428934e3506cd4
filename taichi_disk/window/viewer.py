"""The window on a desktop: hands keys and mouse on to the session, and shows its pictures."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import ExitStack
from pathlib import Path

from taichi_disk.engine import ti
from taichi_disk.errors import TaichiDiskError
from taichi_disk.output.files import prepare_output
from taichi_disk.render.legend import draw_line, ink
from taichi_disk.render.offscreen import elsewhere
from taichi_disk.render.painter import draw_triangles
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.controls import Entry
from taichi_disk.window.overlay import Overlay
from taichi_disk.window.sandbox import Sandbox
from taichi_disk.window.scene_view import SIZE
from taichi_disk.window.session import Session, laid_out

FASTEST = 75  # pictures per second that are shown at most: more are not seen, and cost


class Viewer:
    """Holds the one window that may be alive; `pictures` ends when it has been closed."""

    def __init__(
        self, playlist: list[Entry], out: Path, screen: tuple[int, int] | None, fastest: int = FASTEST
    ) -> None:
        """Files go into `out`; `screen`: its size [px], if it is known.

        Raises InputError if `out` cannot be written, TaichiDiskError if there is no window.
        """
        prepare_output(out)
        self._playlist, self._out = playlist, out.resolve()
        # A title bar, and what a desktop keeps for itself, have to fit on the screen as well.
        width, height = screen or (10_000, 10_000)
        size = min(SIZE[0], width - 60), min(SIZE[1], height - 90)
        try:
            self._window = ti.ui.Window("taichi-disk view", size, fps_limit=fastest, pos=(30, 30))
        except RuntimeError as error:
            raise TaichiDiskError(f"no window: {error}") from error
        self._session: Session | None = None
        self._pressed = False

    @property
    def sandbox(self) -> Sandbox:
        """What is in it, from the first picture on."""
        assert self._session
        return self._session.sandbox

    def pictures(self) -> Generator[tuple[float, int], None, None]:
        """Until the window is closed, after each picture: seconds of the clock since the one before, steps made for it.

        Raises TaichiDiskError for a scene that cannot be built.
        """
        window = self._window
        with elsewhere(), ExitStack() as at_end:
            at_end.callback(window.destroy)
            self._session = session = Session(self._playlist, self._out, KernelCache(self._announce))
            at_end.callback(session.close)
            while window.running and not session.controls.closing:
                raise_if_interrupted()
                passed = session.picture(window.get_canvas(), self._size, window.get_image_buffer_as_numpy)
                window.show()
                self._listen(session)
                yield passed

    def _announce(self) -> None:
        """Say why the next picture takes a second."""
        canvas, (width, height), grey = self._window.get_canvas(), self._size, (0.5, 0.5, 0.5)
        overlay = Overlay(ink(grey))
        draw_line(overlay, (0.4 * width, 0.45 * height), "compiling for this scene...", 14.0, (0, 0, 0))
        canvas.set_background_color(grey)
        draw_triangles(canvas, overlay.vertices(width, height))
        self._window.show()

    @property
    def _size(self) -> tuple[int, int]:
        return laid_out(*self._window.get_window_shape())

    def _listen(self, session: Session) -> None:
        window, (width, height) = self._window, self._size
        events = list(window.get_events(ti.ui.PRESS))
        # GGUI updates the mouse when it is asked for events, so its position is read after them.
        x, y = window.get_cursor_pos()
        at = x * width, (1.0 - y) * height
        for event in events:
            if event.key in (ti.ui.LMB, ti.ui.RMB):
                self._pressed = True
                session.press(at, right=event.key == ti.ui.RMB)
            else:
                session.key_down("space" if event.key == ti.ui.SPACE else event.key)
        for key in [*session.repeats]:
            if not window.is_pressed(key):
                session.key_up(key)
        session.move(at)
        pressed = window.is_pressed(ti.ui.LMB) or window.is_pressed(ti.ui.RMB)
        if self._pressed and not pressed:
            session.release()
        self._pressed = pressed
