"""What is told of a state that has become meaningless."""

from __future__ import annotations

import numpy as np

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import Model
from taichi_disk.simulation.scenario import Scenario


class BlowUp(SimulationError):
    """The state became meaningless.

    Attributes:
        last_good: positions and velocities (n, 2) and the time of the last row that was still good.
    """

    def __init__(self, message: str, last_good: dict[str, Array]) -> None:
        super().__init__(message)
        self.last_good = last_good


def gone_through(lattice: Lattice, model: Model, x: Array, energy: float) -> bool:
    """Whether a point of the disk is in the elastic wall, deeper than the `energy` [M c^2] that there is lets it.

    The contact force, looking for the spring below a point, cannot know.
    """
    wall = model.elastic
    if wall is None:
        return False
    disk, surface = x[: lattice.disk_points], x[lattice.wall_surface]
    px, py = disk[disk[:, 1] < surface[:, 1].max()].T[:, :, None]
    deep = 2.0 * np.log(max(energy / wall.V0, 1.0)) / wall.a  # twice as far as the potential V0 exp(-a l) lets it
    a = np.concatenate([x[lattice.wall_boundary], surface[-2:0:-1] - [0.0, deep]])  # the wall's outline
    b = np.roll(a, -1, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = a[:, 1] + (px - a[:, 0]) / (b[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    crossed = ((a[:, 0] <= px) != (b[:, 0] <= px)) & (height > py)  # by a ray upwards
    return bool((crossed.sum(axis=1) % 2).any())  # from within an odd number of times


def explained(scenario: Scenario, dt: float, part: float, x: Array, lost: str) -> str:
    """What was `lost` after the last good row, and what mends it.

    Args:
        dt: the step [R/c], and `part`, what it is of the stability limit.
        x: (n, 2) the points at that row.
    """
    lattice, model = scenario.lattice, scenario.model
    strain = model.springs.strain(lattice, x)
    worst = int(np.abs(strain).argmax())
    i, j = lattice.bonds[worst]
    auto = "" if scenario.scene.time.dt == "auto" else "set time.dt: auto; if that fails too, "
    if auto and part > 1.0:
        cause = "the step is beyond the stability limit: set time.dt: auto"
    elif model.elastic:
        cause = (
            "the disk may have dented the wall, gone through it or slipped off its end: "
            f"{auto}lower impact.velocity, raise material.k_a, or write a larger wall.width"
        )
    else:
        cause = (
            "the body may be crushed, or pushed harder than the step was chosen for: "
            f"{auto}lower impact.velocity or compression.pressure, raise material.k_a, or try a smaller time.safety"
        )
    return (
        f"{lost}; before that spring {worst} between points {i} and {j} was strained most, by {strain[worst]:+.2g}; "
        f"the step {dt:.4g} R/c is {part:.3g} of the stability limit that the wall's force leaves; {cause}"
    )
