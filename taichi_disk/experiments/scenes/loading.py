"""Quasi-static loading: equilibria of the disk under a load that grows from almost zero
to its full value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taichi_disk.base.progress import Progress
from taichi_disk.experiments.computation.diagnostics import (
    inside_out,
    inverted_triangles,
)
from taichi_disk.experiments.computation.driver import State
from taichi_disk.experiments.computation.outcome import Outcome, summary_of
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics import Load, Model
from taichi_disk.mechanics.simulation.observables import INDEX
from taichi_disk.mechanics.statics.equilibrium import (
    depth,
    roll_angle,
    solve_equilibrium,
    turned,
)


@dataclass
class Equilibria:
    """Equilibria `states` (n, 2) [R] of a lattice under the `fractions` of the load of
    a model, in ascending order."""

    lattice: Lattice
    model: Model
    fractions: Array
    states: list[Array]

    def loaded(self, fraction: float) -> Model:
        assert self.model.load is not None
        return replace(self.model, load=Load(fraction * self.model.load.force))

    def under(self, fraction: float, start: Array) -> Array:
        return solve_equilibrium(
            self.lattice, self.loaded(fraction), start, is_close=True
        ).positions

    def interpolated(self, times: Array) -> Iterator[State]:
        for t in np.clip(times, self.fractions[0], 1.0).tolist():
            k = max(np.searchsorted(self.fractions, t), 1)
            before = self.fractions[k - 1]
            weight = (t - before) / (self.fractions[k] - before)
            x = (1.0 - weight) * self.states[k - 1] + weight * self.states[k]
            yield State(t, x, np.zeros_like(x))

    def solved(self, times: Array) -> Iterator[State]:
        """Yield the equilibria at `times`. Loads between the stored ones are solved
        for, from the interpolated positions."""
        for state in self.interpolated(times):
            is_stored = state.t in self.fractions
            if not is_stored:
                x = self.under(state.t, state.positions)
                state = state._replace(positions=x)
            yield state


def quasistatic(scenario: Any, loads: int, progress: Progress) -> Outcome:
    """Solve for the equilibria of a compression under `loads` growing loads; `t` is the
    fraction of the full load."""
    # The full load is solved first and each lower load from the one above it, so the
    # result does not depend on `loads`.
    lattice = scenario.lattice
    model = scenario.model
    rest = scenario.rest
    # denser at small loads, where the disk settles
    fractions = (np.arange(1, loads + 1) / loads) ** 1.5
    path = Equilibria(lattice, model, fractions, [rest.positions])
    progress("simulate", 0, loads)
    for fraction in fractions[-2::-1]:
        path.states.insert(0, path.under(fraction, path.states[0]))
        progress("simulate", len(path.states), loads)

    columns = {name: np.zeros(loads) for name in (*INDEX, "xi")}
    columns["t"] = fractions
    for k, fraction in enumerate(fractions):
        x = path.states[k]
        # Compare with the unloaded disk in the same orientation, because the disk rolls
        # a little as the load grows.
        unloaded = turned(lattice.positions, roll_angle(lattice.positions, x))
        com_x, com_y = lattice.mean(x)
        row = {
            "com_x": com_x,
            "com_y": com_y,
            "lowest_y": x[:, 1].min(),
            "xi": depth(lattice, unloaded) - depth(lattice, x),
            "wall_force": model.wall.forces(lattice, x)[:, 1].sum(),
            "residual": np.hypot(*path.loaded(fraction).forces(lattice, x).T).max(),
            "elastic": model.springs.energy(lattice, x),
            "inverted": inverted_triangles(lattice, x),
            "wall": model.wall.energy(lattice, x),
        }
        for name, value in row.items():
            columns[name][k] = value
    columns["load"] = fractions * model.load.force * columns["com_y"]
    columns["total"] = columns["elastic"] + columns["wall"] + columns["load"]
    warnings = [text for text in [inside_out(columns)] if text]
    summary = summary_of(scenario, columns, warnings) | {
        "steps": rest.iterations,
        "integrator": "newton",
        "error_estimate": {},
        "residual": rest.residual,
        "roll": rest.roll,
    }
    _, forces = model.wall.contact_forces(lattice, rest.positions)
    return Outcome(
        scenario=scenario,
        series=columns,
        positions=rest.positions,
        velocities=np.zeros_like(rest.positions),
        largest_force=float(np.hypot(*forces.T).max(initial=0.0)),
        replay=path.solved,
        frames=path.interpolated,
        summary=summary,
    )
