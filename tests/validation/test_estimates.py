"""Random scenes with known results: tolerances are kept, and the error estimates of runs hold."""

from __future__ import annotations

import pytest

from taichi_disk.simulation.simulation import KernelCache

from .estimate_trial import judge, judge_features, report
from .random_scenes import feature_scene, trial_scene

SMALL = [number for number in range(60) if "lattice.points=30" in trial_scene(number)[1]]  # quick to check

SMALL_WITH_FRICTION = [
    number
    for number in range(200)
    if {"lattice.points=30", "wall.friction=0.0"} & {*(settings := feature_scene(number)[1])} == {"lattice.points=30"}
    and any(text.startswith("wall.friction") for text in settings)
]
AGREEING = [390, 395, 458]  # e at a step and at half of it agree by chance


@pytest.mark.validate
@pytest.mark.parametrize(
    ("scenes", "tolerance"),
    [pytest.param(SMALL[::2], False, id="estimate"), pytest.param(SMALL[1::2], True, id="tolerance")],
)
def test_what_a_run_claims_of_its_error_holds(scenes: list[int], tolerance: bool, kernels: KernelCache) -> None:
    found = [judge(number, kernels, tolerance) for number in scenes]
    judged = [one for one in found if one.end in ("held", "exceeded")]
    assert len(judged) > 0.8 * len(scenes)
    assert sum(one.end == "held" for one in judged) >= 0.95 * len(judged), "\n".join(report(found))


@pytest.mark.validate
def test_what_a_run_claims_of_every_result_holds_with_friction(kernels: KernelCache) -> None:
    found = [one for number in SMALL_WITH_FRICTION + AGREEING for one in judge_features(number, kernels)]
    judged = [one for one in found if one.end in ("held", "exceeded")]
    assert len(judged) > 0.8 * len(found)
    assert all(one.end == "held" for one in judged if not one.result), "\n".join(report(found))
    assert sum(one.end == "held" for one in judged) >= 0.98 * len(judged), "\n".join(report(found))
