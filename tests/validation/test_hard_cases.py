"""Every scene ends: done with a closed balance, or stopped with reason and remedy."""

from collections import Counter

import pytest

from .hard_cases import CASES
from .random_scenes import ShortOnly, fate

pytestmark = pytest.mark.validate


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_a_hard_case_ends_as_it_should(case):
    assert case.failings(case.judge()) == []


def test_random_scenes_end_well_or_say_why(kernels):
    short = ShortOnly(kernels, 1e7)
    found = {number: fate(number, short) for number in range(100)}
    assert {number: fault for number, (_, fault) in found.items() if fault} == {}
    # Most scenes must be computed, not refused.
    ends = Counter(verdict.end for verdict, _ in found.values())
    assert ends["done"] > 0.7 * (len(found) - ends["long"]) > 0.3 * len(found)
