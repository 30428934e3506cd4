"""Whatever a scene says, it ends: done with a closed ledger, or stopped or refused with the key that mends it."""

from __future__ import annotations

from collections import Counter

import pytest

from taichi_disk.study.random_scenes import Fates, random_scene


def test_a_number_names_one_scene_and_numbers_differ() -> None:
    assert random_scene(5) == random_scene(5)
    assert len({random_scene(number) for number in range(50)}) == 50


@pytest.mark.parametrize(("count", "kinds"), [(30, 2), pytest.param(1000, 3, marks=pytest.mark.validate)])
def test_random_scenes_end_well_or_say_why(count: int, kinds: int) -> None:
    fates = Fates()
    found = [fates.of(number, kinds) for number in range(count)]
    assert [fate for fate in found if fate.fault] == []
    # Not by refusing them, or giving up.
    assert Counter(fate.end for fate in found)["done"] > 0.5 * count
