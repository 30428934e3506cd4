"""The disk pressed on a rigid wall (figures 1 and 2): xi against P, eq. (2)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from taichi_disk.base.progress import Progress, silent
from taichi_disk.experiments.computation.scenario import Array, Scenario, Words
from taichi_disk.experiments.computation.words import Lines, Numbers
from taichi_disk.experiments.config.sections import (
    CompressionSection,
    MaterialSection,
    WallSection,
)
from taichi_disk.experiments.scenes.conflicts import Conflicts
from taichi_disk.experiments.scenes.scene import DiskScene
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.simulation.observables import Bounds, Columns

if TYPE_CHECKING:
    from taichi_disk.experiments.computation.outcome import Outcome
    from taichi_disk.mechanics.statics.equilibrium import Equilibrium

# fraction of the load that the wall bears at the start, so that the disk is released
# gently
TOUCH = 1e-3
LABELS = {
    "xi": ("compression xi", "R"),
    "xi_nominal": ("compression xi, from nominal radius", "R"),
}
MEASURED = {
    "xi": "centre of mass to lowest point, unloaded minus loaded [R]",
    "xi_nominal": (
        "R = 1 minus the loaded distance from centre of mass to lowest point [R]"
    ),
    "xi_extrapolated": (
        "part of xi that comes from extrapolating the last slow roll [R]"
    ),
}


class CompressionScene(DiskScene):
    """A compression on a rigid wall, as read from its file."""

    title = "compression on a rigid wall"
    abscissa = ("compression", "pressure")
    results = ("xi", "xi_nominal", "xi_extrapolated")

    scene: Literal["compression"] = "compression"
    # so that the vibration dies out
    material: MaterialSection = MaterialSection(eta_star=100.0)
    wall: WallSection = WallSection()
    compression: CompressionSection = CompressionSection()

    def conflicts(self) -> Conflicts:
        conflicts = super().conflicts()
        if self.time.tolerance != "none" and self.compression.method == "newton":
            text = (
                "Newton's method takes no time step, and solves to rounding: write"
                " none, or method: relaxation"
            )
            conflicts.append(("time.tolerance", text))
        return conflicts

    def notes(self, points: int) -> list[str]:
        return []  # damping does not change the equilibrium

    def in_time(self) -> CompressionScene:
        return self.with_({"compression.method": "relaxation"})

    def of_body(self, body: Lattice) -> Compression:
        from taichi_disk.experiments.computation.stability import contact_point_force
        from taichi_disk.mechanics.physics import ExponentialWall, Load, Model
        from taichi_disk.mechanics.statics.equilibrium import (
            depth,
            place_on_wall,
            relaxed,
            resting_angle,
            solve_equilibrium,
        )

        pressure = self.compression.pressure
        springs = self.springs(body)
        wall = ExponentialWall(self.wall.a, self.wall.V0)
        model = Model(springs, wall, Load(pressure))
        disk = relaxed(body, springs)
        angle = resting_angle(disk, springs.modulus, wall.a, pressure)
        near = place_on_wall(disk, angle, wall, pressure).positions
        rest = solve_equilibrium(disk, model, near)
        lattice = place_on_wall(disk, rest.roll, wall, TOUCH * pressure)
        limit = self.compression.max_time
        if limit == "auto":
            limit = 5000.0 * springs.time_unit
        x, y = lattice.positions.T
        reach = max(1.15, 0.1 + np.abs(x).max())
        kind = Compression
        if self.compression.method == "newton":
            kind = Loading
        return kind(
            scene=self,
            lattice=lattice,
            velocities=np.zeros_like(lattice.positions),
            model=model,
            # A disk that is released without damping loads the contact with up to twice
            # the load.
            point_force=contact_point_force(lattice, model, 2.0 * pressure),
            max_time=limit,
            sample_interval=0.1 * springs.time_unit,
            quiet_time=20.0 * springs.time_unit,
            view=(-reach, reach, -0.1, max(2.05, y.max())),
            rest=rest,
            unloaded=depth(lattice, lattice.positions),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Compression(Scenario):
    """A disk released just above the wall, undeformed, which comes to rest under its
    load.

    A lattice with strained springs first relaxes without the load. The disk starts at
    the angle of the equilibrium `rest`: rolling there takes 10^4 R/c. Nothing else of
    `rest` enters a relaxation.

    Attributes:
        rest: equilibrium under the load by Newton's method.
        unloaded: distance from the centre of mass to the lowest point at t = 0 [R].
    """

    scene: CompressionScene
    rest: Equilibrium
    unloaded: float

    step_dependent = False

    @property
    def pressure(self) -> float:
        """The load P [M c^2/R]."""
        return self.scene.compression.pressure

    def quasistatic(self, loads: int, progress: Progress = silent) -> Outcome:
        from taichi_disk.experiments.scenes.loading import quasistatic

        return quasistatic(self, loads, progress)

    def end_bounds(self) -> Bounds:
        # A vibration shows in the wall's force. A slow roll does not, so the kinetic
        # energy has a bound, too.
        tolerance = self.scene.compression.tolerance
        return {
            "kinetic": (0.0, tolerance * self.pressure**2 / self.model.springs.modulus),
            "residual": (0.0, tolerance * self.pressure / self.lattice.disk_points),
            "wall_force": (
                self.pressure * (1.0 - 1e-3 * tolerance),
                self.pressure * (1.0 + 1e-3 * tolerance),
            ),
        }

    def time_to_end(self, columns: Columns) -> float:
        wanted = self.scene.time.tolerance
        if wanted == "none" or self.end_truncation_error(columns) <= 0.5 * wanted:
            return 0.0
        return self.row_interval

    def end_truncation_error(self, columns: Columns) -> float:
        from taichi_disk.mechanics.statics.equilibrium import depth

        return abs(
            self.result(columns)["xi"]
            - (self.unloaded - depth(self.lattice, self.rest.positions))
        )

    def unfinished(self, columns: Columns) -> str:
        end = {name: values[-1] for name, values in columns.items()}
        best = "eta_star nearer to 100"
        if self.scene.material.viscosity != "auto":
            best = f"viscosity nearer to {100 / self.lattice.disk_points:.2g}"
        remedy = "use compression.method: newton, or set compression.max_time higher"
        allowed = ""
        if self.scene.time.tolerance != "none":
            allowed = ", and time.tolerance allows half of it"
            remedy += ", or write a larger time.tolerance"
        return (
            f"the disk is not at rest by t = {end['t']:.6g} R/c (kinetic energy"
            f" {end['kinetic']:.3g} M c^2, largest force on a point"
            f" {end['residual']:.3g} M c^2/R; xi still differs by"
            f" {self.end_truncation_error(columns):.2g} R from that of Newton's"
            f" method{allowed}); {remedy}, or material.{best}: weaker dashpots take"
            " longer, and much stronger ones let the disk bounce as a rigid body, or"
            " hardly roll"
        )

    def energy_scale(self, columns: Columns) -> float:
        # The disk starts at rest, so the work of the load replaces the initial kinetic
        # energy.
        return float(np.ptp(columns["load"])) or self.pressure**2

    @property
    def reference_energy(self) -> float:
        return self.pressure**2 / self.model.springs.modulus

    def result(self, columns: Columns) -> Numbers:
        """Return xi at rest, and the part of xi that is extrapolated from the last
        roll."""
        # Dashpots slow the last roll down, theta ~ exp(-t/T) with T up to 10^4 R/c. xi
        # - xi_end falls like the angular momentum, so the last rows determine what is
        # missing.
        t = columns["t"]
        spin = columns["angular_momentum"]
        distance = columns["com_y"] - columns["lowest_y"]
        before = np.searchsorted(t, t[-1] - self.quiet_time)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = spin[-1] / spin[before]
        remaining = 0.0
        if 0.0 < ratio < 1.0:
            change = distance[-1] - distance[before]
            remaining = float(change * ratio / (1.0 - ratio))
        end = float(distance[-1]) + remaining
        return {
            "xi": self.unloaded - end,
            "xi_nominal": abs(1.0 - end),
            "xi_extrapolated": abs(remaining),
        }

    def quality(self, columns: Columns) -> Array:
        return columns["residual"]

    def motion(self, columns: Columns) -> Array:
        height = columns["com_y"] - columns["lowest_y"]
        return self.result(columns)["xi"] + height[-1] - height

    def momentary_motion(self, row: Any) -> Any:
        return self.unloaded - (row["com_y"] - row["lowest_y"])

    @property
    def words(self) -> Words:
        return Words(
            title=self._title(),
            symbol="ξ",
            labels=LABELS,
            measured=MEASURED,
            marks=("ξ = {xi:.3g} R", ""),
            motion="compression ξ  [R]",
            momentary=("compression ξ", "R"),
            quality=("largest force on\na point  [Mc²/R]", "log"),
            truncation_remedy="write compression.method: newton",
        )

    def _title(self) -> Lines:
        scene = self.scene
        load = f"P = {self.pressure:g} Mc²/R"
        parameters = f"{load}    {scene.damping}    a = {scene.wall.a:g}/R"
        if self.own.velocities is not None:
            parameters += "    own velocities"
        return (
            f"Compression on a rigid wall ({scene.compression.method})",
            parameters,
            scene.described(self.lattice),
        )

    def conclusion(self, columns: Columns) -> str:
        xi = self.result(columns)["xi"]
        return f"Its centre lies {xi:.3g} R lower than without the load."

    def caption(self, row: Numbers) -> Lines:
        return *super().caption(row), _shown(self.momentary_motion(row))


class Loading(Compression):
    """A load that grows so slowly that the disk is always at rest. `t` is the fraction
    of the full load."""

    static = True

    @property
    def words(self) -> Words:
        return replace(super().words, time="fraction of the load P", pace="")

    def motion(self, columns: Columns) -> Array:
        return columns["xi"]

    def continuum(self, columns: Columns) -> Columns:
        # the moduli of other points are not known
        if self.lattice.origin != f"seed {self.scene.lattice.seed}":
            return {}
        found = self.scene.moduli(self.lattice.disk_points)
        loads = self.pressure * columns["t"], found.young, found.poisson
        return {
            "eq. (2), b = 1": paper_compression(*loads),
            "exact law, rigid wall": exact_compression(*loads),
        }

    def caption(self, row: Numbers) -> Lines:
        return f"P = {100.0 * row['t']:.0f} % of {self.pressure:g} Mc²/R", _shown(
            row["xi"]
        )


def _shown(xi: float) -> str:
    return f"ξ = {round(xi, 4) + 0.0:.4f} R"  # no "-0"


def paper_compression(pressure: Any, young: Any, poisson: Any, b: Any = 1.0) -> Any:
    """Return xi = b P/(pi E) {ln(4 pi E R/(b P)) - 1 - nu} [R], eq. (2), of numbers or
    arrays."""
    p = b * pressure / (np.pi * young)
    return p * (np.log(4.0 / p) - 1.0 - poisson)


def exact_compression(pressure: Any, young: Any, poisson: Any) -> Any:
    """Return xi = P/(pi E) {ln(pi E R/P) - (1 + nu)/4} [R]: a disk under a uniform body
    force P, on one hard contact.

    xi is measured from the centre of mass. The law follows from Michell's series for
    the disk and Hertz's pressure in the contact (Johnson, Contact Mechanics, 1985,
    section 5.6, treats two contacts). Its relative error is O(P/E).
    """
    p = pressure / (np.pi * young)
    return p * (np.log(1.0 / p) - 0.25 * (1.0 + poisson))
