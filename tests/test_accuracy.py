"""`taichi-disk accuracy`: its reference is the tests' own, its table shows order 2, its files are there."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from reference import Model

from taichi_disk.cli import main
from taichi_disk.progress import QuietProgress
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import build
from taichi_disk.study import accuracy, error_sources
from taichi_disk.study.reference import Reference, cached_solution

SMALL = ["lattice.points=30", "impact.velocity=0.05"]


@pytest.mark.parametrize("kind", ["exponential_wall", "absorbing_wall", "compression"])
@pytest.mark.parametrize("boundary", ["dashpot", "pinned"])
def test_the_reference_force_is_the_one_the_tests_were_written_against(kind: str, boundary: str) -> None:
    overrides = ["lattice.points=60", "material.eta_star=7"]
    if kind == "absorbing_wall":
        overrides += ["wall.points=110", f"wall.boundary={boundary}"]
    setup = build(load_scene(kind, overrides))
    rng = np.random.default_rng(3)
    x = setup.lattice.positions + rng.normal(scale=0.01, size=setup.lattice.positions.shape)
    x[: setup.lattice.disk_points, 1] -= setup.lattice.positions[: setup.lattice.disk_points, 1].min() - 0.02
    v = rng.normal(scale=0.01, size=x.shape)
    expected = Model.of(setup.lattice, setup.physics).force(x, v)
    np.testing.assert_allclose(
        Reference(setup.lattice, setup.physics).force(x, v), expected, rtol=0, atol=1e-14 * np.abs(expected).max()
    )


def test_the_kept_solution_is_the_one_computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    setup = build(load_scene("exponential_wall", ["lattice.points=20", "impact.velocity=0.05"]))
    reference = Reference(setup.lattice, setup.physics)
    first = cached_solution(reference, setup.velocities, 0.5)
    np.testing.assert_array_equal(cached_solution(reference, setup.velocities, 0.5), first)
    # Free flight: the wall, 0.1 R below at the start, still gives less than 10^-7 of the motion.
    assert first[0][:, 1].mean() == pytest.approx(setup.lattice.positions[:, 1].mean() - 0.025, abs=2.5e-9)
    assert len(list((tmp_path / "taichi_disk").iterdir())) == 1


def test_the_error_falls_with_the_square_of_the_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(accuracy, "FRACTIONS", (0.4, 0.2, 0.1))
    monkeypatch.setattr(accuracy, "REPEATS", 1)
    points = accuracy.measure(load_scene("exponential_wall", [*SMALL, "material.eta_star=5"]), QuietProgress())
    for integrator in ("velocity_verlet", "trapezoidal"):
        curve = [p for p in points if (p.integrator, p.precision) == (integrator, "f64")]
        dt = np.array([p.dt for p in curve])
        error = np.array([p.trajectory_error for p in curve])
        slope = np.polyfit(np.log(dt), np.log(error), 1)[0]
        assert slope == pytest.approx(2.0, abs=0.1)
        assert error[0] < 1e-4
        assert all(p.seconds > 0 and p.steps * p.dt == pytest.approx(points[0].steps * points[0].dt) for p in curve)


def test_the_command_leaves_table_and_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(accuracy, "FRACTIONS", (0.8, 0.4))
    monkeypatch.setattr(accuracy, "REPEATS", 1)
    monkeypatch.setattr(error_sources, "FINER", (4,))
    command = [
        "accuracy",
        "compression",
        "--set",
        "lattice.points=12",
        "--set",
        "material.eta_star=5",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(command) == 0
    assert "| trapezoidal | f32 | 0.8 |" in capsys.readouterr().out
    with (tmp_path / "out" / "accuracy.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["integrator"] for row in rows] == 2 * (2 * ["velocity_verlet"] + 2 * ["trapezoidal"])
    assert [row["precision"] for row in rows] == 4 * ["f64"] + 4 * ["f32"]
    assert float(rows[3]["error"]) < float(rows[2]["error"]) < 1e-2
    with (tmp_path / "out" / "error_sources.csv").open() as file:
        others = list(csv.DictReader(file))
    assert [row["source"] for row in others] == 4 * ["time step"] + 7 * ["lattice sample"] + ["points"] + 2 * [
        "wall hardness"
    ]
    # A run with the changed key gives the very number.
    from taichi_disk import run

    settings = ["lattice.points=12", "material.eta_star=5", "compression.method=newton", "lattice.seed=2"]
    xi = run(load_scene("compression", settings), tmp_path / "run", video=False).headline["xi"]
    assert float(others[5]["headline"]) == pytest.approx(xi, rel=1e-12)
    assert float(others[5]["difference"]) == pytest.approx(xi - float(others[0]["headline"]), rel=1e-9)
    assert (tmp_path / "out" / "accuracy.png").read_bytes().startswith(b"\x89PNG")


def test_newtons_method_has_no_steps_to_measure(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["accuracy", "compression", "--set", "compression.method=newton"]) == 2
    assert "takes no time steps" in capsys.readouterr().err


def test_no_finer_lattice_is_asked_for_than_can_be_built():
    scene = load_scene("exponential_wall", ["lattice.points=40000"])
    finer = [changed.lattice.points for source, _, changed in error_sources._changes(scene) if source == "points"]
    assert finer == [160_000, 640_000]
