"""Check on random scenes with known results whether error estimates hold and tolerances
are kept.

    python -m tests.validation.estimate_trial [--tolerance]
    [--hard | --scene features|resets|chaotic] [--first 0] [--scenes 100]

Scenes are drawn by number (`random_scenes`); `truth` computes the true results. A scene
whose true result is uncertain by more than a tenth of the claimed error cannot be
judged. But if a chaotic impact's result still changes by more than the claim when the
step is 32 or 128 times shorter, the claim has failed. With `--scene` every result is
judged, and `--log FILE` stores the judgements, so that the same command can go on from
there.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk import runtime
from taichi_disk.computation.error_estimate import measured
from taichi_disk.computation.outcome import compute
from taichi_disk.computation.scenario import Scenario
from taichi_disk.errors import SimulationError, TaichiDiskError
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache

from .random_scenes import (
    chaotic_scene,
    custom_body,
    feature_scene,
    hard_scene,
    reset_scene,
    trial_scene,
)
from .truth import refined, true_result

FINEST = 1e-8  # smallest claimed error that is judged
# rounding error of a result, such as the tangential impulse without friction
ROUNDING = 1e-13
SCENES = {
    "features": feature_scene,
    "resets": reset_scene,
    "chaotic": chaotic_scene,
}
MOST_WORK = 3e9  # most spring evaluations for a true result; longer scenes are left out


@dataclass(frozen=True)
class Judgement:
    """The judgement of scene `number`. Numbers refer to e or to xi [R].

    `end`: held or exceeded; warned: exceeded, and the run warns; untold: the true
    result is unknown; ended: the scene has no result, or none within the tolerance.
    `claim`: the estimate or the tolerance. `result`: name of the result, if it is not
    the primary one.
    """

    number: int
    end: str
    text: str
    error: float = math.nan
    claim: float = math.nan
    doubt: float = 0.0
    result: str = ""


def judge(number: int, tolerance: bool = False, hard: bool = False) -> Judgement:
    """Run scene `number` as `run` does, and compare its estimate, or its tolerance,
    with the true error."""
    strain = 0.0
    wanted = 0.0
    if hard:
        name, settings, strain = hard_scene(number)
    else:
        name, settings, wanted = trial_scene(number)
    if tolerance:
        settings = (*settings, f"time.tolerance={wanted}")
    text = " ".join((name, *settings))
    scene = load_scene(name, settings)
    body = scene.body()
    if strain:
        text += f" strain={strain}"
        rng = np.random.default_rng(number)
        strains = rng.uniform(-strain, strain, len(body.rest_lengths))
        body = replace(body, rest_lengths=body.rest_lengths * (1.0 + strains))
    scenario = scene.scenario(body)
    try:
        outcome = compute(scenario)
        key, found = scenario.primary(outcome.series)
        claim = outcome.summary["error_estimate"].get(key)
        if tolerance:
            claim = wanted
        if claim is None:
            return Judgement(number, "ended", f"{text}: no estimate")
        truth, doubt = true_result(
            scenario,
            outcome.series,
            outcome.positions,
            outcome.summary["dt"],
            max(claim, FINEST),
        )
    except SimulationError as error:
        return Judgement(number, "ended", f"{text}: {error}")
    error = abs(found - truth)
    end = verdict(error, claim, doubt)
    if end == "exceeded" and outcome.summary["warnings"]:
        end = "warned"
    return Judgement(number, end, text, error, claim, doubt)


def verdict(error: float, claim: float, doubt: float) -> str:
    """Return the end of a judgement; `doubt`: the uncertainty of the true result."""
    if doubt > 0.1 * claim:
        return "untold"
    if error <= claim:
        return "held"
    return "exceeded"


def feature_tolerance(number: int) -> float:
    """Return the tolerance of feature scene `number`, from 1e-6 to 1e-3."""
    return float(10.0 ** np.random.default_rng([number, 9]).uniform(-6.0, -3.0))


def judge_features(
    number: int, kernels: KernelCache, tolerance: bool = False, kind: str = "features"
) -> list[Judgement]:
    """Run scene `number` of `kind` as `run` does, and compare the estimate of each
    result with runs at shorter steps. With `tolerance`, a tolerance is the claim about
    the primary result."""
    name, settings, aspect = SCENES[kind](number)
    wanted = feature_tolerance(number)
    if tolerance:
        settings = (*settings, f"time.tolerance={wanted!r}")
    text = " ".join((name, *settings))
    if aspect > 0.0:
        text += f" aspect={aspect:.3f}"
    try:
        scene = load_scene(name, settings)
        body = scene.body()
        if aspect > 0.0:
            body = custom_body(body, aspect, number)
        scenario = scene.scenario(body)
        outcome = compute(scenario)
        claims = dict(outcome.summary["error_estimate"])
        if not claims:
            return [Judgement(number, "ended", f"{text}: no estimate")]
        primary, _ = scenario.primary(outcome.series)
        if tolerance:
            claims[primary] = wanted
        doubtful = 0.1 * claims[primary]
        truth = finest_results(scenario, outcome.summary, kernels, primary, doubtful)
    except TaichiDiskError as error:
        return [Judgement(number, "ended", f"{text}: {error}")]
    if not truth:
        return [Judgement(number, "untold", f"{text}: too long")]
    found = measured(scenario, outcome.series)
    judged = []
    for result in (name for name in claims if name in truth):
        true, doubt = truth[result]
        claim = claims[result] + ROUNDING
        error = abs(found[result] - true)
        end = verdict(error, claim, doubt)
        if kind == "chaotic" and doubt > claim:
            end = "exceeded"
        label = "" if result == primary else result
        judged.append(Judgement(number, end, text, error, claim, doubt, label))
    return judged


def finest_results(
    scenario: Scenario,
    summary: dict[str, Any],
    kernels: KernelCache,
    primary: str,
    doubtful: float,
) -> dict[str, tuple[float, float]]:
    """Return each result and its uncertainty at a 32nd of the step, or at a 128th if
    the uncertainty of the result `primary` exceeds `doubtful`. Empty if that takes too
    long."""
    truth: dict[str, tuple[float, float]] = {}
    work = summary["steps"] * len(scenario.lattice.bonds)
    for finest in (32, 128):
        if finest * work > MOST_WORK:
            break
        truth = refined(scenario, summary, kernels, finest)
        if truth[primary][1] <= doubtful:
            break
    return truth


def report(found: list[Judgement]) -> Iterator[str]:
    """Yield a summary in Markdown, and then every scene whose claim does not hold."""
    from scipy.stats import binomtest

    judged = [judgement for judgement in found if judgement.end in ("held", "exceeded")]
    held = sum(judgement.end == "held" for judgement in judged)
    low, high = binomtest(held, len(judged)).proportion_ci()
    yield (
        f"{len(found)} scenes, {len(judged)} judged: the claim holds in {held}"
        f" ({held / len(judged):.1%}; 95 % interval {low:.1%} to {high:.1%}, Clopper"
        " and Pearson)."
    )
    ratios = np.array(
        [judgement.claim / max(judgement.error, 1e-15) for judgement in judged]
    )
    middle, most = np.quantile(ratios, [0.5, 0.95])
    yield (
        f"* claim over true error: median {middle:.2f}, 95 % of scenes below"
        f" {most:.1f}, least {ratios.min():.2f}"
    )
    for judgement in sorted(found, key=lambda judgement: judgement.end):
        if judgement.end != "held":
            numbers = (
                f"error {judgement.error:.2g}, claim {judgement.claim:.2g}, doubt"
                f" {judgement.doubt:.1g}"
            )
            yield f"* {judgement.end}: {judgement.number}: {numbers}: {judgement.text}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--tolerance",
        action="store_true",
        help="judge time.tolerance instead of the estimate",
    )
    parser.add_argument(
        "--hard",
        action="store_true",
        help="spins, strained springs, strong dashpots, both contacts",
    )
    parser.add_argument(
        "--scene",
        choices=SCENES,
        help="all features of bodies, throws and walls; hard walls that are reset; few"
        " points on such walls, chaotic: all results are judged",
    )
    parser.add_argument(
        "--first", type=int, default=0, help="number of the first scene"
    )
    parser.add_argument("--scenes", type=int, default=100, help="how many")
    parser.add_argument(
        "--log", type=Path, help="with all results: a file that keeps what was judged"
    )
    given = parser.parse_args()
    runtime.start(threads=1)
    kernels = KernelCache()
    numbers = range(given.first, given.first + given.scenes)
    if not given.scene:
        found = [judge(number, given.tolerance, given.hard) for number in numbers]
        print(*report(found), sep="\n")
        return
    found = logged(given.log)
    known = {judgement.number for judgement in found}
    for number in numbers:
        if number in known:
            continue
        judged = judge_features(number, kernels, given.tolerance, given.scene)
        found += judged
        if given.log:
            with given.log.open("a", encoding="utf-8") as file:
                file.writelines(
                    json.dumps(asdict(judgement)) + "\n" for judgement in judged
                )
    found = [judgement for judgement in found if judgement.number in numbers]
    for result in dict.fromkeys(judgement.result for judgement in found):
        print(
            f"\n{result or 'primary result'}:",
            *report([judgement for judgement in found if judgement.result == result]),
            sep="\n",
        )


def logged(path: Path | None) -> list[Judgement]:
    if not (path and path.exists()):
        return []
    return [
        Judgement(**json.loads(line))
        for line in path.read_text(encoding="utf-8").splitlines()
    ]


if __name__ == "__main__":
    main()
