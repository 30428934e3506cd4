"""States of runs at the times of their pictures, and the scales that fit them, from one
replay."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import Any

import numpy as np

from taichi_disk.experiments.computation.driver import State
from taichi_disk.experiments.computation.words import Numbers
from taichi_disk.mechanics.fields import Triangles, at_points
from taichi_disk.mechanics.lattice import Array
from taichi_disk.mechanics.statics.equilibrium import turned
from taichi_disk.pictures.render.geometry import (
    View,
    edge_height,
    flattening,
    magnification,
    placed,
)
from taichi_disk.pictures.render.moments import Run, film_end
from taichi_disk.pictures.render.palette import full_scale, round_near

# number of times, from the contact to the greatest compression, that determine the
# colour scale of a film
SCALE_TIMES = 12
# longest arrow over the arrow of `full_force`, so that arrows stay in the picture
MAX_ARROW = 4.0
# smallest distance of the disk to the left and right edge of the picture [R]
_SIDE_MARGIN = 0.05
# greatest visible height of a disk that flies on until all compared runs have ended [R]
_MAX_HEIGHT = 4.0
_LARGER = 1.2  # amplitude of a vibration over that at the end of a run, about
_WALL_DEPTH = 0.16  # visible part of the rigid wall below its edge [R]


@dataclass(frozen=True)
class Flight:
    """The states of a run, and the flights before t = 0 and after its end.

    Attributes:
        start, end: first and last time of a film of the whole run [R/c].
    """

    run: Run
    start: float
    end: float

    @classmethod
    def of(cls, run: Run, height: float) -> Flight:
        """Return the flight that begins and ends with the disk at `height` [R] above
        the wall's edge, or higher if the run begins there.

        With velocities of the user's own, or with dashpots that would slow a spin,
        there is no flight.
        """
        scenario = run.scenario
        columns = run.series
        last = film_end(run)
        if height == 0.0 or not _flies(run):
            return cls(run, float(columns["t"][0]), last)
        edge = edge_height(scenario.model.wall, run.largest_force)
        first = columns["lowest_y"][0]
        top = max(edge + height, first)
        _, velocity = scenario.lattice.mean(scenario.velocities)
        start = (top - first) / velocity
        beyond = max(top - columns["lowest_y"][-1], 0.0) / columns["com_vy"][-1]
        return cls(run, float(start), float(last + beyond))

    def frames(self, times: Array) -> Iterator[State]:
        """Yield the states at ascending `times` [R/c]."""
        yield from map(self._before, times[times < 0.0])
        if times[-1] >= 0.0:
            yield from self.run.frames(times[times >= 0.0])

    def _before(self, t: float) -> State:
        scenario = self.run.scenario
        lattice = scenario.lattice
        n = lattice.disk_points
        angle = scenario.scene.impact.spin * t
        centre = lattice.mean(lattice.positions)
        velocity = lattice.mean(scenario.velocities)
        x = lattice.positions.copy()
        x[:n] = centre + velocity * t + turned(x[:n] - centre, angle)
        v = scenario.velocities.copy()
        v[:n] = velocity + turned(v[:n] - velocity, angle)
        return State(t, x, v)


def _flies(run: Run) -> bool:
    """Return whether the disk moves like a rigid body before t = 0."""
    scenario = run.scenario
    if not scenario.is_thrown or scenario.falls_back:
        return False
    if scenario.own.velocities is not None:
        return False
    springs = scenario.model.springs
    return not scenario.scene.impact.spin or not springs.damped or springs.axial


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
        full_speed: speed of the longest velocity arrow [c]; 0: no arrow.
        edge: height of the wall's drawn edge [R].
        flattest: flattening of the disk at the greatest compression [R].
    """

    def __init__(
        self,
        flight: Flight,
        times: Sequence[float],
        quantities: Sequence[str],
        ringing: float = 1.0,
    ) -> None:
        """`times`: of the pictures; one time makes a still. `quantities`: names of
        `fields.QUANTITIES` that need a scale. `ringing`: how many times stronger the
        last pictures show a vibration."""
        run = flight.run
        scenario = run.scenario
        lattice = scenario.lattice
        wall: Any = scenario.model.wall  # every scene has one
        self.run = run
        self.times = np.unique(times)
        peak = run.contact.greatest
        start = min(run.contact.start, peak)
        count = SCALE_TIMES if len(self.times) > 1 else 1
        scale_times = np.union1d(self.times[0], np.linspace(peak, start, count))
        all_times = np.unique([start, *scale_times, *self.times])
        replay = zip(all_times, flight.frames(all_times), strict=True)
        early = dict(islice(replay, int((all_times <= scale_times[-1]).sum())))
        self._replay = chain(early.items(), replay)
        compressed = early[peak].positions
        until_peak = [early[t] for t in scale_times if t <= peak]
        self.limits = self._limits(until_peak, quantities)
        _, forces = wall.contact_forces(lattice, compressed)
        self.largest_force = float(np.hypot(*forces.T).max(initial=0.0))
        full = max(self.largest_force, run.largest_force / MAX_ARROW)
        self.full_force = round_near(full) if full else 0.0
        self.full_speed = 0.0
        if scenario.is_thrown:
            self.full_speed = float(np.hypot(*lattice.mean(scenario.velocities)))
        self.edge = edge_height(wall, self.largest_force)
        self.flattest = flattening(lattice, compressed, early[start].positions)
        # states that reach farthest, and the factors on their vibration
        self._outer = [(early[t].positions, 1.0) for t in scale_times]
        end = self._end_positions()
        if len(self.times) > 1 and end[:, 1].max() < _MAX_HEIGHT:
            factors = [1.0]
            if ringing > 1.0:
                factors = [_LARGER * ringing, -_LARGER * ringing]  # half a period later
            self._outer += [(end, factor) for factor in factors]

    def _end_positions(self) -> Array:
        """Return approximate positions at the end of the film: after the end of the
        run, the disk moves on without changing its shape."""
        columns = self.run.series
        beyond = max(self.times[-1] - self.run.end, 0.0)
        velocity = np.array([columns["com_vx"][-1], columns["com_vy"][-1]])
        return self.run.positions + beyond * velocity

    def _limits(self, states: Sequence[State], quantities: Sequence[str]) -> Numbers:
        scenario = self.run.scenario
        n = scenario.lattice.disk_points
        triangles = Triangles(scenario.lattice)
        limits = {}
        for name in quantities:
            values = [
                at_points(name, triangles, scenario.model.springs, x, v)
                for _, x, v in states
            ]
            limits[name] = max(full_scale(one[:n], name) for one in values)
        return limits

    def outer_positions(self, magnify: float) -> list[Array]:
        """Return drawn positions of the disk (n, 2) [R] in the states that reach
        farthest."""
        lattice = self.run.scenario.lattice
        return [
            placed(lattice, x, magnify, self.edge, ringing)[: lattice.disk_points]
            for x, ringing in self._outer
        ]

    def view(self, magnify: float) -> View:
        """Return the bounds [R] of the scene and of the disk as it is drawn."""
        scenario = self.run.scenario
        xmin, xmax, ymin, ymax = scenario.view
        # show only the uppermost part of a rigid wall
        if not len(scenario.lattice.wall_surface):
            ymin = self.edge - _WALL_DEPTH
        disk = np.concatenate(self.outer_positions(magnify))
        left, _ = disk.min(axis=0) - _SIDE_MARGIN
        right, top = disk.max(axis=0) + [_SIDE_MARGIN, 0.0]
        return min(xmin, left), max(xmax, right), ymin, max(ymax, top)

    def states(self) -> Iterator[State]:
        """Yield the states at `times`. Call it once, because it uses up the replay."""
        return (state for t, state in self._replay if t in self.times)


@dataclass(frozen=True)
class Scales:
    """What the pictures of compared runs have in common.

    Attributes:
        magnify: factor on displacements.
        limits, full_force: the largest of all recordings.
        view: bounds (xmin, xmax, ymin, ymax) [R] of all disks.
    """

    magnify: float
    limits: Numbers
    full_force: float
    view: View

    @classmethod
    def of(cls, recordings: Sequence[Recording], magnify: float | str) -> Scales:
        """Return the scales of recordings; "auto" chooses the factor on
        displacements."""
        factor = magnification(magnify, max(one.flattest for one in recordings))
        views = np.array([one.view(factor) for one in recordings])
        left, _, low, _ = views.min(axis=0).tolist()
        _, right, _, high = views.max(axis=0).tolist()
        limits = {}
        for name in recordings[0].limits:
            limits[name] = max(one.limits[name] for one in recordings)
        return cls(
            magnify=factor,
            limits=limits,
            full_force=max(one.full_force for one in recordings),
            view=(left, right, low, high),
        )
