"""What the mouse does to the disk: turns it before the impact, pulls a point of it afterwards."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.view.changes import go_on
from taichi_disk.view.motion import Motion
from taichi_disk.view.sandbox import Sandbox

Point = tuple[float, float]


class Mouse:
    """Places are those of the scene [R]. Between `press` and `release` the disk is held."""

    def __init__(self, sandbox: Sandbox) -> None:
        self._sandbox = sandbox
        self._turning: tuple[Motion, float] | None = None  # whose disk, and the angle at which it was taken

    def press(self, x: float, y: float) -> None:
        """Take hold of the disk, where it is not meaningless."""
        motion = self._sandbox.motion
        if motion.blown:
            return
        if motion.flying_in:
            self._turning = motion, self._angle(x, y)
        else:
            disk = motion.positions[: motion.setup.lattice.disk_points]
            motion.tie(int(np.hypot(disk[:, 0] - x, disk[:, 1] - y).argmin()), x, y)
            self._sandbox.result = None

    def move(self, x: float, y: float) -> None:
        """Turn the disk as it stands in the picture, or move the other end of the pulling spring."""
        motion = self._sandbox.motion
        if self.turning and self._turning:
            self._turn(motion, self._angle(x, y) - self._turning[1])
        elif motion.pull:
            motion.tie(motion.pull[0], x, y)

    def release(self) -> None:
        """Let go of the disk; from here on it moves as it stands."""
        if self.turning:
            motion = self._sandbox.motion
            go_on(motion, self._sandbox.scene, motion.world.physics, motion.setup, motion.positions, motion.velocities)
        self._turning = None
        self._sandbox.motion.let_go()

    @property
    def turning(self) -> bool:
        """Whether time stands still, because the disk is being turned."""
        return self._turning is not None and self._turning[0] is self._sandbox.motion

    @property
    def holding(self) -> bool:
        """Whether the disk is held."""
        return self.turning or self._sandbox.motion.pull is not None

    @property
    def tie(self) -> NDArray[np.float64] | None:
        """(2, 2) the ends of the pulling spring, or None."""
        motion = self._sandbox.motion
        return np.array([motion.positions[motion.pull[0]], motion.pull[1]]) if motion.pull else None

    def _angle(self, x: float, y: float) -> float:
        """Of (x, y) about the disk's centre of mass [rad]."""
        motion = self._sandbox.motion
        dx, dy = np.array([x, y]) - motion.state.vectors[0, : motion.setup.lattice.disk_points, :, 0].mean(axis=0)
        return float(np.arctan2(dy, dx))

    @staticmethod
    def _turn(motion: Motion, angle: float) -> None:
        n = motion.setup.lattice.disk_points
        turned = motion.state.vectors[0, :, :, 0].copy()
        lowest, centre = turned[:n, 1].min(), turned[:n].mean(axis=0)
        c, s = np.cos(angle), np.sin(angle)
        turned[:n] = centre + (turned[:n] - centre) @ np.array([[c, s], [-s, c]])
        # As high above the wall as before.
        turned[:n, 1] += lowest - turned[:n, 1].min()
        motion.positions = turned
