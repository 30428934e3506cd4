"""`python -m tests.benchmarks` measures: no times are asserted."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from .timing import in_turn, table


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "tests.benchmarks", *arguments]
    return subprocess.run(line, capture_output=True, text=True, cwd=Path(__file__).parents[2])


@pytest.mark.validate
def test_every_part_that_needs_no_window_prints_its_tables() -> None:
    tiny = ("--repeats=1", "--set=lattice.points=60", "--set=impact.velocity=0.05")
    ended = run("kernel", "run", "start-up", *tiny)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.count("ratio ") == 6 and "steps made" in ended.stdout


def test_an_unknown_part_is_refused() -> None:
    ended = run("speed")
    assert ended.returncode == 2 and "no part speed: choose from kernel" in ended.stderr


def test_ratios_are_those_of_the_turns() -> None:
    clock = iter([1.0, 10.0, 2.0, 60.0, 3.0, 30.0])
    costs = in_turn({"a": lambda: next(clock), "b": lambda: next(clock)}, 3)
    assert costs == {"a": [1.0, 2.0, 3.0], "b": [10.0, 60.0, 30.0]}
    _, a, b = table("title", costs, remarks={"b": "remark"})
    assert a.split() == ["a", "1.00", "1", "2"] and b.split() == ["b", "10.00", "10", "30", "remark"]
