"""The disk pressed on the rigid wall by a body force (paper section 3, eq. 3, figures 1 and 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import contact_point_force
from taichi_disk.newton import Equilibrium, compress, laid_down, lowest_lie
from taichi_disk.scene import CompressionScene
from taichi_disk.scenes.setup import Columns, Headline, Setup, spread

# Of the wall's force over the load at rest in single precision: it flickers by up to 2.5e-6, whatever N and P are.
FLICKER = 5e-6
TOUCH = 1e-3  # of the load is borne by the wall at the start: a softer start than contact, a shorter fall than none


class Compression(Setup):
    """Starts undeformed, just above the wall, as the disk would come to lie; ends when the motion has died out.

    `rest` is the equilibrium that it comes to, by Newton's method.
    """

    scene: CompressionScene
    rest: Equilibrium
    depends_on_step = False
    resolving_step = float("inf")
    less_left_over = "write compression.method: newton"

    def __init__(self, scene: CompressionScene, disk: Lattice) -> None:
        self.scene = scene
        spec, material, wall = scene.lattice, scene.material, scene.wall
        self.pressure = scene.compression.pressure
        forces = (material.k_a, material.k_b, wall.a, wall.V0, self.pressure)
        angle = lowest_lie(disk, material.k_a, wall.a, self.pressure)
        laid = laid_down(disk, angle, wall.a, wall.V0, self.pressure).positions
        self.rest = compress(disk, *forces, start=laid)
        self.lattice = laid_down(disk, self.rest.roll, wall.a, wall.V0, TOUCH * self.pressure)
        y = self.lattice.positions[:, 1]
        self.unloaded = float(y.mean() - y.min())
        self.velocities = np.zeros((spec.points, 2))
        self.physics = Physics(
            k_a=material.k_a,
            k_b=material.k_b,
            eta=material.eta_star / spec.points,
            wall="rigid",
            a=wall.a,
            V0=wall.V0,
            load=self.pressure,
        )
        # Released without damping, the contact force would swing to twice the load.
        self.point_force = contact_point_force(self.lattice, self.physics, 2.0 * self.pressure)
        unit = 1.0 / np.sqrt(material.k_a)
        self.sample_interval = float(0.1 * unit)
        self.watch = float(20.0 * unit)  # how long it has to have been at rest [R/c]
        limit = scene.compression.max_time
        self.max_time = float(5000.0 * unit) if limit == "auto" else limit
        self.view = (-1.15, 1.15, -0.1, 2.05)

    def ended(self, columns: Columns) -> NDArray[np.bool_]:
        wanted, rest = self.scene.time.tolerance, self._at_rest(columns)
        if wanted != "none":
            rest &= np.abs(sum(self._distances(columns)) - self._distance_at_rest) <= 0.5 * wanted
        moved = np.where(rest, -1, np.arange(len(rest)))
        return columns["t"] - columns["t"][np.maximum.accumulate(moved)] >= self.watch

    def _at_rest(self, columns: Columns) -> NDArray[np.bool_]:
        """For each row, whether the disk moves no more, but for the slow roll."""
        tolerance = self.scene.compression.tolerance
        force = max(1e-3 * tolerance, 0.0 if self.scene.time.precision == "f64" else FLICKER)
        return (
            (columns["kinetic"] <= tolerance * self.pressure**2 / self.scene.material.k_a)
            & (columns["residual"] <= tolerance * self.pressure / self.scene.lattice.points)
            # A vibration shows here and the slow roll does not: see `headline`.
            & (np.abs(columns["wall_force"] / self.pressure - 1.0) <= force)
        )

    @property
    def _distance_at_rest(self) -> float:
        y = self.rest.positions[:, 1]
        return float(y.mean() - y.min())

    def left_over(self, columns: Columns) -> float:
        return abs(self.headline(columns).values["xi"] - (self.unloaded - self._distance_at_rest))

    def _distances(self, columns: Columns) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centre of mass to lowest point now, and what the last of the roll will add, for each row (rows,) [R].

        The dashpots make the last roll onto the lowest place slow, theta ~ exp(-t/T), T up to 10^4 R/c. What
        remains of it follows from the last stretch of time: xi - xi_end falls as the angular momentum does.
        """
        t, spin = columns["t"], columns["angular_momentum"]
        distance = columns["com_y"] - columns["lowest_y"]
        before = np.searchsorted(t, t - self.watch)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = spin / spin[before]
            still_to_come = (distance - distance[before]) * ratio / (1.0 - ratio)
        return distance, np.where((ratio > 0.0) & (ratio < 1.0), still_to_come, 0.0)

    def unfinished(self, columns: Columns) -> str:
        wanted = self.scene.time.tolerance
        if wanted != "none" and self._at_rest(columns)[-1] and (off := self.left_over(columns)) > 0.5 * wanted:
            return (
                f"by t = {columns['t'][-1]:.6g} R/c xi is still {off:.2g} R from that of Newton's method, half of "
                f"time.tolerance = {wanted:g} is asked for, and hardly changes: the disk still rolls, or lies in "
                "another equilibrium; use compression.method: newton, or set compression.max_time higher, or write a "
                "larger time.tolerance, or none to take what it came to"
            )
        return (
            f"the disk is not at rest by t = {columns['t'][-1]:.6g} R/c (kinetic energy {columns['kinetic'][-1]:.3g} "
            f"M c^2, largest force on a point {columns['residual'][-1]:.3g} M c^2/R); use compression.method: newton, "
            "or set compression.max_time higher, or material.eta_star nearer to 100: weaker dashpots take longer, and "
            "much stronger ones let the disk bounce as a rigid body, or hardly roll"
        )

    def energy_scale(self, columns: Columns) -> float:
        # Nothing moves at first: the work of the load on the way to rest takes the kinetic energy's place.
        return float(np.ptp(columns["load"])) or self.pressure**2

    def headline(self, columns: Columns) -> Headline:
        """xi once the roll, too, has come to its end."""
        distance, still_to_come = (float(values[-1]) for values in self._distances(columns))
        end = distance + still_to_come
        return Headline(
            {
                "xi": abs(self.unloaded - end),
                "xi_nominal": abs(1.0 - end),
                "xi_extrapolated": abs(still_to_come),
            },
            {
                "xi": "centre of mass to lowest point, unloaded minus loaded [R]",
                "xi_nominal": "R = 1 minus the loaded distance from centre of mass to lowest point [R]",
                "xi_extrapolated": "part of xi from extrapolating the last slow roll [R]",
            },
        )

    def frame_times(self, columns: Columns, frames: int) -> NDArray[np.float64]:
        t, kinetic = columns["t"], columns["kinetic"]
        if self.scene.compression.method == "newton":
            return spread([0.0, 1.0, 1.0], [0.8, 0.2], frames)
        visible = t[np.flatnonzero(kinetic >= 1e-4 * kinetic.max())[-1]]
        return spread([0.0, min(visible, 0.5 * t[-1]), t[-1]], [0.85, 0.15], frames)

    def title(self) -> tuple[str, ...]:
        scene = self.scene
        return (
            f"Compression on a rigid wall ({scene.compression.method})",
            f"P = {self.pressure:g} Mc²/R    η* = {scene.material.eta_star:g}    a = {scene.wall.a:g}/R",
            f"N = {scene.lattice.points:,}    seed {scene.lattice.seed}",
        )

    def caption(self, row: dict[str, float]) -> tuple[str, ...]:
        xi = self.unloaded - (row["com_y"] - row["lowest_y"])
        newton = self.scene.compression.method == "newton"
        when = f"{row['t']:.0%} of the way" if newton else f"t = {row['t']:7.3f} R/c"
        return (when, f"ξ = {xi:.6f} R")
