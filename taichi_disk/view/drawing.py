"""What is drawn beside the panel: the disk, the mouse's spring and the running graph, at any size of the window."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import taichi as ti

from taichi_disk.contact import contact_forces
from taichi_disk.lattice import Lattice
from taichi_disk.render.camera import Camera
from taichi_disk.render.colouring import COLOURINGS, QUANTITIES, spring_values
from taichi_disk.render.painter import Painter
from taichi_disk.render.picture import Subject
from taichi_disk.view.controls import SHOWS, Controls
from taichi_disk.view.graph import Graph
from taichi_disk.view.panel import WIDTH

SMALLEST = 40  # what is left for the disk in a window however small [px]
_GRAPH = 110  # height of the running graph [px]
_MARGIN = 16  # [px]
_SPRINGS = 30_000  # drawn at most: software Vulkan needs 0.6 us of a core for each


class Drawing:
    """Draws the sandbox of `controls` on a `ti.ui.Canvas`."""

    camera: Camera
    _lattice: Lattice  # with the springs that are drawn

    def __init__(self, canvas: Any, controls: Controls) -> None:
        self._canvas, self._controls = canvas, controls
        self._graph = Graph()
        self._tie = ti.Vector.field(2, ti.f32, 2)
        self._painter: Painter | None = None
        self._drawn: tuple[Any, ...] = ()
        self._shown: tuple[Any, ...] = ()

    def draw(self, size: tuple[int, int]) -> None:
        """The present state, in a window of `size` (width, height) in pixels."""
        width, height = size
        motion = self._controls.sandbox.motion
        setup, view = motion.setup, motion.setup.view
        show = SHOWS[self._controls.show_number]
        kind = setup.lattice.bonds, show == "points"  # points take their colours from all springs
        # Whatever one of these changes, the camera sees; another lattice needs another painter.
        if self._painter is None or self._drawn[0] is not kind[0] or self._drawn[1] != kind[1]:
            if self._painter:
                self._painter.destroy()
            self._lattice = setup.lattice if show == "points" else thinned(setup.lattice, _SPRINGS)
            subject = Subject(self._lattice, setup.physics.wall == "rigid", (), 1.0, view, full_force=1.0)
            self.camera = _look(view, width, height)
            self._painter = Painter(subject, self.camera, height / 720)
        elif (width, height, view) != self._drawn[2:]:
            self.camera = _look(view, width, height)
            self._painter.aim(self.camera, height / 720)
        self._drawn = (*kind, width, height, view)
        colouring, x, v = COLOURINGS[self._controls.colouring_number], motion.positions, motion.velocities
        values = self._controls.scale.places(spring_values(self._lattice, motion.world.physics, x, v, colouring))
        points, forces = contact_forces(setup.lattice, motion.world.physics, x)
        pushed = points, self._controls.push_scale.places(forces)
        self._shown = x, values, show, QUANTITIES[colouring].signed, pushed
        self._painter.paint(self._canvas, *self._shown)
        tie = self._controls.mouse.tie
        if tie is not None:
            factor, shift = self.camera.canvas_map()
            self._tie.from_numpy((factor * tie + shift).astype(np.float32))
            self._canvas.lines(self._tie, width=2.0 / height, color=(0.85, 0.45, 0.0))
        box = ((WIDTH + _MARGIN) / width, 1.0 - _MARGIN / width, _MARGIN / height, _GRAPH / height)
        self._graph.paint(self._canvas, self._controls.sandbox, box, 1.5 / height)

    def again(self) -> None:
        """The disk as it was drawn last, while the next one is not ready."""
        if self._painter:
            self._painter.paint(self._canvas, *self._shown)


def thinned(lattice: Lattice, springs: int) -> Lattice:
    """`lattice` with every k-th of its springs, `springs` at most: they stand in order from one side to the other."""
    k = -(-len(lattice.bonds) // springs)
    return replace(lattice, bonds=lattice.bonds[::k].copy(), rest_lengths=lattice.rest_lengths[::k].copy())


def _look(view: tuple[float, float, float, float], width: int, height: int) -> Camera:
    """A camera whose stage is the whole window, with `view` in the part that panel and graph leave free."""
    wide, high = max(width - WIDTH, SMALLEST), max(height - _GRAPH, SMALLEST)
    fitted = Camera.fit(view, 0, 0, wide, high, min(_MARGIN, wide // 4, high // 4))
    x, y = fitted.centre
    scale = fitted.scale
    # The middle of what is left free, at the right and above, shows the middle of the view.
    centre = (x - (width / 2 - wide / 2) / scale, y - (height / 2 - high / 2) / scale)
    return Camera(0, 0, width, height, scale, centre)
