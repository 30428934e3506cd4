"""States of a run at the times of its pictures, and the scales that fit them, from one
replay."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice

import numpy as np

from taichi_disk.computation.contact import greatest_compression
from taichi_disk.computation.driver import State
from taichi_disk.fields import Triangles, at_points
from taichi_disk.lattice import Array
from taichi_disk.render.geometry import (
    View,
    edge_height,
    flattening,
    magnification,
    placed,
)
from taichi_disk.render.moments import Run, contact_of
from taichi_disk.render.palette import full_scale, round_near
from taichi_disk.statics.equilibrium import turned

# number of times, from the contact to the greatest compression, that determine the
# colour scale of a film
_SCALE_TIMES = 12
# longest arrow over the arrow of `full_force`, so that arrows stay in the picture
_MAX_ARROW = 4.0
# smallest distance of the disk to the left and right edge of the picture [R]
_SIDE_MARGIN = 0.05
# greatest visible height of a disk that flies on until all compared runs have ended [R]
_MAX_HEIGHT = 4.0
_WALL_DEPTH = 0.16  # visible part of the rigid wall below its edge [R]
# most memory for positions between the choice of the scales and the pictures
MAX_BYTES = 5e8
# largest deviation of a point from a rigid motion, over the largest speed
_RIGID = 1e-9


# ---- flights


@dataclass(frozen=True)
class Flight:
    """The states of a run, and the flights before t = 0 and after its end.

    Attributes:
        start, end: first and last time of a film of the whole run [R/c].
        velocity, spin: rigid motion before t = 0 [c], [c/R].
    """

    run: Run
    start: float
    end: float
    velocity: Array
    spin: float

    @classmethod
    def of(cls, run: Run, height: float) -> Flight:
        """Return the flight that begins and ends with the disk at `height` [R] above
        the wall's edge, or higher if the run begins there.

        Without a rigid motion at t = 0, or with dashpots that would slow a spin, there
        is no flight.
        """
        scenario = run.scenario
        columns = run.series
        last = float(columns["t"][-1])
        velocity, spin = _rigid_motion(run)
        springs = scenario.model.springs
        is_slowed = bool(spin) and springs.damped and not springs.axial
        if not scenario.is_thrown or height == 0.0 or velocity is None or is_slowed:
            return cls(run, 0.0, last, np.zeros(2), 0.0)
        edge = edge_height(scenario.model.wall, run.largest_force)
        first = columns["lowest_y"][0]
        final = columns["lowest_y"][-1]
        top = max(edge + height, first)
        start = (top - first) / velocity[1]
        end = last + max(top - final, 0.0) / columns["com_vy"][-1]
        return cls(run, float(start), float(end), velocity, spin)

    def frames(self, times: Array) -> Iterator[State]:
        """Yield the moments at ascending `times` [R/c]."""
        times = np.asarray(times)
        is_before = times < 0.0
        for t in times[is_before]:
            yield self._before(float(t))
        if not is_before.all():
            yield from self.run.frames(times[~is_before])

    def _before(self, t: float) -> State:
        scenario = self.run.scenario
        lattice = scenario.lattice
        n = scenario.lattice.disk_points
        centre = lattice.mean(lattice.positions)
        arms = turned(lattice.positions[:n] - centre, self.spin * t)
        x = lattice.positions.copy()
        x[:n] = centre + self.velocity * t + arms
        v = scenario.velocities.copy()
        v[:n] = self.velocity + self.spin * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
        return State(t, x, v)


def _rigid_motion(run: Run) -> tuple[Array | None, float]:
    """Return velocity [c] and spin [c/R] of the disk at t = 0; None without a rigid
    motion."""
    lattice = run.scenario.lattice
    velocities = run.scenario.velocities
    n = lattice.disk_points
    velocity = lattice.mean(velocities)
    arms = lattice.positions[:n] - lattice.mean(lattice.positions)
    relative = velocities[:n] - velocity
    across = np.stack([-arms[:, 1], arms[:, 0]], axis=1)
    spin = round(float((across * relative).sum() / (across**2).sum()), 12)
    deviation = np.abs(relative - spin * across).max()
    if deviation > _RIGID * np.abs(velocities).max():
        return None, 0.0
    return velocity, spin


# ---- recordings


class Recording:
    """States of a run at chosen times, and what fits pictures to them.

    Scales fit the greatest compression and, for films, moments from the contact to it.

    Attributes:
        run: the recorded run.
        times: (T,) ascending [R/c].
        limits: end of the colour scale of each quantity.
        largest_force: largest force of the wall on one point at the greatest
            compression [M c^2/R].
        full_force: force of an arrow of the length `geometry.ARROW`; 0: no arrows.
        edge: height of the wall's drawn edge [R].
        flattest: flattening of the disk at the greatest compression [R].
    """

    def __init__(
        self, flight: Flight, times: Sequence[float], quantities: Sequence[str]
    ) -> None:
        """`times`: of the pictures; one time makes a still. `quantities`: names of
        `fields.QUANTITIES` that need a scale."""
        self.run = flight.run
        self._flight = flight
        self.times = np.unique(times)
        self._peak = greatest_compression(self.run.series)
        self._scale_states = self._replay()
        scale = [(x, v) for t, x, v in self._scale_states if t <= self._peak]
        self.limits = self._limits(scale, quantities)
        wall = self.run.scenario.model.wall
        lattice = self.run.scenario.lattice
        x, _ = scale[-1]
        assert wall is not None
        _, forces = wall.contact_forces(lattice, x)
        self.largest_force = float(np.hypot(*forces.T).max(initial=0.0))
        full = max(self.largest_force, self.run.largest_force / _MAX_ARROW)
        self.full_force = round_near(full) if full else 0.0
        self.edge = edge_height(wall, self.largest_force)
        self.flattest = flattening(lattice, x)

    @property
    def full_speed(self) -> float:
        """Speed of the longest velocity arrow [c]; 0: no arrow."""
        scenario = self.run.scenario
        if not scenario.is_thrown:
            return 0.0
        return float(np.hypot(*scenario.lattice.mean(scenario.velocities)))

    def _replay(self) -> list[State]:
        """Begin the replay, and return the states that determine the scales."""
        scale_times = self._sampled()
        replay_times = np.union1d(scale_times, self.times)
        count = int((replay_times <= scale_times[-1]).sum())
        # The moments of millions of points do not fit into memory, so such a film is
        # replayed twice.
        self._is_twice = count * self.run.positions.nbytes > MAX_BYTES
        if self._is_twice:
            replay_times = scale_times
            count = len(scale_times)
        replay = self._flight.frames(replay_times)
        first_states = list(islice(replay, count))
        self._rest = zip(replay_times, chain(first_states, replay), strict=True)
        return [
            State(float(t), x, v)
            for t, (_, x, v) in zip(replay_times, first_states, strict=False)
            if t in scale_times
        ]

    def _sampled(self) -> Array:
        first = self.times[0]
        if len(self.times) == 1:
            return np.union1d(first, self._peak)
        start, _ = contact_of(self.run)
        contact = np.linspace(min(start, self._peak), self._peak, _SCALE_TIMES)
        return np.union1d(first, contact)

    def _end_positions(self) -> Array:
        """Return approximate positions at the end of the film: after the end of the
        run, the disk moves on without changing its shape."""
        columns = self.run.series
        beyond = max(self.times[-1] - columns["t"][-1], 0.0)
        velocity = np.array([columns["com_vx"][-1], columns["com_vy"][-1]])
        return self.run.positions + beyond * velocity

    def _limits(
        self, states: Sequence[tuple[Array, Array]], quantities: Sequence[str]
    ) -> dict[str, float]:
        scenario = self.run.scenario
        springs = scenario.model.springs
        n = scenario.lattice.disk_points
        triangles = Triangles(scenario.lattice)
        limits = dict.fromkeys(quantities, 0.0)
        for x, v in states:
            for name in quantities:
                values = at_points(name, triangles, springs, x, v)[:n]
                limits[name] = max(limits[name], full_scale(values, name))
        return limits

    def outer_positions(self, magnify: float) -> list[Array]:
        """Return drawn positions of the disk (n, 2) [R] in the states that reach
        farthest."""
        lattice = self.run.scenario.lattice
        states = [x for _, x, _ in self._scale_states]
        end = self._end_positions()
        if len(self.times) > 1 and end[:, 1].max() < _MAX_HEIGHT:
            states.append(end)
        return [placed(lattice, x, magnify)[: lattice.disk_points] for x in states]

    def view(self, magnify: float) -> View:
        """Return the bounds [R] of the scene and of the disk as it is drawn."""
        scenario = self.run.scenario
        xmin, xmax, ymin, ymax = scenario.view
        # show only the uppermost part of a rigid wall
        if not len(scenario.lattice.wall_surface):
            ymin = self.edge - _WALL_DEPTH
        disk = np.concatenate(self.outer_positions(magnify))
        left, _ = disk.min(axis=0)
        right, top = disk.max(axis=0)
        return (
            float(min(xmin, left - _SIDE_MARGIN)),
            float(max(xmax, right + _SIDE_MARGIN)),
            ymin,
            float(max(ymax, top)),
        )

    def moments(self) -> Iterator[State]:
        """Yield the states at `times`. Call it once, because it uses up the replay."""
        if self._is_twice:
            return self._flight.frames(self.times)
        return (moment for t, moment in self._rest if t in self.times)


# ---- several recordings


@dataclass(frozen=True)
class CommonScales:
    """What the pictures of compared runs have in common.

    Attributes:
        magnify: factor on displacements.
        limits, full_force: the largest of all recordings.
        view: bounds (xmin, xmax, ymin, ymax) [R] of all disks.
    """

    magnify: float
    limits: dict[str, float]
    full_force: float
    view: View

    @classmethod
    def of(cls, states: Sequence[Recording], magnify: float | str) -> CommonScales:
        """Return the scales of recordings; "auto" chooses the factor on
        displacements."""
        factor = magnification(magnify, max(one.flattest for one in states))
        views = [one.view(factor) for one in states]
        left, _, low, _ = np.min(views, axis=0).tolist()
        _, right, _, high = np.max(views, axis=0).tolist()
        names = states[0].limits
        return cls(
            magnify=factor,
            limits={name: max(one.limits[name] for one in states) for name in names},
            full_force=max(one.full_force for one in states),
            view=(left, right, low, high),
        )
