"""Random scenes whose truth is known: does the error estimate that every run reports hold, is `time.tolerance` kept?

    python -m tests.validation.estimate_trial [--tolerance | --hard | ] [--first 0] [--scenes 100]

Scenes are drawn by number (`trial_scene`, `hard_scene`), truths are those of `truth`. A scene
whose truth is in doubt by more than a tenth of what is claimed cannot be judged.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from taichi_disk import runtime
from taichi_disk.computation.outcome import compute
from taichi_disk.errors import SimulationError
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache

from .random_scenes import hard_scene, trial_scene
from .truth import true_result

FINEST = 1e-8  # error of an estimate that a truth is made for


@dataclass(frozen=True)
class Judgement:
    """What became of scene `number`. Numbers are of e or of xi [R].

    `end`: held or exceeded; warned: exceeded, and the run warns; untold: no truth to judge by; ended: the scene has no
    result, or none within the tolerance.
    `claim`: the estimate or the tolerance.
    """

    number: int
    end: str
    text: str
    error: float = math.nan
    claim: float = math.nan
    doubt: float = 0.0


def judge(number: int, kernels: KernelCache, tolerance: bool = False, hard: bool = False) -> Judgement:
    """Run scene `number` as `run` does, and hold its estimate, or its tolerance, against the truth."""
    strain = wanted = 0.0
    if hard:
        name, settings, strain = hard_scene(number)
    else:
        name, settings, wanted = trial_scene(number)
    if tolerance:
        settings = (*settings, f"time.tolerance={wanted}")
    scene, text = load_scene(name, settings), " ".join((name, *settings, f"strain={strain}" * (strain > 0.0)))
    body = scene.body()
    if strain:
        off = np.random.default_rng(number).uniform(-strain, strain, len(body.rest_lengths))
        body = replace(body, rest_lengths=body.rest_lengths * (1.0 + off))
    scenario = scene.scenario(body)
    try:
        outcome = compute(scenario, scene.time, kernels=kernels)
        key, found = scenario.primary(outcome.columns)
        claim, dt = wanted if tolerance else outcome.facts["error_estimate"].get(key), outcome.facts["dt"]
        if claim is None:
            return Judgement(number, "ended", f"{text}: no estimate")
        truth, doubt = true_result(scenario, outcome.columns, outcome.positions, dt, max(claim, FINEST))
    except SimulationError as error:
        return Judgement(number, "ended", f"{text}: {error}")
    off = abs(found - truth)
    end = "untold" if doubt > 0.1 * claim else "held" if off <= claim else "exceeded"
    if end == "exceeded" and outcome.facts["warnings"]:
        end = "warned"
    return Judgement(number, end, text, off, claim, doubt)


def report(found: list[Judgement]) -> Iterator[str]:
    """The figures in Markdown, then every scene whose claim did not hold."""
    from scipy.stats import binomtest

    judged = [one for one in found if one.end in ("held", "exceeded")]
    held = sum(one.end == "held" for one in judged)
    low, high = binomtest(held, len(judged)).proportion_ci()
    yield (
        f"{len(found)} scenes, {len(judged)} judged: the claim holds in {held} ({held / len(judged):.1%}; "
        f"95 % interval {low:.1%} to {high:.1%}, Clopper and Pearson)."
    )
    ratios = np.array([one.claim / max(one.error, 1e-15) for one in judged])
    middle, most = np.quantile(ratios, [0.5, 0.95])
    yield f"* claim over true error: median {middle:.2f}, 95 % of scenes below {most:.1f}, least {ratios.min():.2f}"
    for one in sorted(found, key=lambda one: one.end):
        if one.end != "held":
            numbers = f"error {one.error:.2g}, claim {one.claim:.2g}, doubt {one.doubt:.1g}"
            yield f"* {one.end}: {one.number}: {numbers}: {one.text}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tolerance", action="store_true", help="judge time.tolerance instead of the estimate")
    parser.add_argument("--hard", action="store_true", help="spins, strained springs, strong dashpots, both contacts")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--scenes", type=int, default=100, help="how many")
    given = parser.parse_args()
    runtime.start(threads=1)
    kernels = KernelCache()
    numbers = range(given.first, given.first + given.scenes)
    for line in report([judge(number, kernels, given.tolerance, given.hard) for number in numbers]):
        print(line)


if __name__ == "__main__":
    main()
