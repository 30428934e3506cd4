"""`python -m tests.benchmarks` runs; times are not checked."""

from __future__ import annotations

import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from .precision import Measured, diagram


@pytest.mark.validate
def test_every_part_that_needs_no_window_prints_its_tables() -> None:
    tiny = ("--repeats=1", "--set=lattice.points=60", "--set=impact.velocity=0.05")
    printed = benchmarks("kernel", "run", "start-up", *tiny)
    assert printed.count("ratio ") == 6
    assert "attempts: 1" in printed


@pytest.mark.validate
@pytest.mark.parametrize(
    ("damping", "programs"),
    [
        ("0", {"run, velocity Verlet", "run, Takahashi-Imada", "DOP853"}),
        ("10", {"run, velocity Verlet", "run, implicit dashpots", "BDF", "Radau"}),
    ],
)
def test_every_program_finds_the_same_restitution(
    damping: str, programs: set[str], tmp_path: Path
) -> None:
    figure = tmp_path / "precision.png"
    tiny = ("--lattices=1", "--repeats=1", "--set=lattice.points=60")
    damped = f"--set=material.eta_star={damping}"
    printed = benchmarks("precision", *tiny, damped, f"--figure={figure}")
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in printed.splitlines()
        if line.startswith("| ") and "setting" not in line
    ]
    assert programs <= {row[0] for row in rows}
    assert figure.exists()
    for row in rows:
        found = re.fullmatch(r"\$.*10\^{(-\d+)}\$", row[3])
        assert "below" in row[3] or int(found[1]) <= -4, row  # type: ignore[index]
    # the second run is told apart: with and without it the error is the same
    both = {
        (*row[:2], row[2]): row[3] for row in rows if row[0] == "run, velocity Verlet"
    }
    key = ("run, velocity Verlet", "safety 0.8")
    assert both[(*key, "yes")] == both[(*key, "no")]


def test_the_numbers_along_the_diagram_do_not_overlap() -> None:
    times = (0.021, 0.182, 0.74)  # less than two decades
    points = [
        Measured("Numba", "step", False, error=1e-6, command=[], further=[time])
        for time in times
    ]
    axes = diagram(points).axes[0]
    low, high = axes.get_xlim()
    boxes = [
        label.get_window_extent()
        for place, label in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
        if low <= place <= high
    ]
    minor = axes.get_xticklabels(minor=True)
    assert len(boxes) >= 3
    assert not any(label.get_text() for label in minor)
    assert all(left.x1 < right.x0 for left, right in pairwise(boxes))


def benchmarks(*arguments: str) -> str:
    """Return the printed output."""
    line = [sys.executable, "-m", "tests.benchmarks", *arguments]
    ended = subprocess.run(
        line, capture_output=True, text=True, cwd=Path(__file__).parents[2]
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout
