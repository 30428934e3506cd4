"""Mean and scatter of results over random lattices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from taichi_disk.base.errors import InputError, by_kind, described
from taichi_disk.base.files import Summary
from taichi_disk.base.progress import Progress
from taichi_disk.experiments.computation.error_estimate import measured
from taichi_disk.experiments.computation.outcome import ESTIMATE_UP_TO, Outcome
from taichi_disk.experiments.scenes import Scene
from taichi_disk.experiments.scenes.setup import outcome_of
from taichi_disk.mechanics.integrators import INTEGRATORS
from taichi_disk.mechanics.lattice import file_digest

MOST_LATTICES = 10_000
# The default number of lattices, and the one for a relaxation or a tolerance, which
# take several times as long.
LATTICES = 8
FEW_LATTICES = 3
# Distance from the median, in interquartile ranges, from which a lattice lies far off.
# Of eight normal values one does so in 1 % of samples, and of five in 7 %.
FAR_OFF = 5.0
MAX_POINTS = 5_000  # of disk and wall; a larger scene is computed on one lattice


def lattice_count(outcome: Outcome, asked: int | None) -> tuple[int, list[str]]:
    """Return the number of lattices to compute, and notes about it for the user.

    `outcome`: the computed scene; `asked`: number of lattices that the user wants.
    """
    if asked == 1:
        return 1, []
    if outcome.scenario.own.digest:
        text = (
            "a lattice or velocities of your own have no seed: how far the result"
            " depends on the points is not known"
        )
        return 1, [text]
    if asked is not None:
        return asked, []
    count, reason = default_count(outcome)
    if count == LATTICES:
        return count, []
    found = "no other lattices were computed"
    if count > 1:
        found = f"only {count} lattices were computed"
    note = (
        f"{found}, because {reason}; lattices={LATTICES} shows how much the result"
        " depends on the points"
    )
    return count, [note]


def default_count(outcome: Outcome) -> tuple[int, str]:
    """Return the default number of lattices: 8 up to 5,000 points, 3 for a relaxation
    or with a tolerance, else 1; and why there are fewer than 8."""
    scenario = outcome.scenario
    lattice = scenario.lattice
    if len(lattice.positions) > MAX_POINTS:
        return 1, f"disk and wall have more than {MAX_POINTS:,} points"
    if scenario.static:
        return LATTICES, ""
    step_forces = INTEGRATORS[outcome.summary["integrator"]].forces
    if outcome.summary["steps"] * step_forces * len(lattice.bonds) > ESTIMATE_UP_TO:
        return 1, "one run takes more than about 5 s"
    if not scenario.step_dependent:
        return FEW_LATTICES, "a relaxation takes many steps"
    if scenario.scene.time.tolerance != "none":
        return FEW_LATTICES, "a tolerance takes several runs"
    return LATTICES, ""


def compare_lattices(
    outcome: Outcome, count: int, progress: Progress, force: bool, outline: str
) -> Summary:
    """Compute the results on `count` lattices, and return their statistics for
    summary.json. The seeds are consecutive and begin with the scene's.

    `outline`: digest of the outline's file, from which all have to be made.
    Returns `seeds` and, for each result and `vibration_left`, `statistics_of` its
    values. Seeds without a result are left out. The warnings of the outcome's summary
    name them, and contain the warnings of other lattices.
    """
    scene: Scene = outcome.scenario.scene
    seeds = [scene.lattice.seed]
    results = [measured(outcome.scenario, outcome.series)]
    warnings: list[str] = []
    progress("lattices", 0, count - 1)
    for number in range(1, count):
        seed = (scene.lattice.seed + number) % 2**32
        sample = replace(scene, lattice=replace(scene.lattice, seed=seed))
        try:
            other = outcome_of(sample, force=force, estimate=False)
            if file_digest(sample.lattice, "outline") != outline:
                raise InputError("the file of the outline was changed during the run")
            results.append(measured(other.scenario, other.series))
            seeds.append(seed)
            warnings += other.summary["warnings"]
        # The scene's own result is complete, whatever happens to another lattice.
        except Exception as error:
            outcome.summary["warnings"].append(
                f"there is no result on the lattice of seed {seed}: {described(error)}"
            )
        progress("lattices", number, count - 1)
    for text, warned in by_kind(warnings):
        outcome.summary["warnings"].append(
            f"{warned} of {count - 1} other lattices, one of them: {text}"
        )
    comparison: Summary = {"seeds": seeds}
    if len(results) == 1:
        return comparison
    for name in results[0]:
        values = [numbers[name] for numbers in results if name in numbers]
        if len(values) < len(results):
            continue  # some lattice has no such result
        comparison[name] = statistics_of(values)
        low, median, high = np.percentile(values, [25.0, 50.0, 75.0])
        distances = np.abs(np.array(values) - median)
        if len(values) >= LATTICES and distances.max() > FAR_OFF * (high - low):
            outcome.summary["warnings"].append(
                f"{name}: the lattice of seed {seeds[distances.argmax()]} lies far"
                f" off: the interval is no summary, the median is {median:.4g}"
            )
    return comparison


def statistics_of(values: list[float]) -> Summary:
    """Return `values` with their mean, their standard deviation, the standard error of
    the mean and its `interval_95`, each in the unit of the values."""
    mean = float(np.mean(values))
    deviation = float(np.std(values, ddof=1))
    error = deviation / len(values) ** 0.5
    half_width = float(half_width_95(error, len(values)))
    return {
        "values": values,
        "mean": mean,
        "standard_deviation": deviation,
        "standard_error": error,
        "interval_95": [mean - half_width, mean + half_width],
    }


def half_width_95(standard_error: Any, count: Any) -> Any:
    """Return half of the width of the 95 % confidence interval of a mean of `count`
    values by Student's t, which allows for a scatter that few values show badly; NaN
    for one value. The arguments are numbers, or arrays of many means."""
    from scipy.special import stdtrit

    return stdtrit(count - 1, 0.975) * standard_error
