"""The window on a desktop: the films' picture, live, with keys, mouse and a few of GGUI's own widgets."""

from __future__ import annotations

import os
from collections.abc import Generator
from dataclasses import replace
from functools import partial
from math import atan2, hypot
from pathlib import Path
from textwrap import wrap
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.engine import ti
from taichi_disk.errors import TaichiDiskError
from taichi_disk.fields import QUANTITIES
from taichi_disk.output.files import prepare_output
from taichi_disk.render.geometry import Camera, arrows, edge_height
from taichi_disk.render.offscreen import elsewhere
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.controls import REPEATED, Controls, Entry
from taichi_disk.window.sandbox import AIM, Sandbox
from taichi_disk.window.scales import UPDATE_INTERVAL, Scales
from taichi_disk.window.session import MAX_PASSED

FASTEST = 75  # pictures per second that are shown at most: more are not seen, and cost
SIZE = (1280, 860)  # of the window at first [px]
PANEL = 300  # width of the widgets [px]
_FIRST, _AGAIN = 0.35, 0.07  # when a held key repeats [s]
_SLIDERS = ("material.eta_star", "material.viscosity", "impact.velocity", "compression.pressure", "wall.a")
_BUTTONS = (("space", "drop / pause"), ("r", "to the start"), ("h", "hit again"), ("b", "scene <"), ("n", "scene >"))
# GGUI has no other letters.
_ASCII = str.maketrans(
    {"η": "eta", "ξ": "xi", "μ": "mu", "·": "*", "²": "2", "°": " deg", "−": "-", "×": "x", "…": "..."}
)


class Viewer:
    """Holds the one window that may be alive; `pictures` ends when it has been closed.

    Attributes:
        sandbox, controls: the disk, and what can be done.
        camera: through which the disk is seen.
    """

    camera: Camera
    painter: Painter

    def __init__(
        self, playlist: list[Entry], out: Path, screen: tuple[int, int] | None, fastest: int = FASTEST
    ) -> None:
        """Files go into `out`; `screen`: its size [px], if it is known.

        Raises InputError if `out` cannot be written, TaichiDiskError if there is no window, or no disk of this scene.
        """
        prepare_output(out)
        self._out = out.resolve()
        # A title bar, and what a desktop keeps for itself, have to fit on the screen as well.
        width, height = screen or (10_000, 10_000)
        size = min(SIZE[0], width - 60), min(SIZE[1], height - 90)
        self.sandbox = Sandbox(playlist[0].load(), KernelCache())
        self.controls, self._scales = Controls(self.sandbox, playlist), Scales(self.sandbox)
        for action in (
            ("i u", "closer, farther", self._zoom, 1.12, 1 / 1.12),
            ("BackSpace", "see everything", self.see_all),
            ("g", "go to the contact", self._see_contact),
            ("Return", "follow the disk", self._toggle_following),
            ("p", "save a picture", self._save_picture),
            ("w", "save the scene", lambda: self.sandbox.save(self._next_file(".yaml"))),
            ("Tab", "these keys", self._toggle_keys),
            ("q", "close the window", self._close),
        ):
            self.controls.add(*action)
        self._closing = self._keys_shown = self._follows = False
        self._at = (0.0, 0.0)  # where the mouse is [px]
        self._doing, self._from = "", (0.0, 0.0)
        self._repeats: dict[str, float] = {}
        self._bonds: Any = None  # of the lattice that `painter` is for
        self._count = 0
        try:
            self._window = ti.ui.Window("taichi-disk view", size, fps_limit=fastest, pos=(30, 30))
        except RuntimeError as error:
            raise TaichiDiskError(f"no window: {error}") from error

    def pictures(self) -> Generator[tuple[float, int], None, None]:
        """Yield seconds of the clock since the picture before, and steps made for it, until the window is closed."""
        window, last = self._window, perf_counter()
        with elsewhere():
            try:
                while window.running and not self._closing:
                    raise_if_interrupted()
                    now = perf_counter()
                    elapsed, last = now - last, now
                    made = self.sandbox.advance(min(elapsed, MAX_PASSED))
                    self._draw()
                    self._draw_widgets()
                    window.show()
                    self._listen()
                    yield elapsed, made
            finally:
                window.destroy()

    # ---- the picture

    def _draw(self) -> None:
        seen, video = self.sandbox.seen, self.sandbox.scene.video
        scenario = seen.segment.scenario
        springs, wall, lattice = scenario.model.springs, scenario.model.wall, scenario.lattice
        assert wall
        fresh = self._bonds is not lattice.bonds
        if fresh:
            self.painter, self._bonds = Painter(lattice, springs, wall), lattice.bonds
        painter = self.painter
        painter.springs, painter.wall, painter.spoke = springs, wall, scenario.spoke
        painter.edge = edge_height(wall, scenario.point_force)
        painter.colour, painter.draw, painter.theme = video.colour, video.draw, video.theme
        painter.magnify = self.controls.value("video.magnify")
        size = tuple(self._window.get_window_shape())
        if fresh or size != (self.camera.width, self.camera.height):
            self.see_all()
        if self._follows:
            self.camera = replace(self.camera, look_at=self._centre)
        if self._count % UPDATE_INTERVAL == 0:
            points, forces = wall.contact_forces(lattice, seen.x, seen.v, springs)
            values = painter.values(seen.x, seen.v)[: lattice.disk_points]
            self._scales.update(values, np.column_stack([points, forces]))
        self._count += 1
        painter.limit, painter.full_force = self._scales.colour, self._scales.force
        canvas = self._window.get_canvas()
        painter.paint(canvas, self.camera, seen.x, seen.v)
        for foot, tip in self._strokes():
            px, along = 1.0 / self.camera.scale, np.subtract(tip, foot)
            shape = arrows(np.array([foot]), along[None] / 0.35, 9 * px, 3 * px, px, THEMES[video.theme])
            painter.draw_shape(canvas, shape, self.camera)

    def _strokes(self) -> list[tuple[Any, Any]]:
        """Arrows (foot, tip) [R] of the throw that is drawn, and of the mouse that pulls."""
        sandbox, found = self.sandbox, []
        if sandbox.aimed:
            (velocity, angle), (x, y) = sandbox.aimed, self._centre
            found.append(((x, y), (x + velocity / AIM * np.sin(angle), y - velocity / AIM * np.cos(angle))))
        if sandbox.dragged:
            found.append((sandbox.seen.x[sandbox.dragged[0]], sandbox.dragged[1]))
        return found

    def _draw_widgets(self) -> None:
        sandbox, controls, gui = self.sandbox, self.controls, self._window.get_gui()
        seen, (width, _) = sandbox.seen, self._window.get_window_shape()
        entry, quantity = controls.playlist[controls.number], QUANTITIES[sandbox.scene.video.colour]
        with gui.sub_window("taichi-disk", 0.0, 0.0, PANEL / width, 1.0) as panel:

            def write(*lines: str) -> None:
                for line in lines:
                    for part in wrap(line.translate(_ASCII), PANEL // 7 - 2) or [""]:
                        panel.text(part)

            write(entry.name, *seen.segment.scenario.title(), "")
            for key, label in _BUTTONS:
                if panel.button(label):
                    controls.press(key)
            for key in [key for key in _SLIDERS if key in controls.ranges]:
                one, value = controls.ranges[key], float(controls.value(key))
                name = one.name.split()[-1].translate(_ASCII)
                new = panel.slider_float(name, value, one.low, one.high)
                if abs(new - value) > 1e-6 * (one.high - one.low):
                    controls.set(key, float(f"{new:.3g}"))
            write(
                "",
                *seen.segment.scenario.caption(seen.values | {"t": seen.t}),
                f"energy imbalance {sandbox.imbalance:+.1e}",
            )
            write(f"colours: {quantity.label}", f"up to {self._scales.colour:.3g} {quantity.unit}")
            write("disturbed" if seen.is_disturbed else "same as taichi-disk run", *sandbox.warnings, sandbox.message)
            for result in sandbox.results[-5:]:
                write(f"{sandbox.segment.scenario.symbol} = {result.value:.6f} {result.disturbance}")
            if self._keys_shown:
                write(*(f"{keys:<11}{what}" for keys, what in controls.reference))

    # ---- the camera

    @property
    def _centre(self) -> tuple[float, float]:
        x, y = self.painter.lattice.mean(self.sandbox.seen.x)
        return float(x), float(y)

    def see_all(self) -> None:
        """See the whole scene."""
        left, right, low, high = self.sandbox.seen.segment.scenario.view
        if not len(self.painter.lattice.wall_surface):
            low = self.painter.edge - 0.14
        self._see((left, right, low, max(high, float(self.sandbox.seen.x[:, 1].max()) + 0.02)))

    def _see_contact(self) -> None:
        x, low = self._centre[0], self.painter.edge
        self._see((x - 0.28, x + 0.28, low - 0.12, low + 0.3))

    def _see(self, view: tuple[float, float, float, float]) -> None:
        width, height = self._window.get_window_shape()
        viewport = min(PANEL, 0.5 * width), float(width), 0.0, float(height)
        self.camera, self._follows = Camera.fit(view, width, height, 6.0, viewport), False

    def _zoom(self, factor: float) -> None:
        self.camera = self.camera.zoomed(factor, self._at)

    def _toggle_following(self) -> None:
        self._follows = not self._follows

    # ---- keys and mouse

    def _listen(self) -> None:
        window, now = self._window, perf_counter()
        events = list(window.get_events(ti.ui.PRESS))
        # GGUI updates the mouse when it is asked for events, so its position is read after them.
        x, y = window.get_cursor_pos()
        before, self._at = self._at, (x * self.camera.width, (1.0 - y) * self.camera.height)
        for event in events:
            if event.key in (ti.ui.LMB, ti.ui.RMB):
                self._press(event.key == ti.ui.RMB)
            else:
                key = "space" if event.key == ti.ui.SPACE else event.key
                self._repeats |= {key: now + _FIRST} if key in REPEATED else {}
                self.controls.press(key)
        for key in list(self._repeats):
            if not window.is_pressed(key):
                del self._repeats[key]
            elif now >= self._repeats[key]:
                self._repeats[key] = now + _AGAIN
                self.controls.press(key)
        if self._doing and not (window.is_pressed(ti.ui.LMB) or window.is_pressed(ti.ui.RMB)):
            self._release()
        elif self._doing:
            self.controls.attempt(partial(self._move, before))

    def _press(self, right: bool) -> None:
        """Take hold of what is there: of the picture, the disk at the start, the throw beside it, a point later."""
        if self._at[0] < PANEL:
            return
        sandbox, (x, y), (cx, cy) = self.sandbox, self.camera.to_scene(self._at), self._centre
        disk = sandbox.seen.x[: self.painter.lattice.disk_points]
        inside = hypot(x - cx, y - cy) <= np.hypot(*(disk - (cx, cy)).T).max()
        throwing = sandbox.at_start and sandbox.is_thrown
        self._doing = "pan" if right else "pull" if not throwing else "turn" if inside else "aim"
        self._from = (atan2(y - cy, x - cx), 0.0) if self._doing == "turn" else (float(x), float(y))

    def _move(self, before: tuple[float, float]) -> None:
        sandbox, (x, y), (cx, cy) = self.sandbox, self.camera.to_scene(self._at), self._centre
        if self._doing == "pan":
            self.camera = self.camera.panned(self._at[0] - before[0], self._at[1] - before[1])
        elif self._doing == "turn":
            self._from = self._from[0], atan2(y - cy, x - cx) - self._from[0]
            sandbox.turn(self._from[1], final=False)
        elif self._doing == "aim" and (x, y) != self._from:
            sandbox.aim(x - self._from[0], y - self._from[1])
        elif self._doing == "pull":
            sandbox.pull(float(x), float(y))

    def _release(self) -> None:
        doing, self._doing = self._doing, ""
        if doing == "turn" and self._from[1]:
            self.controls.attempt(partial(self.sandbox.turn, self._from[1]))
        elif doing == "aim":
            self.sandbox.throw()
        elif doing == "pull":
            self.controls.attempt(self.sandbox.let_go)

    def _toggle_keys(self) -> None:
        self._keys_shown = not self._keys_shown

    def _close(self) -> None:
        self._closing = True

    # ---- files

    def _next_file(self, suffix: str) -> Path:
        """A name in the folder that is not taken: view-1.yaml, view-2.yaml..."""
        number = 1
        while os.path.exists(path := self._out / f"view-{number}{suffix}"):
            number += 1
        return path

    def _save_picture(self) -> None:
        path = self._next_file(".png")
        self._draw()
        self._window.save_image(str(path))
        self.sandbox.message = f"wrote {path}"
