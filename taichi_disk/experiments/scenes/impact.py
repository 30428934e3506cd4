"""Impacts on either wall: where the flight starts, and when the disk has left for
good."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isclose, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.computation.contact import (
    CONTACT_LEVEL,
    Contact,
    apexes,
    restitutions,
)
from taichi_disk.experiments.computation.scenario import (
    Array,
    Scenario,
    Words,
    signed,
    time_text,
)
from taichi_disk.experiments.computation.words import Lines, Numbers
from taichi_disk.experiments.scenes import oblique
from taichi_disk.experiments.scenes.bounces import LATER, NAMES, bounce_conflicts
from taichi_disk.experiments.scenes.conflicts import Conflicts, gap_conflicts
from taichi_disk.experiments.scenes.scene import DiskScene
from taichi_disk.mechanics.lattice import Lattice, disk_of
from taichi_disk.mechanics.lattice.network import bending_compliance, network_stiffness
from taichi_disk.mechanics.lattice.triangles import quarter_turned
from taichi_disk.mechanics.simulation.observables import (
    BY_NAME,
    Bounds,
    Columns,
    of_kind,
    split,
)

if TYPE_CHECKING:
    from typing_extensions import Self

    from taichi_disk.mechanics.physics import Model, Springs

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

LEAST_SHARE = 0.05  # of the energy that is worth a word [%]

LABELS = {
    "restitution": ("restitution e", ""),
    **LATER,
    "contact_time": ("contact time", "R/c"),
    **oblique.LABELS,
}
MEASURED = {
    "restitution": (
        "-v_cm(after)/v_cm(before), far from the wall, after the disk has left for good"
        "; under gravity sqrt(E(after)/E(before)) of a bounce, E: energy of the flight"
    ),
    **dict.fromkeys(LATER, "as restitution, of a later bounce"),
    "contact_time": (
        f"first to last time that the wall's force is {CONTACT_LEVEL:g} of its peak"
        " [R/c]; of several bounces that of the first"
    ),
    **oblique.MEASURED,
    "vibration_left": (
        "kinetic and elastic energy of vibration at the end of the last contact (of the"
        " run, without losses), minus that at the start, over the energy of the flight"
        " at t = 0; of several bounces, after the first. A spin stretches the disk, and"
        " that counts as vibration"
    ),
}


@dataclass(frozen=True)
class Shape:
    """The unloaded disk of an impact: its size, and how easily it bends.

    Attributes:
        radius: largest distance of a point from the centre of mass [R].
        inertia: moment of inertia about the centre of mass [M R^2].
        outline_depth: how far the outline comes within `radius` [R].
        compliance: of the softest vibration [R^2/(M c^2)].
    """

    radius: float
    inertia: float
    outline_depth: float
    compliance: float

    @property
    def is_round(self) -> bool:
        return self.outline_depth <= MAX_OUTLINE_DEPTH * self.radius


class ImpactScene(DiskScene):
    """An impact, as read from its file. A kind defines `model_of`."""

    heading = "Impact"  # first line of titles
    slip_remedy = ""  # advice for a disk that has left the wall's end
    abscissa = ("impact", "velocity")
    results = ("restitution", "contact_time")
    optional_results = (*LATER, *oblique.LABELS)

    wall: Any = None
    impact: Any = None

    @property
    def softer_k_a(self) -> float:
        """Linear spring constant of the softer of disk and wall [M c^2/R^2]."""
        return self.material.k_a

    def conflicts(self) -> Conflicts:
        found = super().conflicts() + gap_conflicts(self.wall, self.impact)
        reach = oblique.start_gap(self.wall, self.impact, self.time)
        return found + bounce_conflicts(self.impact, reach)

    def thrown_with(self, body: Lattice, velocities: Array) -> Self:
        super().thrown_with(body, velocities)
        along, up = (body.mean(one) for one in velocities.T)
        if not up < 0.0:
            raise InputError(
                f"velocities: their mean must point down, to the wall, not {up:+g} c"
            )
        speed = np.hypot(along, up)
        angle = float(np.arctan2(along, -up))
        # A scene that throws a disk so, but for rounding, stays as it is.
        is_speed = isclose(speed, self.impact.velocity, rel_tol=1e-12)
        if is_speed and abs(angle - self.impact.angle) < 1e-12:
            return self
        # exactly 0 straight down, in spite of rounding
        angle = round(angle, 12)
        return self.with_({"impact.velocity": speed, "impact.angle": angle})

    # ---- the start

    def of_body(self, body: Lattice) -> ImpactScenario:
        from taichi_disk.experiments.computation.stability import impact_point_force
        from taichi_disk.mechanics.physics import Load

        springs = self.springs(body)
        velocity = self.impact.towards
        shape = self._shape(body, springs)
        if self.impact.gravity and (self.is_oblique or not shape.is_round):
            raise InputError(
                "impact.gravity: only round bodies bounce, with their centre of mass in"
                " the middle, thrown straight down (own velocities: their mean) without"
                " spin at a wall without friction: write gravity: 0, bounces: 1 and"
                " drop: 0, or change the rest"
            )
        gap, lattice = self._placed(body, shape)
        model = self.model_of(lattice, springs)
        if self.impact.gravity:
            model = replace(model, load=Load(self.impact.gravity))
        assert model.wall is not None
        # Under gravity speeds and heights are those above the point where a rigid disk
        # would turn back.
        fall = gap - self.wall.height_of(0.5 * velocity**2)
        potential = max(model.wall.energy(lattice, lattice.positions), 0.0)
        spoke = -1
        if self.is_oblique:
            spoke = int(lattice.positions[: lattice.disk_points, 1].argmax())
        return ImpactScenario(
            scene=self,
            lattice=lattice,
            velocities=self._flight(lattice, fall),
            model=model,
            point_force=impact_point_force(lattice, model, velocity),
            max_time=self._max_time(gap, shape, springs.time_unit),
            sample_interval=self._sample_interval(shape.radius, springs.time_unit),
            view=self.view(lattice, gap),
            spoke=spoke,
            wall_step=RESOLVED * (self.wall.decay_length / velocity),
            shape=shape,
            gap=gap,
            speed_before=sqrt(velocity**2 + 2.0 * potential),
            surface=lattice.mean(lattice.positions)[1] - fall,
        )

    @abstractmethod
    def model_of(self, lattice: Lattice, springs: Springs) -> Model:
        """Return the laws that move `lattice`, the disk at t = 0 and its wall."""

    @property
    def wall_text(self) -> str:
        return f"a = {self.wall.a:g}/R"

    @property
    def is_oblique(self) -> bool:
        """Whether there is an angle, a spin or friction, so that the motion along the
        wall matters."""
        return bool(self.impact.angle or self.impact.spin or self.wall.friction)

    def start_offset(self, gap: float) -> float:
        """Return how far the disk is shifted along the wall at the start [R]."""
        return 0.0

    def view(self, lattice: Lattice, gap: float) -> tuple[float, float, float, float]:
        """Return (xmin, xmax, ymin, ymax) of the film [R]."""
        # about the path along the wall, there and back
        contact = gap * np.tan(self.impact.angle)
        path = [0.0, 3.0 * contact]
        # Friction turns spin into motion along the wall: 1.0 of it if the disk rolls,
        # up to 1.5 if the contact springs back.
        if self.wall.friction:
            rolling = (2.0 * self.impact.along - self.impact.spin) / 3.0
            path.append(contact + 1.7 * gap * rolling / self.impact.towards)
        x, y = lattice.positions[: lattice.disk_points].T
        # the same for each turn of a disk, whose centre of mass is not quite its middle
        reach = max(1.1, 0.08 + np.abs(x).max())
        top = max(2.0 + gap, 2.0 + self.impact.rise, y.max())
        return min(path) - reach, max(path) + reach, -0.1, top

    def _shape(self, body: Lattice, springs: Springs) -> Shape:
        disk = disk_of(body)
        distance = np.hypot(*(disk.positions - disk.mean(disk.positions)).T)
        radius = distance.max()
        shape = Shape(
            radius=radius,
            inertia=float(disk.mean(distance**2)),
            outline_depth=radius - distance[disk.disk_surface].min(),
            compliance=1.0 / self.softer_k_a,
        )
        if shape.is_round and disk.whole and disk.stiffness is None:
            return shape
        # A rod, a ring or a soft core bend more easily than a disk.
        k = disk.stiffened(springs.k_a)
        bending = bending_compliance(network_stiffness(disk.positions, disk.bonds, k))
        return replace(shape, compliance=max(shape.compliance, bending))

    def _placed(self, body: Lattice, shape: Shape) -> tuple[float, Lattice]:
        """Return the distance of the lowest point from the wall [R], and `body` with
        its disk turned and lifted there."""
        from taichi_disk.mechanics.statics.equilibrium import turned

        positions = body.positions.copy()
        n = body.disk_points
        if self.impact.turn:
            positions[:n] = turned(positions[:n], self.impact.turn)
        heights = positions[body.disk_surface, 1]
        lowest = heights.min()
        potential = BENDING_POTENTIAL
        if shape.is_round:
            potential = oblique.START_POTENTIAL
        gap = oblique.start_gap(
            self.wall, self.impact, self.time, heights - lowest, potential
        )
        positions[:n] += [self.start_offset(gap), gap - lowest]
        return gap, replace(body, positions=positions)

    def _flight(self, lattice: Lattice, fall: float) -> Array:
        """Return the velocities (n, 2) at the start [c], `fall` [R] above the
        surface."""
        impact = self.impact
        n = lattice.disk_points
        velocities = np.zeros_like(lattice.positions)
        before_fall = impact.towards**2 - 2.0 * impact.gravity * fall
        velocities[:n] = impact.along, -np.sqrt(before_fall)
        if impact.spin:
            arm = lattice.positions[:n] - lattice.mean(lattice.positions)
            velocities[:n] += impact.spin * quarter_turned(arm)
        return velocities

    def _sample_interval(self, radius: float, time_unit: float) -> float:
        longest = MAX_INTERVAL * time_unit
        # A spin moves the surface towards the wall, too.
        fastest = self.impact.towards + abs(self.impact.spin) * radius
        decay_time = self.wall.decay_length / fastest
        halvings = np.ceil(np.log2(longest / (DECAY_TIMES_PER_ROW * decay_time)) - 1e-9)
        return float(longest * 0.5 ** np.clip(halvings, 0, MAX_HALVINGS))

    def _max_time(self, gap: float, shape: Shape, time_unit: float) -> float:
        """Return the time limit [R/c]. The default is long enough for the flight to the
        wall, ten contacts, and a flight away at e = 0.05."""
        if self.impact.max_time != "auto":
            return self.impact.max_time
        # A contact takes pi sqrt(ln(4 c/v)) R/c by Hertz's law. A body that is not
        # round has left when none of its corners reaches down to the wall.
        velocity = self.impact.towards
        logarithm = np.log(4.0 / min(velocity * time_unit, 1.0))
        hertz_time = np.pi * time_unit * np.sqrt(logarithm)
        half_bending_period = np.pi * np.sqrt(shape.compliance)
        contact_time = max(hertz_time, half_bending_period)
        # 1 for the flight to the wall, 1/0.05 = 20 for the flight away, 1 in reserve
        flight_times = 22.0 * (gap + shape.outline_depth) / velocity
        # and for each impact a flight up and down, which lasts 2 v/g
        impact_time = 10.0 * contact_time + 4.0 * self.impact.rise / velocity
        return float(flight_times + self.impact.bounces * impact_time)


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpactScenario(Scenario):
    """A disk that flies at the wall with velocity v and leaves it: restitution e =
    -v_cm(after)/v_cm(before).

    Attributes:
        shape: the unloaded disk.
        gap: initial distance of the lowest point from the wall [R].
        speed_before: speed towards the wall before the impact, far from the wall [c].
        surface: height of the centre at which a rigid disk would turn back [R].
    """

    scene: Any
    shape: Shape
    gap: float
    speed_before: float
    surface: float

    is_thrown = True

    @property
    def velocity(self) -> float:
        """Initial velocity v of the centre of mass towards the wall [c]."""
        return self.scene.impact.towards

    @property
    def kinetic(self) -> float:
        """Initial kinetic energy M v^2/2 of the flight towards the wall [M c^2]."""
        return 0.5 * self.velocity**2

    @property
    def outline(self) -> Array:
        """Surface points (k, 2) of the disk at t = 0, from its centre of mass [R]."""
        x = self.lattice.positions
        return x[self.lattice.disk_surface] - self.lattice.mean(x)

    # ---- the end

    def end_bounds(self) -> Bounds:
        if self.falls_back:  # it may stay on the wall
            return {}
        return {"com_vy": (0.0, inf), "lowest_y": (self.gap, inf)}

    def time_to_end(self, columns: Columns) -> float:
        # A disk that leaves may vibrate so strongly that it touches again. Its lowest
        # point must be higher than at the start by sqrt(2 U/E), where U is all energy
        # except flight and spin: 1.4 to 2.3 times the measured amplitude of the rim. A
        # rod bends more. A disk that turns faster than it rises must clear the wall
        # entirely.
        last = {name: values[-1] for name, values in columns.items()}
        rising = last["com_vy"]
        impact = self.scene.impact
        if self.falls_back:
            # It stays on the wall if no energy is left to lift it to its start.
            stored = sum(last[name] for name in of_kind("energy"))
            is_high = last["com_y"] > columns["com_y"][0]
            has_ended = is_high and len(apexes(columns)) >= impact.bounces
            if has_ended or stored < columns["load"][0]:
                return 0.0
            return abs(rising) / impact.gravity + self.gap / self.velocity
        spin = last["angular_momentum"] / self.shape.inertia
        speed2 = last["com_vx"] ** 2 + rising**2
        rigid = 0.5 * (speed2 + self.shape.inertia * spin**2)
        vibration = max(last["kinetic"] + last["elastic"] - rigid, 0.0)
        amplitude = np.sqrt(2.0 * vibration * self.shape.compliance)
        clear = self.gap + min(amplitude, 2.0 * self.shape.radius)
        lowest = last["lowest_y"]
        if abs(spin) * self.shape.radius > rising:
            lowest = min(lowest, last["com_y"] - self.shape.radius)
        if rising <= 0.0:
            return inf
        return max(clear - lowest, 0.0) / rising

    def unfinished(self, columns: Columns) -> str:
        if self.falls_back:
            return (
                f"the disk has made {len(apexes(columns))} of"
                f" {self.scene.impact.bounces} bounces by t ="
                f" {columns['t'][-1]:.6g} R/c: set impact.bounces lower, or"
                " impact.max_time higher; a disk that has folded, or whose flight has"
                " become vibration, stays: set impact.velocity lower"
            )
        v = columns["com_vy"][-1]
        y = columns["lowest_y"][-1]
        name, damped = self.scene.material.dashpots
        lower = ""
        if damped:
            lower = f", or lower material.{name}"
        return (
            f"the disk has not left the wall by t = {columns['t'][-1]:.6g} R/c (v_cm ="
            f" {v:.3g} c, lowest point at {y:.3g} R); set impact.max_time"
            f" higher{lower}{self.scene.slip_remedy}"
        )

    def end_truncation_error(self, columns: Columns) -> float:
        last = far = 0.0
        if not self.falls_back:  # an apex is far from the wall
            last = float(columns["com_vy"][-1])
            far = sqrt(last**2 + 2.0 * max(columns["wall"][-1], 0.0))
        gained = self.speed_before - self.velocity + far - last
        return POTENTIAL_CAUTION * gained / self.velocity

    @cached_property
    def reference_energy(self) -> float:
        """Initial kinetic energy [M c^2] without the part of the flight along the
        wall."""
        lattice = self.lattice
        disk = self.velocities[: lattice.disk_points]
        inner = ((disk - lattice.mean(disk)) ** 2).sum(axis=1)
        return self.kinetic + 0.5 * float(lattice.mean(inner))

    @property
    def sensitivity(self) -> float:
        # The work of the spin on the flight is of the order of the geometric mean of
        # the two energies.
        return sqrt(self.reference_energy / self.kinetic)

    def result(self, columns: Columns) -> Numbers:
        contact = Contact(columns)
        found = dict(zip(NAMES, self.restitutions(columns), strict=False))
        found["contact_time"] = contact.end - contact.start
        if self.scene.is_oblique:
            inertia = self.shape.inertia
            found |= oblique.along_the_wall(columns, self.outline, inertia)
            if not (self.model.has_friction or self.model.elastic):
                del found["tangential_impulse"]  # 0, but for rounding errors
        return found

    def result_scales(self, columns: Columns) -> Numbers:
        scales = {"restitution": 1.0, "contact_time": 0.0}
        scales |= dict.fromkeys(LATER, 1.0)
        if self.scene.is_oblique:
            inertia = self.shape.inertia
            scales |= oblique.scales_along_the_wall(columns, self.outline, inertia)
        return scales

    def restitutions(self, columns: Columns) -> list[float]:
        """Return e of each bounce."""
        impact = self.scene.impact
        speed = self.speed_before
        found = restitutions(columns, speed, impact.gravity, self.surface)
        return found[: impact.bounces]

    def bounces(self, columns: Columns) -> str:
        """Return e of each bounce so far, as a text."""
        known = [f"{e:.3f}" for e in self.restitutions(columns) if e]
        return " ".join(["e:", *known])

    def conclusion(self, columns: Columns) -> str:
        before = self.speed_before
        after = before * self.restitutions(columns)[0]
        direction = ""
        if self.scene.is_oblique:
            along = columns["com_vx"]
            before = np.hypot(before, along[0])
            after = np.hypot(after, along[-1])
            direction = ", to the right" if along[-1] > 0.0 else ", to the left"
        text = f"It comes back at {after / before:.3f} of its speed{direction}"
        if self.falls_back:
            text = f"Bounce by bounce {self.bounces(columns)}"
        energies = split(columns, self.shape.inertia)
        whole = energies["kinetic"][0]
        shares = {name: 100.0 * one[-1] / whole for name, one in energies.items()}
        parts = [
            f"{BY_NAME[name].label} took {shares[name]:.3g} %"
            for name in reversed(of_kind("loss"))
            if shares[name] > LEAST_SHARE
        ]
        ringing = shares["vibration"] + shares["elastic"]
        if ringing > LEAST_SHARE:
            parts.append(f"{ringing:.3g} % is left in the disk")
        if parts:
            text += f". Of the energy, {', '.join(parts)}"
        return f"{text}."

    def motion(self, columns: Columns) -> Array:
        if self.falls_back:
            return columns["com_y"] - self.surface
        return columns["com_vy"] / self.velocity

    @property
    def words(self) -> Words:
        motion = "velocity of the centre  [v]"
        mark = "e = {restitution:.3f}"
        if self.scene.is_oblique:
            motion = "normal velocity over initial"
        if self.falls_back:
            motion = "height  [R]"
            mark = "after the last bounce"
        return Words(
            title=self._title(),
            symbol="e",
            labels=LABELS,
            measured=MEASURED,
            marks=(mark, "contact time {contact_time:.4g} R/c"),
            motion=motion,
            quality=("energy imbalance\n/ initial kinetic", "linear"),
            truncation_remedy="a larger impact.gap ends it farther from the wall",
        )

    def _title(self) -> Lines:
        numbers = "    ".join(self.numbers().values())
        return self.scene.heading, numbers, self.scene.described(self.lattice)

    def numbers(self) -> dict[str, str]:
        """Return the parameters that a title shows, by what they describe."""
        scene = self.scene
        impact = scene.impact
        numbers = {
            "velocity": f"v = {impact.velocity:g} c",
            "damping": scene.damping,
            "wall": scene.wall_text,
        }
        optional = {
            "{:g} rad from the normal": impact.angle,
            "spin {:g} c/R": impact.spin,
            "μ = {:g}": scene.wall.friction,
            "turned by {:g}": impact.turn,
            "g = {:g} c²/R": impact.gravity,
        }
        numbers |= {text: text.format(one) for text, one in optional.items() if one}
        if self.own.velocities is not None:
            numbers["start"] = "own velocities"
        return numbers

    def caption(self, row: Numbers) -> Lines:
        time = time_text(row["t"])
        if not self.scene.is_oblique:
            return time, f"{signed(row['com_vy'] / self.velocity)} v"
        speed = self.scene.impact.velocity
        across = signed(row["com_vx"] / speed)
        up = signed(row["com_vy"] / speed)
        spin = row["angular_momentum"] / self.shape.inertia
        return time, f"{across}, {up} v", f"spin {signed(spin, 3)} c/R"
