"""`python -m tests.benchmarks` runs; times are not checked."""

from __future__ import annotations

import re
from itertools import combinations, pairwise

import pytest

from taichi_disk.base import runtime

from . import kernel, precision

VERLET = "run, velocity Verlet"


@pytest.mark.validate
@pytest.mark.parametrize(
    ("damping", "programs"),
    [
        (0, {"run, velocity Verlet", "run, Takahashi-Imada", "DOP853"}),
        (10, {"run, velocity Verlet", "run, implicit dashpots", "BDF", "Radau"}),
    ],
)
def test_every_program_finds_the_same_restitution(
    damping, programs, tmp_path, monkeypatch
):
    # one step and one tolerance of each program
    for name in ("FRACTIONS", "FEW_FRACTIONS"):
        monkeypatch.setattr(precision, name, (0.4,))
    for name in ("RTOLS", "TOLERANCES"):
        first = {key: own[-1:] for key, own in vars(precision)[name].items()}
        monkeypatch.setattr(precision, name, first)
    figure = tmp_path / "precision.png"
    tiny = ("lattice.points=60", f"material.eta_star={damping}")
    runtime.start()
    printed = "\n".join(precision.precision(1, tiny, figure, lattices=1))
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in printed.splitlines()
        if line.startswith("| ") and "setting" not in line
    ]
    assert programs <= {row[0] for row in rows}
    assert figure.exists()
    for row in rows:
        found = re.fullmatch(r"\$.*10\^{(-\d+)}\$", row[3])
        assert "below" in row[3] or int(found[1]) <= -4, row
    # the second run is told apart: with and without it the error is the same
    both = {row[2]: row[3] for row in rows if row[:2] == [VERLET, "safety 0.4"]}
    assert both["yes"] == both["no"]


@pytest.mark.validate
def test_a_step_is_measured_in_every_model():
    runtime.start()
    _, *rows = kernel.kernel(1, ("lattice.points=60",))
    assert len(rows) == len(kernel.SCENES)
    for row in rows:
        cost, e = row[40:].split(",")
        assert float(cost) > 0.0
        assert 0.0 < float(e) < 1.0


def test_the_numbers_along_the_diagram_do_not_overlap():
    times = (0.021, 0.182, 0.74)  # less than two decades
    points = [
        precision.Measured(
            "Numba", "step", False, error=1e-6, command=[], further=[time]
        )
        for time in times
    ]
    axes = precision.diagram(points).axes[1]
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


def test_the_names_in_the_diagram_cover_neither_each_other_nor_a_point():
    points = [
        precision.Measured(program, "step", second, 1e-6 * k**-2, [], [time * k])
        for program, second, time in (
            (VERLET, True, 0.029),
            (VERLET, False, 0.013),
            ("LAMMPS", False, 0.021),
            ("Numba", False, 0.0115),
        )
        for k in (1, 2, 4, 8)
    ]
    axes = precision.diagram(points).axes[0]
    names = [(text.get_text(), text.get_window_extent()) for text in axes.texts]
    assert {name for name, _ in names} == {"run", "run, one run", "LAMMPS", "Numba"}
    assert not any(one.overlaps(two) for (_, one), (_, two) in combinations(names, 2))
    for line in axes.lines:
        marks = axes.transData.transform(line.get_xydata())
        assert not any(box.count_contains(marks) for _, box in names)
