"""The window on a desktop: the films' picture, live, with keys, mouse and a few of
GGUI's own widgets."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace
from itertools import count
from math import atan2, hypot
from pathlib import Path
from textwrap import wrap
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.engine import ti
from taichi_disk.fields import QUANTITIES
from taichi_disk.output.files import prepare_output, write_text
from taichi_disk.render.geometry import ArrowStyle, Camera, arrows, edge_height
from taichi_disk.render.offscreen import elsewhere, open_window
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.web.drawing import contact_forces
from taichi_disk.window.controls import REPEATING_KEYS, Controls, Preset
from taichi_disk.window.graphs import ScaleMaxima
from taichi_disk.window.sandbox import AIM_SCALE, Sandbox

MAX_RATE = 75  # pictures per second: more are not visible, and cost
# initial size of the window, which fits on the screen of any laptop [px]
WINDOW_SIZE = (1200, 700)
PANEL_WIDTH = 300  # width of the widgets [px]
# delay before a held key repeats, and between repeats [s]
_REPEAT_DELAY = 0.35
_REPEAT_INTERVAL = 0.07
_SLIDERS = (
    "material.eta_star",
    "material.viscosity",
    "impact.velocity",
    "compression.pressure",
    "wall.a",
)
_BUTTONS = (
    ("space", "drop / pause"),
    ("r", "to the start"),
    ("h", "hit again"),
    ("b", "scene <"),
    ("n", "scene >"),
)
# GGUI can show only ASCII.
_ASCII = str.maketrans(
    {
        "η": "eta",
        "ξ": "xi",
        "μ": "mu",
        "·": "*",
        "²": "2",
        "°": " deg",
        "−": "-",
        "×": "x",
    }
)


class Viewer:
    """The window on the screen; only one may be open in a process. `pictures` ends when
    the user closes it.

    Attributes:
        sandbox, controls: the disk, and what can be done with it.
        camera: the camera that shows the disk.
    """

    camera: Camera
    painter: Painter

    def __init__(
        self, playlist: list[Preset], out: Path, max_rate: int = MAX_RATE
    ) -> None:
        """Open the window, which writes its files into `out`.

        Raises InputError if `out` cannot be written, TaichiDiskError if there is no
        window, or no disk of this scene.
        """
        prepare_output(out)
        self._out = out.resolve()
        self.sandbox = Sandbox(playlist[0].load(), KernelCache())
        self.controls = Controls(self.sandbox, playlist)
        self._scales = ScaleMaxima(self.sandbox)
        add = self.controls.add
        add("i u", "closer, farther", self._zoom, 1.12, 1 / 1.12)
        add("BackSpace", "see everything", self.see_all)
        add("g", "go to the contact", self._see_contact)
        add("Return", "follow the disk", self._toggle, "follow")
        add("p w", "save a picture, the scene", self._save, ".png", ".yaml")
        add("Tab", "these keys", self._toggle, "keys")
        add("q", "close the window", self._toggle, "close")
        # modes that are on: "follow", "keys", "close"
        self._modes: set[str] = set()
        self._at = (0.0, 0.0)  # position of the mouse [px]
        # Action of the pressed mouse at (x, y) [R]; the third argument says whether it
        # has been released.
        self._drag: Callable[[float, float, bool], None] | None = None
        self._repeat = 0.0  # when held keys act again
        self._bonds: Any = None  # of the lattice that `painter` is for
        self._window = open_window(
            "taichi-disk view", WINDOW_SIZE, fps_limit=max_rate, pos=(30, 30)
        )

    def pictures(self) -> Generator[int, None, None]:
        """Yield the number of steps made for each picture, until the window is
        closed."""
        window = self._window
        with elsewhere():
            try:
                while window.running and "close" not in self._modes:
                    raise_if_interrupted()
                    made = self.sandbox.tick()
                    self._draw()
                    self._draw_widgets()
                    window.show()
                    self._listen()
                    yield made
            finally:
                window.destroy()

    # ---- the picture

    def _draw(self) -> None:
        sandbox = self.sandbox
        state = self.sandbox.time.display
        video = self.sandbox.scene.video
        scenario = state.segment.scenario
        springs = scenario.model.springs
        wall = scenario.model.wall
        lattice = scenario.lattice
        fresh = self._bonds is not lattice.bonds
        if fresh:
            self.painter = Painter(lattice, springs, wall)
            self._bonds = lattice.bonds
        painter = self.painter
        painter.springs = springs
        painter.wall = wall
        painter.spoke = scenario.spoke
        painter.edge = edge_height(wall, scenario.point_force)
        painter.colour = video.colour
        painter.draw = video.draw
        painter.theme = video.theme
        painter.magnify = self.controls.value("video.magnify")
        if fresh or self._window.get_window_shape() != (
            self.camera.width,
            self.camera.height,
        ):
            self.see_all()
        if "follow" in self._modes:
            self.camera = replace(self.camera, look_at=self._centre)
        values = painter.values(state.x, state.v)[: lattice.disk_points]
        forces = contact_forces(wall, lattice, springs, state.x, state.v)
        self._scales.update(values, forces, video.colour)
        painter.limit = self._scales.colour
        painter.full_force = self._scales.force
        canvas = self._window.get_canvas()
        is_soft = self._window.is_soft
        painter.paint(canvas, self.camera, state.x, state.v, is_soft=is_soft)
        # (foot, tip) [R] of the drawn throw and of the mouse's pull
        strokes: list[Any] = []
        if sandbox.drawn_throw:
            velocity, angle = sandbox.drawn_throw
            centre = np.array(self._centre)
            direction = np.array([np.sin(angle), -np.cos(angle)])
            strokes.append((centre, centre + velocity / AIM_SCALE * direction))
        if sandbox.grip:
            strokes.append((state.x[sandbox.grip[0]], sandbox.grip[1]))
        for foot, tip in np.array(strokes):
            px = 1.0 / self.camera.scale
            style = ArrowStyle(shaft=3.0 * px, head=9.0 * px, rim=px, fade=px)
            theme = THEMES[video.theme]
            shape = arrows(foot[None], tip[None] - foot, style, theme.arrow, theme)
            painter.draw_shape(canvas, shape, self.camera)

    def _draw_widgets(self) -> None:
        sandbox = self.sandbox
        controls = self.controls
        gui = self._window.get_gui()
        state = sandbox.time.display
        (width, _) = self._window.get_window_shape()
        entry = controls.playlist[controls.number]
        quantity = QUANTITIES[sandbox.scene.video.colour]
        with gui.sub_window("taichi-disk", 0.0, 0.0, PANEL_WIDTH / width, 1.0) as panel:

            def write(*lines: str) -> None:
                for line in lines:
                    for part in wrap(line.translate(_ASCII), PANEL_WIDTH // 7 - 2) or [
                        ""
                    ]:
                        panel.text(part)

            write(entry.name, *state.segment.scenario.words.title, "")
            for key, label in _BUTTONS:
                if panel.button(label):
                    controls.press(key)
            for key in [key for key in _SLIDERS if key in controls.ranges]:
                one = controls.ranges[key]
                value = float(controls.value(key))
                new = panel.slider_float(
                    one.name.split()[-1].translate(_ASCII), value, one.low, one.high
                )
                if abs(new - value) > 1e-6 * (one.high - one.low):
                    controls.attempt(controls.set, key, float(f"{new:.3g}"))
            write("", *state.segment.scenario.caption(state.values | {"t": state.t}))
            write(f"energy imbalance {sandbox.time.segment.imbalance:+.1e}")
            write(
                f"colours: {quantity.label}",
                f"up to {self._scales.colour:.3g} {quantity.unit}",
            )
            write(sandbox.status, *sandbox.warnings, sandbox.message)
            for row in sandbox.results[-5:]:
                write(f"{row.result} = {row.value:.6f} {row.disturbance}")
            if "keys" in self._modes:
                for keys, meaning in controls.reference:
                    write(f"{keys:<11}{meaning}")

    # ---- the camera

    @property
    def _centre(self) -> tuple[float, float]:
        x, y = self.painter.lattice.mean(self.sandbox.time.display.x)
        return float(x), float(y)

    def see_all(self) -> None:
        """See the whole scene."""
        state = self.sandbox.time.display
        left, right, low, high = state.segment.scenario.view
        if not len(self.painter.lattice.wall_surface):
            low = self.painter.edge - 0.14
        top = float(state.x[:, 1].max()) + 0.02
        self._see((left, right, low, max(high, top)))

    def _see_contact(self) -> None:
        x = self._centre[0]
        low = self.painter.edge
        self._see((x - 0.28, x + 0.28, low - 0.12, low + 0.3))

    def _see(self, view: tuple[float, float, float, float]) -> None:
        width, height = self._window.get_window_shape()
        viewport = min(PANEL_WIDTH, 0.5 * width), float(width), 0.0, float(height)
        self.camera = Camera.fit(view, width, height, 6.0, viewport)
        self._modes.discard("follow")

    def _zoom(self, factor: float) -> None:
        self.camera = self.camera.zoomed(factor, self._at)

    # ---- keys and mouse

    def _listen(self) -> None:
        """Carry out what the user has done since the last picture."""
        window = self._window
        now = perf_counter()
        events = window.get_events(ti.ui.PRESS)
        # GGUI updates the mouse when it is asked for events, so its position is read
        # after them.
        x, y = window.get_cursor_pos()
        self._at = x * self.camera.width, (1.0 - y) * self.camera.height
        for event in events:
            if event.key in (ti.ui.LMB, ti.ui.RMB):
                self._press(event.key == ti.ui.RMB)
            else:
                key = "space" if event.key == ti.ui.SPACE else event.key
                self.controls.press(key)
                self._repeat = now + _REPEAT_DELAY
        if now >= self._repeat:
            self._repeat = now + _REPEAT_INTERVAL
            for key in filter(window.is_pressed, REPEATING_KEYS):
                self.controls.press(key)
        if self._drag:
            is_over = not (window.is_pressed(ti.ui.LMB) or window.is_pressed(ti.ui.RMB))
            self.controls.attempt(
                self._drag, *self.camera.to_scene(self._at).tolist(), is_over
            )
            self._drag = None if is_over else self._drag

    def _press(self, right: bool) -> None:
        """Choose what a drag of the mouse does from where it was pressed.

        The right button moves the picture. Before the throw, the left button turns the
        disk, or aims if the mouse is beside the disk; later it pulls the nearest point.
        """
        if self._at[0] < PANEL_WIDTH:
            return
        sandbox = self.sandbox
        (cx, cy) = self._centre
        x0, y0 = self.camera.to_scene(self._at).tolist()
        disk = sandbox.time.display.x[: self.painter.lattice.disk_points]
        radius = np.hypot(*(disk - self._centre).T).max()
        is_inside = hypot(x0 - cx, y0 - cy) <= radius

        def pan(x: float, y: float, is_over: bool) -> None:
            self.camera = self.camera.panned(
                (x - x0) * self.camera.scale, (y0 - y) * self.camera.scale
            )

        def turn(x: float, y: float, is_over: bool) -> None:
            angle = atan2(y - cy, x - cx) - atan2(y0 - cy, x0 - cx)
            if angle:
                sandbox.turn(angle, is_over)

        def aim(x: float, y: float, is_over: bool) -> None:
            if is_over:
                sandbox.throw()
            elif (x, y) != (x0, y0):
                sandbox.aim(x - x0, y - y0)

        def pull(x: float, y: float, is_over: bool) -> None:
            if is_over:
                sandbox.release()
            else:
                sandbox.pull(x, y)

        if right:
            self._drag = pan
        elif not sandbox.can_aim:
            self._drag = pull
        elif is_inside:
            self._drag = turn
        else:
            self._drag = aim

    def _toggle(self, mode: str) -> None:
        self._modes ^= {mode}

    # ---- files

    def _save(self, suffix: str) -> None:
        """Write a picture (.png) or the scene (.yaml) into a file whose name is not
        taken: view-1.yaml, view-2.yaml…"""
        paths = (self._out / f"view-{number}{suffix}" for number in count(1))
        path = next(path for path in paths if not path.exists())
        if suffix == ".png":
            self._draw()
            self._window.save_image(str(path))
        else:
            write_text(path, self.sandbox.scene.to_yaml())
        message = f"wrote {path}"
        if suffix == ".yaml" and self.sandbox.time.display.segment.label:
            message += ", without the changes during the motion"
        self.sandbox.message = message
