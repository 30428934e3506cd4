"""Check on random scenes with known results whether error estimates hold and tolerances
are kept.

    python -m tests.validation.estimate_trial [--tolerance] [--hard | --features]
    [--first 0] [--scenes 100]

Scenes are drawn by number (`trial_scene`, `hard_scene`, `feature_scene`); `truth`
computes the true results. A scene whose true result is uncertain by more than a tenth
of the claimed error cannot be judged. With `--features` every result is judged, and
`--log FILE` stores the judgements, so that the same command can go on from there.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from taichi_disk import runtime
from taichi_disk.computation.error_estimate import measured
from taichi_disk.computation.outcome import compute
from taichi_disk.errors import SimulationError, TaichiDiskError
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache

from .random_scenes import custom_body, feature_scene, hard_scene, trial_scene
from .truth import refined, true_result

FINEST = 1e-8  # smallest claimed error that is judged
# rounding error of a result, such as the tangential impulse without friction
ROUNDING = 1e-13
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
    strain = wanted = 0.0
    if hard:
        name, settings, strain = hard_scene(number)
    else:
        name, settings, wanted = trial_scene(number)
    if tolerance:
        settings = (*settings, f"time.tolerance={wanted}")
    scene, text = (
        load_scene(name, settings),
        " ".join((name, *settings, f"strain={strain}" * (strain > 0.0))),
    )
    body = scene.body()
    if strain:
        off = np.random.default_rng(number).uniform(
            -strain, strain, len(body.rest_lengths)
        )
        body = replace(body, rest_lengths=body.rest_lengths * (1.0 + off))
    scenario = scene.scenario(body)
    try:
        outcome = compute(scenario)
        key, found = scenario.primary(outcome.columns)
        claim, dt = (
            wanted if tolerance else outcome.summary["error_estimate"].get(key),
            outcome.summary["dt"],
        )
        if claim is None:
            return Judgement(number, "ended", f"{text}: no estimate")
        truth, doubt = true_result(
            scenario, outcome.columns, outcome.positions, dt, max(claim, FINEST)
        )
    except SimulationError as error:
        return Judgement(number, "ended", f"{text}: {error}")
    off = abs(found - truth)
    end = "untold" if doubt > 0.1 * claim else "held" if off <= claim else "exceeded"
    if end == "exceeded" and outcome.summary["warnings"]:
        end = "warned"
    return Judgement(number, end, text, off, claim, doubt)


def feature_tolerance(number: int) -> float:
    """Return the tolerance of feature scene `number`, from 1e-6 to 1e-3."""
    return float(10.0 ** np.random.default_rng([number, 9]).uniform(-6.0, -3.0))


def judge_features(
    number: int, kernels: KernelCache, tolerance: bool = False
) -> list[Judgement]:
    """Run scene `number` as `run` does, and compare the estimate of each result with
    runs at shorter steps. With `tolerance`, a tolerance is the claim about the primary
    result."""
    name, settings, aspect = feature_scene(number)
    wanted = feature_tolerance(number)
    if tolerance:
        settings = (*settings, f"time.tolerance={wanted!r}")
    text = " ".join((name, *settings))
    if aspect > 0.0:
        text += f" aspect={aspect:.3f}"
    try:
        scene = load_scene(name, settings)
        body = custom_body(scene.body(), aspect, number) if aspect else scene.body()
        scenario = scene.scenario(body)
        outcome = compute(scenario)
        claims = dict(outcome.summary["error_estimate"])
        found = measured(scenario, outcome.columns)
        if not claims:
            return [Judgement(number, "ended", f"{text}: no estimate")]
        primary, _ = scenario.primary(outcome.columns)
        if tolerance:
            claims[primary] = wanted
        truth: dict[str, tuple[float, float]] = {}
        work = outcome.summary["steps"] * len(body.bonds)
        for finest in (32, 128):
            if finest * work > MOST_WORK:
                break
            truth = refined(scenario, outcome.summary, kernels, finest)
            if truth[primary][1] <= 0.1 * claims[primary]:
                break
        if not truth:
            return [Judgement(number, "untold", f"{text}: too long")]
    except TaichiDiskError as error:
        return [Judgement(number, "ended", f"{text}: {error}")]
    judged = []
    for result in [result for result in claims if result in truth]:
        (true, doubt), claim = truth[result], claims[result] + ROUNDING
        off = abs(found[result] - true)
        end = (
            "untold" if doubt > 0.1 * claim else "held" if off <= claim else "exceeded"
        )
        judged.append(
            Judgement(
                number,
                end,
                text,
                off,
                claim,
                doubt,
                "" if result == primary else result,
            )
        )
    return judged


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
        "--features",
        action="store_true",
        help="all features of bodies, throws and walls, all results",
    )
    parser.add_argument(
        "--first", type=int, default=0, help="number of the first scene"
    )
    parser.add_argument("--scenes", type=int, default=100, help="how many")
    parser.add_argument(
        "--log", type=Path, help="with --features: a file that keeps what was judged"
    )
    given = parser.parse_args()
    runtime.start(threads=1)
    kernels = KernelCache()
    numbers = range(given.first, given.first + given.scenes)
    if not given.features:
        print(
            *report([judge(number, given.tolerance, given.hard) for number in numbers]),
            sep="\n",
        )
        return
    found = logged(given.log)
    for number in [
        number
        for number in numbers
        if number not in {judgement.number for judgement in found}
    ]:
        judged = judge_features(number, kernels, given.tolerance)
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
