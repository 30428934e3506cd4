"""Impacts on either wall: where the flight starts, and when the disk has left for
good."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from taichi_disk.computation.contact import CONTACT_LEVEL, contact_interval
from taichi_disk.computation.scenario import Array, Scenario, distribute
from taichi_disk.errors import InputError
from taichi_disk.lattice import Lattice, disk_of
from taichi_disk.lattice.network import bending_compliance, network_stiffness
from taichi_disk.scenes import oblique
from taichi_disk.scenes.conflicts import Conflicts, gap_conflicts
from taichi_disk.scenes.scene import DiskScene
from taichi_disk.simulation.observables import Columns

if TYPE_CHECKING:
    from typing_extensions import Self

    from taichi_disk.physics import Model

# e counts the wall's potential at the start and at the end as speed, but the potential
# also deforms the disk. With potentials of 1e-7 the error of e was up to 0.15 of this
# correction, measured against potentials of 1e-10.
POTENTIAL_CAUTION = 0.2
# Time between two rows in decay times 1/(a v) of the wall. The wall pushes a point for
# a few decay times, and on a hard wall the first and the last of these times bound the
# contact.
DECAY_TIMES_PER_ROW = 0.3
# longest time between two rows, in time units of the springs: some 100 rows of contact
MAX_INTERVAL = 0.05
MAX_HALVINGS = 8  # how often MAX_INTERVAL may be halved: some 30,000 rows
# [radius]: a body with a deeper outline bends more easily than a disk
MAX_OUTLINE_DEPTH = 0.2
# Wall potential over kinetic energy at the start and the end of a body with a deeper
# outline, whose ends swing back to the wall. With 1e-7 the error of e of a rod was
# 1.5e-6.
BENDING_POTENTIAL = 1e-10
# largest path per step, in decay lengths of the wall, at which a second run shows the
# error
RESOLVED = 0.49


class ImpactScene(DiskScene):
    """An impact, as read from its file."""

    abscissa: ClassVar[tuple[str, str]] = ("impact", "velocity")
    results: ClassVar[tuple[str, ...]] = ("restitution", "contact_time")
    optional_results: ClassVar[tuple[str, ...]] = tuple(oblique.RESULTS)

    wall: Any = None
    impact: Any = None

    @property
    def softer_k_a(self) -> float:
        """Linear spring constant of the softer of disk and wall [M c^2/R^2]."""
        return self.material.k_a

    def conflicts(self) -> Conflicts:
        return super().conflicts() + gap_conflicts(self.wall, self.impact)

    def thrown_with(self, body: Lattice, velocities: Array) -> Self:
        along, up = (float(body.mean(one)) for one in velocities.T)
        if not up < 0.0:
            raise InputError(
                f"velocities: their mean must point down, to the wall, not {up:+g} c"
            )
        # exactly 0 straight down, in spite of rounding
        angle = round(float(np.arctan2(along, -up)), 12)
        return self.with_(
            {"impact.velocity": float(np.hypot(along, up)), "impact.angle": angle}
        )


class ImpactScenario(Scenario):
    """A disk that flies at the wall with velocity v and leaves it: restitution e =
    -v_cm(after)/v_cm(before).

    Attributes:
        velocity: initial velocity v of the centre of mass towards the wall [c].
        oblique: whether there is an angle, a spin or friction, so that the motion along
            the wall matters.
        gap: initial distance of the lowest point from the wall [R].
        kinetic: initial kinetic energy M v^2/2 of the flight towards the wall [M c^2].
    """

    truncation_remedy = "a larger impact.gap ends it farther from the wall"
    kind = "Impact"
    is_thrown = True
    symbol, end_words = "e", "the disk has left"
    labels: ClassVar = {
        "restitution": ("restitution e", ""),
        "contact_time": ("contact time", "R/c"),
        **{name: (label, unit) for name, (label, unit, _) in oblique.RESULTS.items()},
    }
    notes: ClassVar = {
        "restitution": (
            "-v_cm(after)/v_cm(before), far from the wall, after the disk has left for"
            " good"
        ),
        "contact_time": (
            f"first to last time that the wall's force is {CONTACT_LEVEL:g} of its peak"
            " [R/c]"
        ),
        **{name: note for name, (_, _, note) in oblique.RESULTS.items()},
    }

    def __init__(self, scene: Any, body: Lattice) -> None:
        from taichi_disk.computation.stability import impact_point_force
        from taichi_disk.statics.equilibrium import turned

        impact, springs = scene.impact, scene.springs(body)
        self.scene, self.springs = scene, springs
        self.velocity, self.kinetic = impact.towards, 0.5 * impact.towards**2
        self.oblique = bool(impact.angle or impact.spin or scene.wall.friction)

        disk = disk_of(body)
        distance = np.hypot(*(disk.positions - disk.mean(disk.positions)).T)
        self._radius, self._inertia = (
            float(distance.max()),
            float(disk.mean(distance**2)),
        )
        self._outline_depth = self._radius - float(distance[disk.disk_surface].min())
        is_round = self._outline_depth <= MAX_OUTLINE_DEPTH * self._radius
        self._compliance = 1.0 / scene.softer_k_a
        if not (is_round and disk.whole and disk.stiffness is None):
            stiffness = network_stiffness(
                disk.positions, disk.bonds, disk.stiffened(springs.k_a)
            )
            self._compliance = max(self._compliance, bending_compliance(stiffness))

        positions, n = body.positions.copy(), body.disk_points
        if impact.turn:
            positions[:n] = turned(positions[:n], impact.turn)
        heights = positions[body.disk_surface, 1]
        potential = oblique.START_POTENTIAL if is_round else BENDING_POTENTIAL
        self.gap = oblique.start_gap(
            scene.wall, impact, scene.time, heights - heights.min(), potential
        )
        positions[:n] += [self._offset(), self.gap - heights.min()]
        self._outline = positions[body.disk_surface] - body.mean(positions[:n])
        self.lattice, self.velocities = (
            replace(body, positions=positions),
            np.zeros_like(positions),
        )
        self.velocities[:n] = impact.along, -self.velocity
        if impact.spin:
            arm = positions[:n] - body.mean(positions)
            self.velocities[:n] += impact.spin * np.stack(
                [-arm[:, 1], arm[:, 0]], axis=1
            )
        self.model = self._model()
        assert self.model.wall is not None
        stored = max(self.model.wall.energy(self.lattice, positions), 0.0)
        # far from the wall
        self._speed_before = float(np.sqrt(self.velocity**2 + 2.0 * stored))

        longest, decay_time = (
            MAX_INTERVAL * springs.time_unit,
            scene.wall.decay_length / self.velocity,
        )
        halvings = np.ceil(np.log2(longest / (DECAY_TIMES_PER_ROW * decay_time)) - 1e-9)
        self.sample_interval = float(
            longest * 0.5 ** np.clip(halvings, 0, MAX_HALVINGS)
        )
        self.wall_step = RESOLVED * decay_time
        self.point_force = impact_point_force(self.lattice, self.model, self.velocity)
        self.max_time = (
            self._default_max_time() if impact.max_time == "auto" else impact.max_time
        )
        self.view = self._view()
        if self.oblique:
            self.spoke = int(positions[:n, 1].argmax())

    @abstractmethod
    def _model(self) -> Model: ...

    def _offset(self) -> float:
        return 0.0

    def _view(self) -> tuple[float, float, float, float]:
        # about the path along the wall, there and back
        along = 3.0 * self.gap * float(np.tan(self.scene.impact.angle))
        return min(along, 0.0) - 1.1, max(along, 0.0) + 1.1, -0.1, 2.0 + self.gap

    def _default_max_time(self) -> float:
        """Return the time [R/c] of the flight to the wall, ten contacts, and a flight
        away with e = 0.05."""
        # A contact takes pi sqrt(ln(4 c/v)) R/c by Hertz's law. A body that is not
        # round has left when none of its corners reaches down to the wall.
        unit = self.springs.time_unit
        contact = np.pi * unit * np.sqrt(np.log(4.0 / min(self.velocity * unit, 1.0)))
        # half a period of bending
        contact = max(contact, np.pi * np.sqrt(self._compliance))
        return float(
            22.0 * (self.gap + self._outline_depth) / self.velocity + 10.0 * contact
        )

    def end_bounds(self) -> dict[str, tuple[float, float]]:
        return {"com_vy": (0.0, np.inf), "lowest_y": (self.gap, np.inf)}

    def ended(self, columns: Columns) -> bool:
        # A disk that leaves may vibrate so strongly that it touches again. Its lowest
        # point must be higher than at the start by sqrt(2 U/E), where U is all energy
        # except flight and spin: 1.4 to 2.3 times the measured amplitude of the rim. A
        # rod bends more. A disk that turns faster than it rises must clear the wall
        # entirely.
        last = {name: float(values[-1]) for name, values in columns.items()}
        spin = last["angular_momentum"] / self._inertia
        rigid = 0.5 * (
            last["com_vx"] ** 2 + last["com_vy"] ** 2 + self._inertia * spin**2
        )
        vibration = max(last["kinetic"] + last["elastic"] - rigid, 0.0)
        clear = self.gap + min(
            np.sqrt(2.0 * vibration * self._compliance), 2.0 * self._radius
        )
        falls = abs(spin) * self._radius > last["com_vy"]
        lowest = (
            min(last["lowest_y"], last["com_y"] - self._radius)
            if falls
            else last["lowest_y"]
        )
        return bool(last["com_vy"] > 0.0 and lowest >= clear)

    def unfinished(self, columns: Columns) -> str:
        v, y = columns["com_vy"][-1], columns["lowest_y"][-1]
        name, damped = self.scene.material.dashpots
        lower = f", or lower material.{name}" if damped else ""
        return (
            f"the disk has not left the wall by t = {columns['t'][-1]:.6g} R/c (v_cm ="
            f" {v:.3g} c, lowest point at {y:.3g} R); set impact.max_time higher{lower}"
        )

    def end_truncation_error(self, columns: Columns) -> float:
        gained = (
            self._speed_before
            - self.velocity
            + self._speed_after(columns)
            - float(columns["com_vy"][-1])
        )
        return POTENTIAL_CAUTION * gained / self.velocity

    @property
    def reference_energy(self) -> float:
        """Initial kinetic energy [M c^2] without the part of the flight along the
        wall."""
        lattice, disk = self.lattice, self.velocities[: self.lattice.disk_points]
        return self.kinetic + 0.5 * float(
            lattice.mean(((disk - lattice.mean(disk)) ** 2).sum(axis=1))
        )

    @property
    def sensitivity(self) -> float:
        # The work of the spin on the flight is of the order of the geometric mean of
        # the two energies.
        return float(np.sqrt(self.reference_energy / self.kinetic))

    def result(self, columns: Columns) -> dict[str, float]:
        start, end = contact_interval(
            columns["t"], columns["wall_force"], columns["com_vy"]
        )
        found = {
            "restitution": self._speed_after(columns) / self._speed_before,
            "contact_time": end - start,
        }
        return found | (
            oblique.along_the_wall(columns, self._outline, self._inertia)
            if self.oblique
            else {}
        )

    def result_scales(self, columns: Columns) -> dict[str, float]:
        scales = {"restitution": 1.0, "contact_time": 0.0}
        return scales | (
            oblique.scales_along_the_wall(columns, self._outline, self._inertia)
            if self.oblique
            else {}
        )

    def _speed_after(self, columns: Columns) -> float:
        return float(
            np.sqrt(columns["com_vy"][-1] ** 2 + 2.0 * max(columns["wall"][-1], 0.0))
        )

    def marks(self, columns: Columns) -> tuple[str, str]:
        found = self.result(columns)
        return (
            f"e = {found['restitution']:.5f}",
            f"contact time {found['contact_time']:.4g} R/c",
        )

    def quality(self, columns: Columns) -> tuple[Array, str, str]:
        lost = (columns["total"] - columns["total"][0]) / self.reference_energy
        return lost, "energy imbalance\n/ initial kinetic", "linear"

    def motion(self, columns: Columns) -> tuple[Array, str]:
        label = "velocity of the centre\nof mass, $v_{cm}/v$"
        if self.oblique:
            label = "velocity away\nfrom the wall, $v_n/v_n(0)$"
        return columns["com_vy"] / self.velocity, label

    def frame_times(self, columns: Columns, frames: int) -> Array:
        start, end = contact_interval(
            columns["t"], columns["wall_force"], columns["com_vy"]
        )
        last = columns["t"][-1]
        margin = 0.1 * (end - start)
        first, second = (
            max(start - margin, 0.1 * start),
            min(end + margin, 0.9 * last + 0.1 * end),
        )
        # The film shows the contact in slow motion, and the flights before and after it
        # briefly.
        flights = [
            min(0.5 * flight, 0.2 * (second - first))
            for flight in (first, last - second)
        ]
        return distribute(
            [0.0, first, second, last], [flights[0], second - first, flights[1]], frames
        )

    def title(self) -> tuple[str, ...]:
        scene = self.scene
        impact, friction = scene.impact, scene.wall.friction
        start = f"    {impact.angle:g} rad from the normal" if impact.angle else ""
        start += f"    spin {impact.spin:g} c/R" if impact.spin else ""
        start += f"    μ = {friction:g}" if friction else ""
        start += f"    turned by {impact.turn:g}" if impact.turn else ""
        start += "    own velocities" if self.own_velocities else ""
        return (
            self.kind,
            (
                f"v = {impact.velocity:g} c    {scene.damping}    a ="
                f" {scene.wall.a:g}/R{start}"
            ),
            scene.described(self.lattice),
        )

    def caption(self, row: dict[str, float]) -> tuple[str, ...]:
        time = f"t = {row['t']:7.3f} R/c"
        if not self.oblique:
            return time, f"velocity {row['com_vy'] / self.velocity:+.3f} v"
        spin = row["angular_momentum"] / self._inertia
        return (
            time,
            f"v {row['com_vx']:+.4f}, {row['com_vy']:+.4f} c",
            f"spin {spin:+.4f} c/R",
        )
