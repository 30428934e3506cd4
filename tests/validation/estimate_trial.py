"""Check on random scenes with known results whether error estimates hold and tolerances
are kept.

    python -m tests.validation.estimate_trial [--tolerance]
    [--scene features|resets|chaotic] [--first 0] [--scenes 100]

Scenes are drawn by number (`random_scenes`), and `truth` has their results. A result
cannot be judged if its true value is uncertain by more than a tenth of the claimed
error; in a chaotic impact the claim has then failed.
"""

import argparse
import math
from dataclasses import dataclass

import numpy as np

from taichi_disk.base import runtime
from taichi_disk.base.errors import TaichiDiskError
from taichi_disk.experiments.computation.error_estimate import measured
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import load_scene

from .random_scenes import (
    chaotic_scene,
    custom_body,
    feature_scene,
    plain_scene,
    reset_scene,
)
from .truth import refined, true_result

FINEST = 1e-8  # smallest claimed error that is judged by other solvers
# rounding error of a result, such as the tangential impulse without friction
ROUNDING = 1e-13
SCENES = {
    "plain": plain_scene,
    "features": feature_scene,
    "resets": reset_scene,
    "chaotic": chaotic_scene,
}
MOST_WORK = 3e9  # most spring evaluations for a true result; longer scenes are left out


@dataclass(frozen=True)
class Judgement:
    """The judgement of a result of scene `number`. Errors have the unit of the result.

    `end`: held or exceeded; untold: the true result is unknown; ended: the scene has no
    result, or none within the tolerance. `claim`: the estimate or the tolerance.
    `result`: name of the result, if it is not the primary one.
    """

    number: int
    end: str
    text: str
    error: float = math.nan
    claim: float = math.nan
    doubt: float = 0.0
    result: str = ""


def judge(number, kind="plain", tolerance=False):
    """Run scene `number` of a `kind` as `run` does, and compare the estimate of each
    result with its true error. With `tolerance`, a tolerance is the claim about the
    primary result."""
    drawn = SCENES[kind](number)
    settings = drawn.settings
    if tolerance:
        settings = (*settings, f"time.tolerance={drawn.tolerance!r}")
    text = " ".join((drawn.name, *settings))
    try:
        scene = load_scene(drawn.name, settings)
        body = scene.body()
        if drawn.aspect > 0.0:
            text += f" aspect={drawn.aspect:.3f}"
            body = custom_body(body, drawn.aspect, number)
        scenario = scene.scenario(body)
        outcome = compute(scenario)
        claims = dict(outcome.summary["error_estimate"])
        primary, _ = scenario.primary(outcome.series)
        if tolerance:
            claims[primary] = drawn.tolerance
        if primary not in claims:
            return [Judgement(number, "ended", f"{text}: no estimate")]
        if kind == "plain":
            true = true_result(scenario, outcome, max(claims[primary], FINEST))
            truth = {primary: true}
        else:
            truth = finest_results(outcome, primary, 0.1 * claims[primary])
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
        end = "held" if error <= claim else "exceeded"
        if kind == "chaotic" and doubt > claim:
            end = "exceeded"
        elif doubt > 0.1 * claim:
            end = "untold"
        label = "" if result == primary else result
        judged.append(Judgement(number, end, text, error, claim, doubt, label))
    return judged


def finest_results(outcome, primary, doubtful):
    """Return each result and its uncertainty at a 32nd of the step, or at a 128th if
    that of `primary` exceeds `doubtful`. Empty if that takes too long."""
    truth = {}
    work = outcome.summary["steps"] * len(outcome.scenario.lattice.bonds)
    for finest in (32, 128):
        if finest * work > MOST_WORK:
            break
        truth = refined(outcome, finest)
        if truth[primary][1] <= doubtful:
            break
    return truth


def report(found):
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
    ratios = [judgement.claim / max(judgement.error, 1e-15) for judgement in judged]
    middle, most = np.quantile(ratios, [0.5, 0.95])
    yield (
        f"* claim over true error: median {middle:.2f}, 95 % of scenes below"
        f" {most:.1f}, least {min(ratios):.2f}"
    )
    for judgement in sorted(found, key=lambda judgement: judgement.end):
        if judgement.end != "held":
            numbers = (
                f"error {judgement.error:.2g}, claim {judgement.claim:.2g}, doubt"
                f" {judgement.doubt:.1g}"
            )
            yield f"* {judgement.end}: {judgement.number}: {numbers}: {judgement.text}"


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--tolerance",
        action="store_true",
        help="judge time.tolerance instead of the estimate",
    )
    parser.add_argument(
        "--scene",
        choices=SCENES,
        default="plain",
        help="all features of bodies, throws and walls; hard walls that are reset; few"
        " points on such walls, chaotic: all results are judged",
    )
    parser.add_argument(
        "--first", type=int, default=0, help="number of the first scene"
    )
    parser.add_argument("--scenes", type=int, default=100, help="how many")
    given = parser.parse_args()
    runtime.start(threads=1)
    found = []
    for number in range(given.first, given.first + given.scenes):
        found += judge(number, given.scene, given.tolerance)
    for result in dict.fromkeys(judgement.result for judgement in found):
        own = [judgement for judgement in found if judgement.result == result]
        print(f"\n{result or 'primary result'}:", *report(own), sep="\n")


if __name__ == "__main__":
    main()
