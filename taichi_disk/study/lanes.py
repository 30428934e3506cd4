"""Several scenes of one lattice stepped side by side, one to a lane; each lane ends by itself.

What a lane computes does not depend on its neighbours: the same operations in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np

from taichi_disk.errors import SimulationError
from taichi_disk.model import runtime
from taichi_disk.model.runtime import Precision
from taichi_disk.model.sums import PEAK
from taichi_disk.model.world import World
from taichi_disk.progress import QuietProgress
from taichi_disk.scenes.setup import Columns, Setup
from taichi_disk.simulate import SPRINGS_PER_LAUNCH, as_columns, blown_up, simulate
from taichi_disk.time_step import TimeStep

# A cache line of numbers. Fewer cost more per lane (four in f64 1.7 times); more gain nothing and compile far longer.
LANES: dict[Precision, int] = {"f64": 8, "f32": 16}
WORLDS = 20  # made before Taichi is started afresh: it never gives fields back for good


@dataclass(frozen=True)
class Ending:
    """How one lane ended: time series, steps made, largest force on one point; or, without the first, why it failed."""

    columns: Columns
    steps: int
    peak_point_force: float
    failure: SimulationError | None = None


class LaneEngine:
    """Steps groups of lanes in one process, on one core, keeping compiled worlds for the next group."""

    def __init__(self, precision: Precision) -> None:
        self.precision, self.lanes = precision, LANES[precision]
        runtime.start("cpu", 1, precision)
        self._worlds: list[World] = []

    def run(self, setups: list[Setup], step: TimeStep, interval: float) -> Iterator[tuple[int, Ending]]:
        """Step up to `self.lanes` `setups` of one lattice by `step`, sampled about every `interval` [R/c].

        Yields (index in `setups`, its ending) as the lanes end. Where a lane blows up, what has not ended is done
        again one by one, as a single run would: a number that is not finite could reach other lanes through a decision
        they share.
        """
        done: set[int] = set()
        for index, ending in self._group(setups, step, interval):
            done.add(index)
            yield index, ending
        for index in range(len(setups)):
            if index not in done:
                yield index, self._alone(setups[index], step, interval)

    def _group(self, setups: list[Setup], step: TimeStep, interval: float) -> Iterator[tuple[int, Ending]]:
        """The endings of all lanes, but only those before a blow-up."""
        world = self._world(setups, step)
        stride = max(1, round(interval / step.dt))
        bonds = len(setups[0].lattice.bonds)
        samples = max(1, SPRINGS_PER_LAUNCH // (bonds * self.lanes * stride))
        rows = world.first_row[None]
        running, looked = set(range(len(setups))), 0
        while running:
            known = len(rows)
            rows = np.concatenate([rows, world.advance(samples, stride)])
            state, x = world.export_state(), None
            if (world.step_number - looked) * bonds >= SPRINGS_PER_LAUNCH:  # as often as a single run looks
                x, looked = world.places(state), world.step_number
            columns = {lane: as_columns(rows[:, :, lane], step.dt, stride) for lane in running}
            for lane in running:
                if blown_up(world.lattice, world.physics, columns[lane], known, None if x is None else x[lane]):
                    return
            for lane in sorted(running):
                ending = _ending(setups[lane], columns[lane], known, stride, float(state.sums[PEAK, lane]))
                if ending is not None:
                    running.discard(lane)
                    yield lane, ending

    def _alone(self, setup: Setup, step: TimeStep, interval: float) -> Ending:
        world = self._world([setup], step)
        try:
            result = simulate(setup, world, step, interval, QuietProgress())
        except SimulationError as failure:
            return Ending({}, world.step_number, float(world.export_state().sums[PEAK, 0]), failure)
        return Ending(result.columns, result.end.step, result.peak_point_force)

    def _world(self, setups: list[Setup], step: TimeStep) -> World:
        # Lanes without a scene of their own repeat the last one.
        lanes = [setups[min(k, len(setups) - 1)] for k in range(self.lanes)]
        physics = replace(lanes[0].physics, integrator=step.integrator)
        velocities = np.array([setup.velocities for setup in lanes])
        own: dict[str, Any] = {
            "eta": [setup.physics.eta for setup in lanes],
            "load": [setup.physics.load for setup in lanes],
            "positions": np.array([setup.lattice.positions for setup in lanes]),
        }
        lattice = lanes[0].lattice
        for world in self._worlds:
            if world.restart(lattice, physics, velocities, step.dt, **own):
                return world
        if len(self._worlds) >= WORLDS:
            self._worlds.clear()
            runtime.start("cpu", 1, self.precision)
        self._worlds.append(World(lattice, physics, velocities, step.dt, **own))
        return self._worlds[-1]


def _ending(setup: Setup, columns: Columns, known: int, stride: int, peak: float) -> Ending | None:
    """The ending of a lane that has come to `columns`, `known` rows of them old; None if it goes on."""
    spacing = columns["t"][1] - columns["t"][0]
    most = ceil(setup.max_time / spacing) + 1  # rows, as in a single run
    over = np.flatnonzero(setup.ended(columns)[known:most])
    if not len(over) and len(columns["t"]) < most:
        return None
    count = known + int(over[0]) + 1 if len(over) else most
    columns = {name: values[:count] for name, values in columns.items()}
    if not len(over):
        return Ending({}, (count - 1) * stride, peak, SimulationError(setup.unfinished(columns)))
    return Ending(columns, (count - 1) * stride, peak)
