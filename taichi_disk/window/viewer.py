"""The window: keeps the clock, hands keys and mouse on, shows view and panels, writes films and pictures."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter

import numpy as np
import taichi as ti
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from taichi_disk.errors import TaichiDiskError
from taichi_disk.output.files import atomic_write, beside, origin, prepare_output, reason, remove
from taichi_disk.render import kernels
from taichi_disk.render.palette import THEMES
from taichi_disk.render.pictures import elsewhere
from taichi_disk.render.video import Picture, video
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.controls import REPEATED, Controls, Entry, Panel
from taichi_disk.window.overlay import Pixel
from taichi_disk.window.sandbox import PATIENCE, Sandbox
from taichi_disk.window.scene_view import PANEL, SIZE, SceneView

FASTEST = 75  # pictures per second that are shown at most: more are not seen, and cost
_LONGEST = 0.1  # a picture that took longer does not make the next step longer [s]
_PICTURE = 1.0 / 32.0  # what computing and drawing may take together [s]
LEAST = (900, 520)  # pixels that the picture is laid out for, at the least
_FIRST, _AGAIN = 0.35, 0.07  # when a held key repeats [s]
FPS = 30  # of a film


class Viewer:
    """Holds the one window that may be alive; `pictures` ends when it has been closed.

    Attributes:
        sandbox: what is in it, from the first picture on.
    """

    sandbox: Sandbox

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
        self._initial_size = min(SIZE[0], width - 60), min(SIZE[1], height - 90)
        try:
            self._window = ti.ui.Window("taichi-disk view", self._initial_size, fps_limit=fastest, pos=(30, 30))
        except RuntimeError as error:
            raise TaichiDiskError(f"no window: {error}") from error
        self._ready = self._pressed = False
        self._repeats: dict[str, float] = {}

    def pictures(self) -> Generator[tuple[float, int], None, None]:
        """Until the window is closed, after each picture: seconds of the clock since the one before, steps made for it.

        Raises TaichiDiskError for a scene that cannot be built.
        """
        with elsewhere(), ExitStack() as at_end:
            at_end.callback(self._window.destroy)
            scene = self._playlist[0][1]()
            self._ground = THEMES[scene.video.theme].ground
            self.sandbox = sandbox = Sandbox(scene, KernelCache(self._announce))
            self._view = SceneView(self._window.get_canvas(), sandbox)
            self._controls = Controls(sandbox, self._view, self._playlist, self._out)
            self._mouse = Mouse(sandbox, self._view)
            self._panel = Panel(self._window.get_gui(), self._controls, self._initial_size)
            recorder, self._ready = Recorder(self._controls, self._window.get_image_buffer_as_numpy), True
            at_end.callback(recorder.stop)
            last, drawing = perf_counter(), 0.0
            while self._window.running and not self._controls.closing:
                raise_if_interrupted()
                now = perf_counter()
                elapsed, last = now - last, now
                # Time goes on even where drawing takes longer than it should.
                patience = max(min(_PICTURE - drawing, PATIENCE), 0.5 * drawing)
                made = sandbox.advance(min(elapsed, _LONGEST), patience)
                began = perf_counter()
                self._draw(self._hint())
                recorder.take(elapsed)
                self._window.show()
                drawing = 0.9 * drawing + 0.1 * (perf_counter() - began)
                self._listen()
                yield elapsed, made

    def _draw(self, hint: str) -> None:
        self._view.hint = hint
        self._view.draw(self._size)
        self._panel.show(self._size[1])

    def _hint(self) -> str:
        if self.sandbox.time.past:
            return "this is past: space goes on from here"
        if self.sandbox.message or not self.sandbox.at_start:
            return ""
        return "drag to turn, space to drop" if self.sandbox.is_impact else "space to let the load act"

    def _announce(self) -> None:
        """Between two pictures: say why the next one takes a second."""
        for _ in range(2):  # ImGui shows nothing in its first picture
            if self._ready:
                self._draw("one moment: compiling for this scene...")
            else:
                self._window.get_canvas().set_background_color(self._ground)
                with self._window.get_gui().sub_window("One moment", 0.4, 0.4, 0.25, 0.08):
                    self._window.get_gui().text("Compiling for this scene...")
            self._window.show()

    @property
    def _size(self) -> tuple[int, int]:
        # A smaller window shows the same, squeezed; one put away as an icon has no size.
        width, height = map(max, self._window.get_window_shape(), LEAST)
        return width, height

    # ---- keys and mouse

    def _listen(self) -> None:
        window, mouse = self._window, self._mouse
        events = list(window.get_events(ti.ui.PRESS))
        # GGUI updates the mouse when it is asked for events, so its position is read after them.
        x, y = window.get_cursor_pos()
        at = self._controls.cursor = x * self._size[0], (1.0 - y) * self._size[1]
        for event in events:
            if event.key in (ti.ui.LMB, ti.ui.RMB):
                self._pressed = True
                if at[0] > PANEL:
                    mouse.press(at, right=event.key == ti.ui.RMB)
            else:
                if event.key in REPEATED:
                    self._repeats[event.key] = perf_counter() + _FIRST
                self._controls.press("space" if event.key == ti.ui.SPACE else event.key)
        now = perf_counter()
        for key, due in list(self._repeats.items()):
            if not window.is_pressed(key):
                del self._repeats[key]
            elif now >= due:
                self._repeats[key] = max(due + _AGAIN, now)
                self._controls.press(key)
        pressed = window.is_pressed(ti.ui.LMB) or window.is_pressed(ti.ui.RMB)
        self._panel.carry_out(pressed)
        if pressed:
            mouse.move(at)
        else:
            mouse.release()
            if self._pressed:
                self._panel.go_home()
        self._pressed = pressed


class Mouse:
    """What it does beside the panels: turns the disk at the start, pulls a point later, scrubs graphs, pans."""

    def __init__(self, sandbox: Sandbox, view: SceneView) -> None:
        self._sandbox, self._view = sandbox, view
        self._doing = ""  # "turn", "pull", "scrub", "pan"
        self._at: Pixel = (0.0, 0.0)
        self._angle = self._turned = 0.0

    def press(self, at: Pixel, right: bool = False) -> None:
        """Take hold of what is there; with the right button, of the picture."""
        sandbox, point = self._sandbox, self._view.point_at(*at)
        self._at = at
        if right:
            self._doing = "pan"
        elif self._view.graphs.time_at(*at) is not None:
            self._doing = "scrub"
        elif point and sandbox.at_start and sandbox.is_impact:
            self._doing, self._angle, self._turned = "turn", self._angle_at(point), 0.0
        elif point:
            self._doing = "pull"
        self.move(at)

    def move(self, at: Pixel) -> None:
        """The mouse is at a pixel now."""
        sandbox, view, point = self._sandbox, self._view, self._view.point_at(*at)
        if self._doing == "pan":
            view.pan(at[0] - self._at[0], at[1] - self._at[1])
            self._at = at
        elif self._doing == "scrub" and (t := view.graphs.time_at(*at)) is not None:
            sandbox.scrub(t)
        elif self._doing == "turn" and point:
            self._turned = self._angle_at(point) - self._angle
            sandbox.turn(self._turned, for_good=False)
        elif self._doing == "pull" and point:
            sandbox.pull(*point)

    def release(self) -> None:
        """Let go; the disk moves from here on as it stands."""
        doing, self._doing = self._doing, ""
        if doing == "turn" and self._turned:
            self._sandbox.turn(self._turned)
        elif doing == "pull":
            self._sandbox.let_go()

    def _angle_at(self, point: tuple[float, float]) -> float:
        """Of a point [R] about the disk's centre [rad]."""
        x, y = self._view.centre
        return float(np.arctan2(point[1] - y, point[0] - x))


class Recorder:
    """What is seen without the panels, as files: a film while `controls` say so, and single pictures.

    `read` gives what was drawn, (width, height, 4) from 0 to 1, rows upwards.
    """

    def __init__(self, controls: Controls, read: Callable[[], NDArray[np.float32]]) -> None:
        self._controls, self._read = controls, read
        self._open = ExitStack()
        self._write: Callable[[Callable[[], Picture]], None] | None = None
        self._seconds, self._frames = 0.0, 0

    def take(self, seconds: float) -> None:
        """After each drawing, `seconds` of the clock after the one before."""
        controls = self._controls
        if not controls.recording:
            self.stop()
        if self._write:
            self._seconds += seconds
        due = int(self._seconds * FPS) + 1 - self._frames
        if not (controls.picture_wanted or (controls.recording and due > 0)):
            return
        picture = picture_of(self._read())
        try:
            if controls.picture_wanted:
                self._keep(picture)
            if controls.recording:
                self._film(picture, due)
        except (OSError, TaichiDiskError) as error:
            controls.recording = controls.picture_wanted = False
            self.stop()
            controls.sandbox.message = f"cannot write: {reason(error)}"

    def _keep(self, picture: Picture) -> None:
        """A PNG that carries its numbers as text."""
        path, info, sandbox = self._controls.next_file(".png"), PngInfo(), self._controls.sandbox
        seen = sandbox.seen
        facts = {"scene": sandbox.scene.to_yaml(), "changed by hand": str(seen.by_hand), "t": repr(seen.t)}
        for name, text in (facts | {name: repr(value) for name, value in seen.values.items()}).items():
            info.add_text(name, text)
        atomic_write(path, lambda new: Image.fromarray(picture).save(new, pnginfo=info))
        self._controls.picture_wanted, sandbox.message = False, f"wrote {path}"

    def _film(self, picture: Picture, count: int) -> None:
        """Let `count` frames of the film show a picture; it ends where the window gets another size."""
        if self._write is None:
            self._new, self._shape = beside(self._controls.next_file(".mp4")), picture.shape
            film = video(
                self._new, ".mp4", picture.shape[1], picture.shape[0], FPS, origin(self._controls.sandbox.scene)
            )
            self._write = self._open.enter_context(film)
        elif picture.shape != self._shape:
            self._controls.recording = False
            return
        for _ in range(count):
            self._write(lambda: picture)
        self._frames += count

    def stop(self) -> None:
        """Complete the film, if there is one."""
        if self._write:
            self._write, self._seconds, self._frames = None, 0.0, 0
            try:
                self._open.close()
                path = self._controls.next_file(".mp4")
                os.replace(self._new, path)
                self._controls.sandbox.message = f"wrote {path}"
            except (OSError, TaichiDiskError) as error:
                self._controls.sandbox.message = f"cannot write the film: {reason(error)}"
            finally:
                remove(self._new)


def picture_of(drawn: NDArray[np.float32]) -> Picture:
    """(rows, columns, 3) without the panels, rows downwards; an odd last row or column is left out."""
    view = drawn[min(PANEL, len(drawn) - 2) :]
    width, height = (pixels // 2 * 2 for pixels in view.shape[:2])
    picture = np.empty((height, width, 3), np.uint8)
    kernels.shrink(np.ascontiguousarray(view), picture, 0, height, 0, 2)
    return picture
