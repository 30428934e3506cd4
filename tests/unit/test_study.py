"""`taichi_disk.accuracy`: the changes of the scene, the measurements and the
conclusions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from taichi_disk.accuracy import steps
from taichi_disk.accuracy.steps import StepError, StepStudy
from taichi_disk.accuracy.study import (
    POINTS,
    SAMPLE,
    WALL,
    Change,
    Findings,
    changes,
    with_result,
)
from taichi_disk.computation.outcome import compute
from taichi_disk.computation.stability import spectrum
from taichi_disk.scenes import load_scene

STEP = StepError(
    "velocity_verlet", True, 0.8, 0.01, 100, 0.1, 3.0, 1e-6, 1e-6, 0.0, 0.0
)


@pytest.mark.parametrize("kind", ["exponential_wall", "absorbing_wall"])
def test_finer_lattices_are_of_the_same_material(kind: str) -> None:
    scene = load_scene(kind, ["lattice.points=60", "material.eta_star=5"])
    finer = [change for change in changes(scene) if change.source == POINTS]
    assert [change.keys["lattice.points"] for change in finer] == [
        factor * scene.lattice.points for factor in (4, 16, 64)
    ]
    changed = scene.with_(finer[0].keys)
    assert changed.lattice.points == 240
    # The eta of a spring, the total mass, the shape of a wall and the drag of its
    # boundary stay the same.
    before = scene.scenario()
    after = changed.scenario()
    if kind == "absorbing_wall":
        drags = [
            2.0
            * scenario.lattice.masses[0]
            * len(scenario.lattice.wall_boundary)
            / scenario.model.reset_interval
            for scenario in (before, after)
        ]
        assert drags[1] == pytest.approx(drags[0], rel=0.1)
    assert after.model.springs.eta == pytest.approx(before.model.springs.eta)
    assert before.model.springs.eta > 0.0
    disk = slice(0, 60), slice(0, 240)
    assert after.lattice.masses[disk[1]].sum() == pytest.approx(
        before.lattice.masses[disk[0]].sum()
    )
    assert np.ptp(after.lattice.positions[:, 0]) == pytest.approx(
        np.ptp(before.lattice.positions[:, 0]), rel=0.02
    )


def test_a_scatter_above_the_step_s_error_asks_for_more_lattices_and_points() -> None:
    scene = load_scene("exponential_wall", ["lattice.points=300"])
    finer = [
        replace(change, result=0.9, difference=0.1)
        for change in changes(scene)
        if change.source == POINTS
    ]
    sources = [
        Change("scene", "as it is", result=0.8),
        Change(SAMPLE, "seed 1", result=0.81),
        *finer,
    ]
    advice = Findings("restitution", [STEP], sources).sentence
    assert advice.endswith("use more seeds and points, not smaller steps")
    own = scene.with_(viscosity=0.01)
    assert all("viscosity" not in key for change in changes(own) for key in change.keys)


def test_no_lattice_is_tried_that_takes_hours_or_whose_points_come_from_a_file(
    tmp_path,
) -> None:
    finer = [
        change.change
        for change in changes(load_scene("exponential_wall", ["lattice.points=40000"]))
    ]
    assert "N = 160,000, same η" in finer
    assert "N = 640,000, same η" not in finer
    (tmp_path / "points.csv").write_text("x,y\n0,0\n1,0\n0,1\n")
    own = load_scene(
        {"scene": "exponential_wall", "lattice": {"file": str(tmp_path / "points.csv")}}
    )
    assert {change.source for change in changes(own)} == {WALL}


@pytest.mark.usefixtures("kernels")
def test_a_change_without_a_result_says_why() -> None:
    scene = load_scene("exponential_wall", ["lattice.points=60", "impact.max_time=9.0"])
    change = with_result(scene, 0.9, Change(WALL, "a", {"impact.max_time": 0.1}))
    assert math.isnan(change.difference)
    assert "has not left the wall" in change.remark
    change = with_result(scene, 0.9, Change(WALL, "a", {"wall.a": -1.0}))
    assert math.isnan(change.result)
    assert "wall.a" in change.remark


def study_of(scene: str, *settings: str) -> StepStudy:
    loaded = load_scene(scene, settings)
    scenario = loaded.scenario()
    limits = spectrum(scenario.lattice, scenario.model)
    return StepStudy(scenario, limits, compute(scenario, estimate=False))


@pytest.mark.validate
@pytest.mark.usefixtures("kernels")
def test_errors_fall_with_the_square_of_the_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(steps, "FRACTIONS", (0.4, 0.2, 0.1))
    monkeypatch.setattr(steps, "REPEATS", 1)
    study = study_of("exponential_wall", "lattice.points=30", "material.eta_star=20")
    found = study.measure(lambda number: None)
    assert sum(point.is_default for point in found) == 1
    for integrator in ("velocity_verlet", "trapezoidal"):
        curve = [
            point
            for point in found
            if point.integrator == integrator and not point.is_default
        ]
        dt, error, off = np.array(
            [(point.dt, point.error, point.trajectory_error) for point in curve]
        ).T
        assert np.polyfit(np.log(dt), np.log(off), 1)[0] == pytest.approx(2.0, abs=0.1)
        assert np.polyfit(np.log(dt), np.log(error), 1)[0] == pytest.approx(
            2.0, abs=0.2
        )
        assert off[-1] < 1e-3
        assert [point.steps * point.dt for point in curve] == pytest.approx(
            len(curve) * [study.end]
        )


@pytest.mark.usefixtures("kernels")
def test_steps_fit_the_resets_of_a_boundary() -> None:
    study = study_of(
        "absorbing_wall", "lattice.points=30", "wall.points=36", "wall.width=3.0"
    )
    resets = study.end / study.scenario.model.reset_interval
    assert resets == pytest.approx(round(resets), rel=1e-12)
    assert all(number % round(resets) == 0 for _, number in study.runs)


def test_the_sentence_says_what_matters() -> None:
    samples = [
        Change("scene", "", result=0.96),
        *(Change(SAMPLE, "", result=e) for e in (0.961, 0.959, 0.9605)),
    ]
    wall = Change(WALL, "", difference=-0.04)
    finer = Change(POINTS, "", difference=5e-4)
    found = Findings("restitution", [STEP], [*samples, finer, wall])
    assert (
        found.sentence
        == "restitution: time step 1e-06, lattice scatter 0.0009, finest lattice"
        " 0.0005, hardest wall -0.04: use more seeds, not smaller steps"
    )
    assert (
        "more seeds and points,"
        in replace(found, sources=[*samples, replace(finer, difference=0.01)]).sentence
    )
    coarse = replace(found, steps=[replace(STEP, error=0.1)])
    assert "use smaller steps" in coarse.sentence
    # A change that the time step hides does not speak for more points.
    hidden = [*samples, replace(finer, difference=0.01)]
    assert "use smaller steps" in replace(coarse, sources=hidden).sentence
