"""What is drawn beside the panel: the disk through a camera, the scales, the graphs, at any size of the window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.render.geometry import Camera, View, edge_height
from taichi_disk.render.legend import Legend, draw_line, ink, text_width
from taichi_disk.render.painter import Painter, draw_triangles
from taichi_disk.render.palette import THEMES, Theme, round_near
from taichi_disk.window.history import Segment
from taichi_disk.window.overlay import Graphs, Overlay
from taichi_disk.window.sandbox import AIM, Sandbox, push_of

SIZE = (1280, 860)  # of the window at first [px]
PANEL = 292  # width of the controls [px]
_GRAPHS = 176  # height of the graphs [px]
_LOOK = 5  # pictures between two looks at whether the scales still hold what they show
_BELOW = 0.14  # what is seen of the rigid wall [R]
_CONTACT = 0.55  # width of what is seen of a contact [R]


class SceneView:
    """Draws `sandbox`.

    Attributes:
        painter: of the disk that is seen.
        camera: through which it is seen.
        graphs: below it.
        follows: whether the camera stays with the disk's centre of mass.
        hint: what is written below the title, if anything.
    """

    painter: Painter
    camera: Camera

    def __init__(self, sandbox: Sandbox) -> None:
        self.sandbox, self.graphs = sandbox, Graphs(sandbox)
        self.follows, self.hint = False, ""
        self._bonds: Any = None  # of the lattice that `painter` is for
        self._hit = (0, 0)  # number of the start, and of the hit since then
        self._look: tuple[tuple[int, int], str, tuple[str, ...]] = ((0, 0), "", ())  # size, theme, title
        self._kept: dict[str, tuple[Any, NDArray[np.float32]]] = {}
        self._count, self._at_home = 0, True

    # ---- the camera

    def home(self) -> None:
        """See the whole scene."""
        left, right, low, high = self.sandbox.seen.segment.scenario.view
        if not len(self.painter.lattice.wall_surface):
            low = self.painter.edge - _BELOW
        self._see((left, right, low, max(high, float(self.sandbox.seen.x[:, 1].max()) + 0.02)), 6.0)
        self._at_home = True

    def contact(self) -> None:
        """See where the disk meets the wall."""
        x, low = self.centre[0], self.painter.edge
        self._see((x - 0.5 * _CONTACT, x + 0.5 * _CONTACT, low - 0.12, low + 0.3), 0.0)

    def _see(self, view: View, margin: float) -> None:
        self.camera = Camera.fit(view, *self._size, margin, self._viewport)
        self.follows = self._at_home = False

    def zoom(self, factor: float, at: tuple[float, float]) -> None:
        """`factor` times as large; what is at the pixel `at`, or else in the middle, stays there."""
        self.camera = self.camera.zoomed(factor, at if self.point_at(*at) else self._middle)
        self._at_home = False

    def pan(self, columns: float, rows: float) -> None:
        """Move everything by so many pixels."""
        self.camera, self._at_home = self.camera.panned(columns, rows), False

    def follow(self) -> None:
        """Stay with the disk's centre of mass from now on, or no longer; one out of view comes to the middle."""
        column, row = self.camera.to_pixels(self.centre)
        if not self.point_at(column, row):
            column, row = self._middle
        self.camera = replace(self.camera, look_at=self.centre, middle=(float(column), float(row)))
        self.follows, self._at_home = not self.follows, False

    @property
    def _middle(self) -> tuple[float, float]:
        left, right, top, bottom = self._viewport
        return (left + right) / 2, (top + bottom) / 2

    @property
    def centre(self) -> tuple[float, float]:
        """The centre of mass of the disk that is seen [R]."""
        x, y = self.painter.lattice.mean(self.sandbox.seen.x)
        return float(x), float(y)

    def on_disk(self, point: tuple[float, float]) -> bool:
        """Whether `point` [R] lies no farther from the disk's centre than its farthest point does."""
        x, n = self.sandbox.seen.x, self.painter.lattice.disk_points
        return bool(np.hypot(*(np.array(point) - self.centre)) <= np.hypot(*(x[:n] - self.centre).T).max())

    def point_at(self, column: float, row: float) -> tuple[float, float] | None:
        """What lies at a pixel [R]; None beside the disk's part of the window."""
        left, right, top, bottom = self._viewport
        x, y = self.camera.to_scene((column, row))
        return (float(x), float(y)) if left <= column < right and top <= row < bottom else None

    # ---- drawing

    def draw(self, canvas: Any, size: tuple[int, int]) -> None:
        """What is seen, on a `ti.ui.Canvas` of `size` (width, height) [px]."""
        seen = self.sandbox.seen
        self._suit(seen.segment, size)
        painter = self.painter
        if self.follows:
            self.camera = replace(self.camera, look_at=self.centre)
        painter.paint(canvas, self.camera, seen.x, seen.v, max(self._legend.unit, 0.6))
        if self._count % _LOOK == 0:
            self._grow()
        self._count += 1
        look = self._look, self._hit, tuple(self.graphs.full.values())
        scale = painter.colour, painter.limit, painter.full_force, self.camera.scale
        self._keep("still", (look, scale, self._overhangs()), self._fill_still)
        segment = self.sandbox.segment
        rows = segment.began, segment.attempt, segment.count
        self._keep("curves", (look, rows), self.graphs.draw_curves)
        self._keep("moving", None, self._fill_moving)
        draw_triangles(canvas, np.concatenate([vertices for _, vertices in self._kept.values()]))

    def _suit(self, segment: Segment, size: tuple[int, int]) -> None:
        """See to it that painter, scales and camera suit what is shown."""
        video, scenario = self.sandbox.scene.video, segment.scenario
        fresh = self._bonds is not scenario.lattice.bonds
        if fresh:
            self.painter = Painter(scenario.lattice, scenario.model.springs, scenario.model.wall)
        painter, self._bonds = self.painter, scenario.lattice.bonds
        painter.springs, painter.wall, painter.spoke = scenario.model.springs, scenario.model.wall, scenario.spoke
        painter.edge = edge_height(scenario.model.wall, scenario.point_force)
        painter.draw, painter.theme = video.draw, video.theme
        hit, look = (self.sandbox.starts, segment.hit), (size, video.theme, scenario.title())
        if hit != self._hit:
            self.graphs.begin()
            painter.full_force = round_near(0.5 * scenario.point_force)
        if hit != self._hit or video.colour != painter.colour:
            painter.colour = video.colour
            push = push_of(scenario.scene)  # before anything is known
            full = 0.25 * push**2 / scenario.scene.lattice.points if video.colour == "kinetic" else 0.05 * push
            painter.limit, self._count = round_near(full), 0
        if fresh or look != self._look:
            self._lay_out(size, segment)
        if fresh or look[0] != self._look[0] or (hit != self._hit and self._at_home):
            self.home()
        self.camera = replace(self.camera, viewport=self._viewport)  # another title may have another height
        self._hit, self._look = hit, look

    def _lay_out(self, size: tuple[int, int], segment: Segment) -> None:
        """Divide the window."""
        width, height = self._size = size
        left, bottom, each = PANEL, height - _GRAPHS, (width - PANEL) / 2
        samples = (*self._caption(segment, 1e3), "1 s shows 0.05 R/c")
        title = segment.scenario.title()
        self._legend = Legend(self.painter, width - left, bottom, title, samples, len(samples))
        self._viewport = (left, width, self._legend.header, bottom - self._legend.footer)
        self.graphs.boxes = tuple(
            (left + k * each + 50.0, bottom + 44.0, left + (k + 1) * each - 24.0, height - 34.0) for k in range(2)
        )

    def _grow(self) -> None:
        """Let the scales grow with what they have to show; they begin again with each hit."""
        painter = self.painter
        painter.limit = max(painter.limit, painter.scale(painter.shown))
        _, forces = painter.wall.contact_forces(painter.lattice, self.sandbox.seen.x)
        largest = float(np.hypot(*forces.T).max(initial=0.0))
        if largest > painter.full_force:
            painter.full_force = round_near(1.2 * largest)
        self.graphs.grow()

    def _caption(self, segment: Segment, t: float) -> tuple[str, ...]:
        return segment.scenario.caption(self.sandbox.seen.values | {"t": t})

    @property
    def theme(self) -> Theme:
        return THEMES[self.painter.theme]

    def _keep(self, name: str, key: Any, fill: Callable[[Overlay], None]) -> None:
        """Keep what `fill` puts on an overlay; it is filled again where `key` is another, or None."""
        if key is None or self._kept.get(name, (None,))[0] != key:
            overlay = Overlay(ink(self.theme.ground))
            fill(overlay)
            self._kept[name] = key, overlay.vertices(*self._size)

    def _overhangs(self) -> bool:
        """Whether something is drawn above or below the viewport."""
        y, (_, _, top, bottom) = self.sandbox.seen.x[:, 1], self._viewport
        lowest, highest = self.camera.to_pixels([(0.0, y.min()), (0.0, y.max())])[:, 1]
        return not self._at_home or highest < top or lowest > bottom

    def _fill_still(self, overlay: Overlay) -> None:
        """It covers what was drawn above and below the viewport, where that is so: to fill costs 2 ns a pixel."""
        (left, _, top, bottom), (width, height), ground = self._viewport, self._size, ink(self.theme.ground)
        if self._overhangs():
            overlay.rectangle((left, 0, width, top - 1), ground)
            overlay.rectangle((left, bottom, width, height), ground)
        self.graphs.draw_frames(overlay, self.theme)
        overlay.left = left
        self._legend.draw(overlay, self.camera.scale)

    def _draw_throw(self, overlay: Overlay, velocity: float, angle: float) -> None:
        """An arrow from the disk's centre, as long as the mouse has drawn it, and its numbers."""
        along, across = np.array([[np.sin(angle), -np.cos(angle)], [np.cos(angle), np.sin(angle)]]) * velocity / AIM
        tip = self.centre + along
        wings = [tip - 0.12 * along + side * across for side in (0.06, -0.06)]
        ends = self.camera.to_pixels([self.centre, tip, wings[0], tip, wings[1]])
        overlay.curve(ends[:, 0], ends[:, 1], 2.0, (230, 115, 0))
        text = f"v = {velocity:g} c,  angle {angle:+g} rad"
        x, row = ends[1] + (12.0, -8.0)
        overlay.rectangle(
            (x - 5.0, row - 13.0, x + text_width(text, 12.0, True) + 5.0, row + 5.0), ink(self.theme.ground)
        )
        draw_line(overlay, (x, row), text, 12.0, ink(self.theme.ink), True)

    def _fill_moving(self, overlay: Overlay) -> None:
        """Cursors, the mouse's spring, the time and the pace, what happened last."""
        sandbox, seen, theme, (left, right, top, _) = self.sandbox, self.sandbox.seen, self.theme, self._viewport
        self.graphs.draw_cursor(overlay, theme)
        if sandbox.dragged:
            ends = self.camera.to_pixels([seen.x[sandbox.dragged[0]], sandbox.dragged[1]])
            overlay.curve(ends[:, 0], ends[:, 1], 3.0, (230, 115, 0))
        if sandbox.aimed:
            self._draw_throw(overlay, *sandbox.aimed)
        for k, line in enumerate(wrap(self.hint or sandbox.message, max(int((right - left - 36.0) / 7.5), 20))):
            row = top + 18.0 * (k + 1)
            end = left + 24 + text_width(line, 12.0, True)
            overlay.rectangle((left + 12, row - 13, end, row + 5), ink(theme.ground))
            draw_line(overlay, (left + 18.0, row), line, 12.0, ink(theme.ink), True)
        pace = "" if sandbox.paused else f"1 s shows {float(f'{sandbox.pace:.2g}'):g} R/c"
        overlay.left = left
        self._legend.draw_lines(overlay, (*self._caption(seen.segment, self.graphs.t), pace))
