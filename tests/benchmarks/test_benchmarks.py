"""`python -m tests.benchmarks` runs; times are not checked."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.validate
def test_every_part_that_needs_no_window_prints_its_tables() -> None:
    tiny = ("--repeats=1", "--set=lattice.points=60", "--set=impact.velocity=0.05")
    printed = benchmarks("kernel", "run", "start-up", *tiny)
    assert printed.count("ratio ") == 6 and "attempts: 1" in printed


@pytest.mark.validate
def test_every_program_finds_the_same_restitution(tmp_path: Path) -> None:
    figure = tmp_path / "precision.png"
    printed = benchmarks(
        "precision", "--repeats=1", "--set=lattice.points=200", f"--figure={figure}"
    )
    rows = [
        line.split("|")[1:4]
        for line in printed.splitlines()
        if line.startswith("| ") and "setting" not in line
    ]
    errors = [
        float(found)
        for *_, text in rows
        for found in re.findall(r"\$.*10\^{(-\d+)}", text)
    ]
    assert len(errors) == len(rows) >= 16 and max(errors) <= -5 and figure.exists()


def benchmarks(*arguments: str) -> str:
    """Return the printed output."""
    line = [sys.executable, "-m", "tests.benchmarks", *arguments]
    ended = subprocess.run(
        line, capture_output=True, text=True, cwd=Path(__file__).parents[2]
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout
