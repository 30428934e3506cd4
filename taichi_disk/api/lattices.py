"""Mean and scatter of results over random lattices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from taichi_disk.computation.outcome import Outcome
from taichi_disk.errors import TaichiDiskError
from taichi_disk.integrators import INTEGRATORS
from taichi_disk.lattice import OwnStart
from taichi_disk.progress import Progress
from taichi_disk.scenes import Scene
from taichi_disk.scenes.setup import outcome_of

MOST_LATTICES = 10_000
LATTICES, MIN_LATTICES = 8, 3  # default number; fewer than 3 have no meaningful scatter
# most spring evaluations for the default number of lattices, some 1 s on one core
EVALUATIONS = 3e8
# building a lattice and its spectrum takes as long as this many evaluations of each
# spring
BUILDING = 1500
# Newton's method takes as long as this many evaluations of each spring
EQUILIBRIUM = 3000


def lattice_count(
    own: OwnStart, outcome: Outcome, asked: int | None
) -> tuple[int, list[str]]:
    """Return the number of lattices to compute, and notes about it for the user.

    `own`: user-supplied lattice; `outcome`: the computed scene; `asked`: number of
        lattices that the user wants.
    """
    if own.digest:
        text = (
            "a lattice or velocities of your own have no seed: how far the result"
            " depends on the points is not known"
        )
        return 1, [] if asked == 1 else [text]
    if asked is not None:
        return asked, []
    count = affordable(outcome)
    if count == LATTICES:
        return count, []
    found = (
        f"only {count} lattices were computed"
        if count > 1
        else "no other lattices were computed"
    )
    return count, [
        f"{found}, because more take long; lattices={LATTICES} shows how much the"
        " result depends on them"
    ]


def affordable(outcome: Outcome) -> int:
    summary, lattice = outcome.summary, outcome.scenario.lattice
    if outcome.scenario.static:
        evaluations = EQUILIBRIUM
    else:
        step_cost = INTEGRATORS[summary["integrator"]].cost(len(lattice.positions))
        evaluations = summary["steps"] * summary["attempts"] * step_cost
    count = 1 + int(EVALUATIONS / (len(lattice.bonds) * (evaluations + BUILDING)))
    return min(count, LATTICES) if count >= MIN_LATTICES else 1


def compare_lattices(
    scene: Scene, outcome: Outcome, count: int, progress: Progress, force: bool
) -> dict[str, Any]:
    """Compute the results on `count` lattices with consecutive seeds, from the scene's
    on, for summary.json.

    Returns `seeds` and, for each result, its `values`, `mean` and `standard_deviation`.
    Seeds without a result are left out and named in the warnings of the outcome's
    summary.
    """
    seeds, found = [scene.lattice.seed], [outcome.scenario.result(outcome.columns)]
    for number in range(1, count):
        progress("lattices", number - 1, count - 1)
        seed = (scene.lattice.seed + number) % 2**32
        try:
            other = outcome_of(
                replace(scene, lattice=replace(scene.lattice, seed=seed)),
                force=force,
                estimate=False,
            )
            found.append(other.scenario.result(other.columns))
            seeds.append(seed)
        except TaichiDiskError as error:
            outcome.summary["warnings"].append(
                f"there is no result on the lattice of seed {seed}: {error}"
            )
    comparison: dict[str, Any] = {"seeds": seeds}
    for name in found[0]:
        values = [one[name] for one in found if name in one]
        if 1 < len(values) == len(found):
            deviation = float(np.std(values, ddof=1))
            comparison[name] = {
                "values": values,
                "mean": float(np.mean(values)),
                "standard_deviation": deviation,
            }
    return comparison
