"""Every scene ends: done with a closed energy balance, or stopped with the reason and a
remedy."""

from __future__ import annotations

from collections import Counter

import pytest

from taichi_disk.simulation.simulation import KernelCache

from .hard_cases import CASES, Case
from .random_scenes import ShortOnly, fate

LONG = pytest.mark.validate


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=() if case.quick else LONG)
        for case in CASES
    ],
)
@pytest.mark.validate
def test_a_hard_case_ends_as_it_should(case: Case, kernels: KernelCache) -> None:
    assert case.failings(case.judge(kernels)) == []


@LONG
def test_random_scenes_end_well_or_say_why(kernels: KernelCache) -> None:
    short = ShortOnly(kernels, 1e7)
    found = {number: fate(number, short) for number in range(100)}
    assert {number: fault for number, (_, fault) in found.items() if fault} == {}
    # Most scenes must be computed, not refused.
    ends = Counter(verdict.end for verdict, _ in found.values())
    assert ends["done"] > 0.7 * (len(found) - ends["long"]) > 0.3 * len(found)
