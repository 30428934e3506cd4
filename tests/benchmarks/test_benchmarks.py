"""`python -m tests.benchmarks` measures: no times are asserted."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.validate
def test_every_part_that_needs_no_window_prints_its_tables() -> None:
    tiny = ("--repeats=1", "--set=lattice.points=60", "--set=impact.velocity=0.05")
    line = [sys.executable, "-m", "tests.benchmarks", "kernel", "run", "start-up", *tiny]
    ended = subprocess.run(line, capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.count("ratio ") == 6 and "attempts: 1" in ended.stdout
