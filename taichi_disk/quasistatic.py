"""Compression without time: the equilibrium that Newton's method has found, as a run that ends there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.outcome import Outcome, Snapshots
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.setup import Columns
from taichi_disk.stiffness import spring_energy

ROWS = 101


def press(setup: Compression) -> Outcome:
    """The rest under the full load, and the straight way to it.

    Nothing moves in time here: `t` runs from 0, the undeformed start, to 1, the equilibrium, along the straight
    line between the two, on which the total energy falls to its minimum.
    """
    physics, lattice, rest = setup.physics, setup.lattice, setup.rest
    way = rest.positions - lattice.positions
    t = np.linspace(0.0, 1.0, ROWS)

    def snapshots(times: NDArray[np.float64]) -> Snapshots:
        for time in times:
            yield float(time), lattice.positions + time * way, np.zeros_like(way)

    columns: Columns = {name: np.zeros(ROWS) for name in ("com_vx", "com_vy", "angular_momentum", "kinetic")}
    columns |= {name: np.zeros(ROWS) for name in ("dissipated", "absorbed", "sliding")}
    x = np.array([positions for _, positions, _ in snapshots(t)])
    potential = physics.V0 * np.exp(-physics.a * x[:, :, 1])
    springs = (lattice.bonds, lattice.rest_lengths, physics.k_a, physics.k_b)
    columns |= {
        "t": t,
        "com_x": x[:, :, 0].mean(1),
        "com_y": x[:, :, 1].mean(1),
        "lowest_y": x[:, :, 1].min(1),
        "wall_force": physics.a * potential.sum(1),
        "elastic": np.array([spring_energy(positions, *springs) for positions in x]),
        "wall": potential.sum(1),
        "load": physics.load * x[:, :, 1].mean(1),
    }
    columns["total"] = columns["elastic"] + columns["wall"] + columns["load"]
    facts = {
        "warnings": [],
        "steps": rest.iterations,
        "integrator": "newton",
        "residual": rest.residual,
        "roll": rest.roll,
    }
    return Outcome(columns, rest.positions, np.zeros_like(x[-1]), snapshots, facts)
