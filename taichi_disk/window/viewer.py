"""The window: keeps the clock, hands keys and mouse on, shows stage and panels."""

from __future__ import annotations

from collections.abc import Generator
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
import taichi as ti

from taichi_disk.errors import TaichiDiskError
from taichi_disk.output.files import prepare_output
from taichi_disk.render.palette import THEMES
from taichi_disk.render.pictures import elsewhere, read_back
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.window.app import Entry, screen
from taichi_disk.window.controls import REPEATED, Controls
from taichi_disk.window.panel import Panel
from taichi_disk.window.recorder import Recorder
from taichi_disk.window.sandbox import PATIENCE, Sandbox
from taichi_disk.window.stage import PANEL, SIZE, Stage

FASTEST = 75  # pictures per second that are shown at most: more are not seen, and cost
_LONGEST = 0.1  # a picture that took longer does not make the next step longer [s]
_PICTURE = 1.0 / 32.0  # what computing and drawing may take together [s]
LEAST = (900, 520)  # pixels that the picture is laid out for, at the least
_FIRST, _AGAIN = 0.35, 0.07  # when a held key repeats [s]
Pixel = tuple[float, float]  # column and row from the window's upper left corner


class Viewer:
    """Holds the one window that may be alive; `run` returns when it has been closed.

    Attributes:
        sandbox: what is in it, from the first picture on.
    """

    sandbox: Sandbox

    def __init__(self, playlist: list[Entry], out: Path, fastest: int = FASTEST) -> None:
        """Files go into `out`. Raises InputError if it cannot be written, TaichiDiskError if there is no window."""
        prepare_output(out)
        self._playlist, self._out = playlist, out.resolve()
        # A title bar, and what a desktop keeps for itself, have to fit on the screen as well.
        width, height = screen() or (10_000, 10_000)
        self._initial_size = min(SIZE[0], width - 60), min(SIZE[1], height - 90)
        try:
            self._window = ti.ui.Window("taichi-disk view", self._initial_size, fps_limit=fastest, pos=(30, 30))
        except RuntimeError as error:
            raise TaichiDiskError(f"no window: {error}") from error
        self._ready = self._pressed = False
        self._held: dict[str, float] = {}

    def run(self) -> None:
        """Until the window is closed. Raises TaichiDiskError for a scene that cannot be built."""
        for _ in self.pictures():
            pass

    def pictures(self) -> Generator[tuple[float, int], None, None]:
        """`run`, picture by picture: seconds of the clock since the one before, steps made for it."""
        with elsewhere():
            try:
                self._set_up()
                yield from self._loop()
            finally:
                if self._ready:
                    self._recorder.stop()
                self._window.destroy()

    def _set_up(self) -> None:
        scene = self._playlist[0][1]()
        self._ground = THEMES[scene.video.theme].ground
        self.sandbox = Sandbox(scene, self._one_moment)
        self._stage = Stage(self._window.get_canvas(), self.sandbox)
        self._controls = Controls(self.sandbox, self._stage, self._playlist, self._out)
        self._mouse = Mouse(self.sandbox, self._stage)
        self._panel = Panel(self._window.get_gui(), self._controls, self._initial_size)
        self._recorder = Recorder(self._controls, partial(read_back, self._window))
        self._ready = True

    def _loop(self) -> Generator[tuple[float, int], None, None]:
        last, drawing = perf_counter(), 0.0
        while self._window.running and not self._controls.closing:
            raise_if_interrupted()
            now = perf_counter()
            elapsed, last = now - last, now
            # Time goes on even where drawing takes longer than it should.
            made = self.sandbox.advance(min(elapsed, _LONGEST), max(min(_PICTURE - drawing, PATIENCE), 0.5 * drawing))
            began = perf_counter()
            self._draw(self._hint())
            self._recorder.take(elapsed)
            self._window.show()
            drawing = 0.9 * drawing + 0.1 * (perf_counter() - began)
            self._listen()
            yield elapsed, made

    def _draw(self, hint: str) -> None:
        self._stage.hint = hint
        self._stage.draw(self._size)
        self._panel.show(self._size[1])

    def _hint(self) -> str:
        if self.sandbox.time.past:
            return "this is past: space goes on from here"
        if self.sandbox.message or not self.sandbox.at_start:
            return ""
        return "drag to turn, space to drop" if self.sandbox.is_impact else "space to let the load act"

    def _one_moment(self) -> None:
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
        pressed = list(window.get_events(ti.ui.PRESS))
        # GGUI updates the mouse when it is asked for events, so its place is read after them.
        x, y = window.get_cursor_pos()
        at = self._controls.cursor = x * self._size[0], (1.0 - y) * self._size[1]
        for event in pressed:
            if event.key in (ti.ui.LMB, ti.ui.RMB):
                self._pressed = True
                if at[0] > PANEL:
                    mouse.press(at, right=event.key == ti.ui.RMB)
            else:
                if event.key in REPEATED:
                    self._held[event.key] = perf_counter() + _FIRST
                self._controls.press("space" if event.key == ti.ui.SPACE else event.key)
        self._repeat()
        held = window.is_pressed(ti.ui.LMB) or window.is_pressed(ti.ui.RMB)
        self._panel.carry_out(held)
        if held:
            mouse.move(at)
        else:
            mouse.release()
            if self._pressed:
                self._panel.go_home()
        self._pressed = held

    def _repeat(self) -> None:
        now = perf_counter()
        for key, due in list(self._held.items()):
            if not self._window.is_pressed(key):
                del self._held[key]
            elif now >= due:
                self._held[key] = max(due + _AGAIN, now)
                self._controls.press(key)


class Mouse:
    """What it does beside the panels: turns the disk at the start, pulls a point later, scrubs graphs, pans."""

    def __init__(self, sandbox: Sandbox, stage: Stage) -> None:
        self._sandbox, self._stage = sandbox, stage
        self._doing = ""  # "turn", "pull", "scrub", "pan"
        self._at: Pixel = (0.0, 0.0)
        self._angle = self._turned = 0.0

    def press(self, at: Pixel, right: bool = False) -> None:
        """Take hold of what is there; with the right button, of the picture."""
        sandbox, place = self._sandbox, self._stage.place(*at)
        self._at = at
        if right:
            self._doing = "pan"
        elif self._stage.graphs.time_at(*at) is not None:
            self._doing = "scrub"
        elif place and sandbox.at_start and sandbox.is_impact:
            self._doing, self._angle, self._turned = "turn", self._angle_at(place), 0.0
        elif place:
            self._doing = "pull"
        self.move(at)

    def move(self, at: Pixel) -> None:
        """The mouse is at a pixel now."""
        sandbox, stage, place = self._sandbox, self._stage, self._stage.place(*at)
        if self._doing == "pan":
            stage.pan(at[0] - self._at[0], at[1] - self._at[1])
            self._at = at
        elif self._doing == "scrub" and (t := stage.graphs.time_at(*at)) is not None:
            sandbox.scrub(t)
        elif self._doing == "turn" and place:
            self._turned = self._angle_at(place) - self._angle
            sandbox.turn(self._turned, for_good=False)
        elif self._doing == "pull" and place:
            sandbox.pull(*place)

    def release(self) -> None:
        """Let go; the disk moves from here on as it stands."""
        doing, self._doing = self._doing, ""
        if doing == "turn" and self._turned:
            self._sandbox.turn(self._turned)
        elif doing == "pull":
            self._sandbox.let_go()

    def _angle_at(self, place: tuple[float, float]) -> float:
        """Of a place about the disk's centre [rad]."""
        x, y = self._stage.centre
        return float(np.arctan2(place[1] - y, place[0] - x))
