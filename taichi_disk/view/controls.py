"""The numbers that panel and keys turn, whoever moves them."""

from __future__ import annotations

import os
from math import log10
from pathlib import Path

import numpy as np

from taichi_disk.render.colouring import COLOURINGS
from taichi_disk.scene import AbsorbingWallScene, CompressionScene, Show
from taichi_disk.view.colouring import Scale
from taichi_disk.view.mouse import Mouse
from taichi_disk.view.sandbox import Sandbox

SCENE_NAMES = ("compression", "exponential_wall", "absorbing_wall")
BOUNDARIES = ("reset", "pinned", "dashpot")
SHOWS: tuple[Show, ...] = ("both", "springs", "points")
POINTS = (100, 200, 300, 500, 700, 1099, 1500, 2000, 3000, 5000)
LEAST_LOG_ETA, MOST_LOG_ETA = -1.0, 3.0  # the slider's left end stands for no dashpots


class Controls:
    """Acts on a sandbox; files go into the folder `out`.

    `recording` is turned by the key and carried out by the window, as are the wishes to have a picture and to close.
    """

    def __init__(self, sandbox: Sandbox, out: Path) -> None:
        self.sandbox, self.mouse, self.out = sandbox, Mouse(sandbox), out
        self.recording = self.picture_wanted = self.closing = False
        self._wishes: dict[str, int] = {}
        self.scale = self.push_scale = Scale(1e-12)
        self.reset_scale()

    # ---- numbers

    @property
    def log_eta(self) -> float:
        eta = self.sandbox.scene.material.eta_star
        return max(log10(eta), LEAST_LOG_ETA) if eta else LEAST_LOG_ETA

    def set_log_eta(self, value: float) -> None:
        eta = _rounded(value) if value > LEAST_LOG_ETA + 0.02 else 0.0
        self.sandbox.set("material.eta_star", eta)

    @property
    def _push(self) -> tuple[str, str, float]:
        scene = self.sandbox.scene
        if isinstance(scene, CompressionScene):
            return "compression.pressure", "P", scene.compression.pressure
        return "impact.velocity", "v", scene.impact.velocity

    @property
    def push(self) -> float:
        """The velocity of an impact [c], the force of a compression [M c^2/R]."""
        return self._push[2]

    @property
    def push_symbol(self) -> str:
        return self._push[1]

    @property
    def push_range(self) -> tuple[float, float]:
        return (-4.0, -1.0) if self.push_symbol == "P" else (-3.0, -0.5)

    @property
    def log_push(self) -> float:
        return log10(self.push)

    def set_log_push(self, value: float) -> None:
        self.sandbox.set(self._push[0], _rounded(value))

    @property
    def log_hardness(self) -> float:
        return log10(self.sandbox.scene.wall.a)

    def set_log_hardness(self, value: float) -> None:
        self.sandbox.set("wall.a", _rounded(value))

    @property
    def log_speed(self) -> float:
        return log10(self.sandbox.speed)

    def set_log_speed(self, value: float) -> None:
        self.sandbox.speed = _rounded(min(max(value, -2.0), 2.0))

    # Choices that something is built for: what was wished for last is built, by `build`.

    @property
    def points(self) -> int:
        """Of the disk."""
        wish = self._wishes.get("points")
        return self.sandbox.scene.lattice.points if wish is None else POINTS[wish]

    @property
    def points_number(self) -> int:
        """The place in POINTS of the number nearest to that of the disk's points."""
        return int(np.abs(np.log(np.array(POINTS) / self.points)).argmin())

    def set_points_number(self, value: int) -> None:
        self._wishes["points"] = min(max(value, 0), len(POINTS) - 1)

    def change_points(self, more: bool) -> None:
        """To the next of POINTS, if there is one."""
        beyond = [k for k, n in enumerate(POINTS) if (n > self.points if more else n < self.points)]
        if beyond:
            self._wishes["points"] = beyond[0] if more else beyond[-1]

    @property
    def seed(self) -> int:
        return self._wishes.get("seed", self.sandbox.scene.lattice.seed)

    def another_lattice(self) -> None:
        self._wishes["seed"] = self.seed + 1

    @property
    def scene_number(self) -> int:
        return self._wishes.get("scene", SCENE_NAMES.index(self.sandbox.scene.scene))

    def set_scene_number(self, value: int) -> None:
        self._wishes["scene"] = value

    @property
    def boundary_number(self) -> int | None:
        scene = self.sandbox.scene
        if not isinstance(scene, AbsorbingWallScene):
            return None
        return self._wishes.get("boundary", BOUNDARIES.index(scene.wall.boundary))

    def next_boundary(self) -> None:
        if self.boundary_number is not None:
            self._wishes["boundary"] = (self.boundary_number + 1) % len(BOUNDARIES)

    def build(self) -> None:
        """Build what was wished for, however many wishes went before."""
        wishes, self._wishes = self._wishes, {}
        if "boundary" in wishes:
            self.sandbox.set("wall.boundary", BOUNDARIES[wishes["boundary"]])
        if "points" in wishes:
            self.sandbox.set("lattice.points", POINTS[wishes["points"]])
        if "seed" in wishes:
            self.sandbox.set("lattice.seed", wishes["seed"])
        if "scene" in wishes:
            self.sandbox.switch(SCENE_NAMES[wishes["scene"]])
        if wishes:
            self.reset_scale()

    @property
    def colouring_number(self) -> int:
        return COLOURINGS.index(self.sandbox.scene.video.colour)

    def set_colouring_number(self, value: int) -> None:
        self.sandbox.set("video.colour", COLOURINGS[value])
        self.reset_scale()

    @property
    def show_number(self) -> int:
        return SHOWS.index(self.sandbox.scene.video.draw)

    def set_show_number(self, value: int) -> None:
        self.sandbox.set("video.draw", SHOWS[value])

    def reset_scale(self) -> None:
        """Begin the scales of colours and arrows again: strains of an impact reach about v/c, under a load about P."""
        push = self.push
        points = self.sandbox.scene.lattice.points
        starts = {"strain": push, "force": 0.1 * push, "speed": push, "kinetic": 0.5 * push**2 / points}
        self.scale = Scale(starts[COLOURINGS[self.colouring_number]])
        self.push_scale = Scale(0.5 * self.sandbox.motion.setup.point_force, full=100.0)

    # ---- wishes

    def pause(self) -> None:
        """Pause or go on; a meaningless state stays as it is."""
        if not self.sandbox.motion.blown:
            self.sandbox.paused = not self.sandbox.paused

    def record(self) -> None:
        """Begin or end a film."""
        self.recording = not self.recording

    def want_picture(self) -> None:
        self.picture_wanted = True

    def close(self) -> None:
        self.closing = True

    def next_file(self, suffix: str) -> Path:
        """A name in `out` that is not taken: view-1.yaml, view-2.yaml..."""
        number = 1
        while os.path.exists(path := self.out / f"view-{number}{suffix}"):  # no, where nothing can be looked up
            number += 1
        return path


def _rounded(log: float) -> float:
    return float(f"{10.0**log:.3g}")
