"""One person's sandbox with all that belongs to it, on any canvas: a window's, a page's, a notebook's.

What shows it says where the pointer is and which keys are down, and asks for the next picture.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.output.files import prepare_output
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.controls import REPEATED, Controls, Entry
from taichi_disk.window.overlay import Pixel
from taichi_disk.window.panel import Panel
from taichi_disk.window.recorder import Recorder
from taichi_disk.window.sandbox import PATIENCE, Sandbox
from taichi_disk.window.scene_view import PANEL, SceneView

_LONGEST = 0.1  # a picture that took longer does not make the next step longer [s]
_PICTURE = 1.0 / 32.0  # what computing and drawing may take together [s]
_FIRST, _AGAIN = 0.35, 0.07  # when a held key repeats [s]
LEAST = (740, 620)  # pixels that the picture is laid out for, at the least
_AFTER = 6  # pictures that still change when nothing moves any more: scales grow


class Session:
    """`ti.init` must have been called.

    Attributes:
        sandbox, view, controls, panel: the disk, what is seen of it, what can be done, and where.
        repeats: keys that are down and repeat, and when.
    """

    def __init__(self, playlist: list[Entry], out: Path, kernels: KernelCache) -> None:
        """Files go into `out`.

        Raises InputError if it cannot be written, TaichiDiskError for a scene that cannot be built.
        """
        prepare_output(out)
        self.sandbox = sandbox = Sandbox(playlist[0][1](), kernels)
        self.view = SceneView(sandbox)
        self.controls = Controls(sandbox, self.view, playlist, out.resolve())
        self.panel, self._mouse = Panel(self.controls), Mouse(sandbox, self.view)
        self._recorder = Recorder(self.controls)
        self.repeats: dict[str, float] = {}
        self._pressed = False
        self._last, self._drawing, self._quiet = perf_counter(), 0.0, 0

    # ---- pictures

    def picture(self, canvas: Any, size: tuple[int, int], read: Callable[[], NDArray[np.float32]]) -> tuple[float, int]:
        """Let the time pass since the picture before, and draw the next one on a `ti.ui.Canvas`.

        Args:
            size: that it is laid out for, see `laid_out` [px].
            read: gives what was drawn, (width, height, 4) from 0 to 1, rows upwards; called where a file is to hold it.

        Returns seconds of the clock since the picture before, and the steps made.
        """
        now = perf_counter()
        elapsed, self._last = now - self._last, now
        passed, sandbox = min(elapsed, _LONGEST), self.sandbox
        # Time goes on even where drawing takes longer than it should.
        made = sandbox.advance(passed, max(min(_PICTURE - self._drawing, PATIENCE), 0.5 * self._drawing))
        self._drawing = 0.9 * self._drawing + 0.1 * max(passed - (perf_counter() - now), 0.0)
        self.draw(canvas, size)
        self._recorder.take(elapsed, read, PANEL / size[0])
        for key, due in self.repeats.items():
            if now >= due:
                self.repeats[key] = max(due + _AGAIN, now)
                self.controls.press(key)
        self.panel.carry_out(self._pressed)
        held = self._pressed or self.repeats or self.controls.recording
        self._quiet = 0 if held or sandbox.time.behind or not sandbox.paused else self._quiet + 1
        return elapsed, made

    def draw(self, canvas: Any, size: tuple[int, int]) -> None:
        """Draw what is seen."""
        self.view.hint = self._hint()
        self.view.draw(canvas, size)
        self.panel.draw(canvas, size, self.view.theme)

    @property
    def busy(self) -> bool:
        """Whether the next picture will be another one, though nobody does anything."""
        return self._quiet < _AFTER

    def _hint(self) -> str:
        if self.sandbox.time.past:
            return "this is past: space goes on from here"
        if self.sandbox.message or not self.sandbox.at_start:
            return ""
        return "drag to turn, space to drop" if self.sandbox.is_impact else "space to let the load act"

    def let_go(self, pause: bool = True) -> None:
        """Of keys and mouse: whoever held them has gone."""
        self.repeats.clear()
        self.release()
        if pause and not self.sandbox.paused:
            self.sandbox.pause()

    def close(self) -> None:
        """Complete a film."""
        self._recorder.stop()

    # ---- the pointer and keys

    def press(self, at: Pixel, right: bool = False) -> None:
        """A button of the mouse goes down at a pixel."""
        self._pressed, self._quiet, self.controls.cursor = True, 0, at
        if at[0] < PANEL:
            self.panel.press(at)
        else:
            self._mouse.press(at, right)

    def move(self, at: Pixel) -> None:
        """The pointer is at a pixel now."""
        self.controls.cursor = at
        if self._pressed:
            self.panel.move(at)
            self._mouse.move(at)

    def release(self) -> None:
        """The button goes up."""
        self._pressed, self._quiet = False, 0
        self.panel.release()
        self._mouse.release()

    def wheel(self, at: Pixel, rows: float) -> None:
        """The wheel has turned by so many pixels; downwards is farther."""
        self._quiet = 0
        if at[0] >= PANEL:
            self.view.zoom(1.12 ** (-rows / 60.0), at)

    def key_down(self, key: str) -> None:
        """A key, by its name in `Controls`; it repeats until it goes up."""
        if key in REPEATED:
            self.repeats[key] = perf_counter() + _FIRST
        self._quiet = 0
        self.controls.press(key)

    def key_up(self, key: str) -> None:
        self.repeats.pop(key, None)


def laid_out(width: float, height: float, most: float = 1e8) -> tuple[int, int]:
    """For how many pixels a picture is laid out that is shown on `width` x `height`, at most about `most` in all.

    A small one shows the same smaller. One put away as an icon has no size.
    """
    width, height = max(width, LEAST[0] / 4), max(height, LEAST[1] / 4)
    factor = min(max(1.0, LEAST[0] / width, LEAST[1] / height), sqrt(most / (width * height)))
    return round(factor * width), round(factor * height)


class Mouse:
    """What it does beside the panels: at the start turns the disk, and from outside it draws the throw; pulls a point
    later, scrubs graphs, pans.
    """

    def __init__(self, sandbox: Sandbox, view: SceneView) -> None:
        self._sandbox, self._view = sandbox, view
        self._doing = ""  # "turn", "aim", "pull", "scrub", "pan"
        self._at: Pixel = (0.0, 0.0)
        self._angle = self._turned = 0.0
        self._from = (0.0, 0.0)

    def press(self, at: Pixel, right: bool = False) -> None:
        """Take hold of what is there; with the right button, of the picture."""
        sandbox, point = self._sandbox, self._view.point_at(*at)
        self._at = at
        if right:
            self._doing = "pan"
        elif self._view.graphs.time_at(*at) is not None:
            self._doing = "scrub"
        elif point and sandbox.at_start and sandbox.is_impact and not self._view.on_disk(point):
            self._doing, self._from = "aim", point
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
        elif self._doing == "aim" and point and point != self._from:
            sandbox.aim(point[0] - self._from[0], point[1] - self._from[1])
        elif self._doing == "pull" and point:
            sandbox.pull(*point)

    def release(self) -> None:
        """Let go; the disk moves from here on as it stands."""
        doing, self._doing = self._doing, ""
        if doing == "turn" and self._turned:
            self._sandbox.turn(self._turned)
        elif doing == "aim":
            self._sandbox.throw()
        elif doing == "pull":
            self._sandbox.let_go()

    def _angle_at(self, point: tuple[float, float]) -> float:
        """Of a point [R] about the disk's centre [rad]."""
        x, y = self._view.centre
        return float(np.arctan2(point[1] - y, point[0] - x))
