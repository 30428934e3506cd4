"""Random scenes whose truth is known: a tolerance is kept, and the error estimate of every run holds."""

from __future__ import annotations

import pytest

from taichi_disk.simulation.simulation import KernelCache

from .estimate_trial import judge, report
from .random_scenes import trial_scene

SMALL = [number for number in range(60) if "lattice.points=30" in trial_scene(number)[1]]  # whose truth is soon known


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
