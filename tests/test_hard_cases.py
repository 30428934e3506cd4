"""Every hard case ends as it should: done with a closed ledger, stopped with the reason named, or refused."""

from __future__ import annotations

import pytest

from taichi_disk.study.hard_cases import CASES, judge

pytestmark = pytest.mark.usefixtures("taichi")


@pytest.mark.parametrize(
    "case", [pytest.param(one, id=one.name, marks=() if one.quick else pytest.mark.validate) for one in CASES]
)
def test_a_hard_case_ends_as_it_should(case) -> None:
    assert case.failings(judge(case)) == []
