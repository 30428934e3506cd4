"""`taichi_disk.studies.accuracy`: changes of the scene, measurements, conclusions."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_disk import Lattice, load_scene, run
from taichi_disk.base.progress import silent
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.studies.accuracy import steps
from taichi_disk.studies.accuracy.steps import StepError, StepStudy
from taichi_disk.studies.accuracy.study import (
    FINER,
    HARDER,
    SCATTER,
    effects,
    finer_lattice,
    report,
    sentence,
)

STEP = StepError(
    "velocity_verlet", True, 0.8, 0.01, 100, 0.1, 3.0, 1e-6, 1e-6, 0.0, 0.0
)


def drag(scenario):
    """Return how strongly the resets brake a wall's boundary."""
    boundary = len(scenario.lattice.wall_boundary)
    return scenario.lattice.masses[0] * boundary / scenario.model.reset_interval


@pytest.mark.parametrize("kind", ["exponential_wall", "absorbing_wall"])
def test_a_finer_lattice_is_of_the_same_material(kind):
    scene = load_scene(kind, ["lattice.points=60", "material.eta_star=5"])
    changed = scene.with_(finer_lattice(scene))
    assert changed.lattice.points == 240
    # A spring's eta, the mass, the shape of a wall and its boundary's drag stay.
    before = scene.scenario()
    after = changed.scenario()
    if kind == "absorbing_wall":
        assert drag(after) == pytest.approx(drag(before), rel=0.1)
    assert after.model.springs.eta == pytest.approx(before.model.springs.eta)
    assert before.model.springs.eta > 0.0
    mass = before.lattice.masses[:60].sum()
    assert after.lattice.masses[:240].sum() == pytest.approx(mass)
    width = np.ptp(before.lattice.positions[:, 0])
    assert np.ptp(after.lattice.positions[:, 0]) == pytest.approx(width, rel=0.02)
    pinned = load_scene("absorbing_wall", ["wall.boundary=pinned"])
    assert "wall.reset_interval" not in finer_lattice(pinned)


@pytest.mark.usefixtures("kernels")
def test_effects_are_those_of_running_the_changed_scenes(monkeypatch):
    monkeypatch.setattr("taichi_disk.studies.accuracy.study.SEEDS", 3)
    # a step that suits the scene, but no finer lattice
    own = ["lattice.points=30", "material.eta_star=0"]
    found = effects(load_scene("exponential_wall", [*own, "time.dt=0.04"]), silent)

    def e(**keys):
        scene = load_scene("exponential_wall", own).with_(**keys)
        return run(scene, lattices=1).restitution

    samples = [e(), e(seed=1), e(seed=2)]
    assert found == {
        SCATTER: pytest.approx(np.std(samples, ddof=1), rel=1e-9),
        FINER: pytest.approx(e(points=120) - e(), rel=1e-9),
        HARDER: pytest.approx(e(a=3000.0) - e(), rel=1e-9),
    }


@pytest.mark.usefixtures("kernels")
def test_points_from_a_file_have_no_other_sample(tmp_path):
    disk = Lattice.disk(30, 0)
    np.savetxt(tmp_path / "points.csv", disk.positions, delimiter=",")
    own = load_scene("exponential_wall", [f"lattice.file={tmp_path / 'points.csv'}"])
    assert effects(own, silent).keys() == {HARDER}


def study_of(scene, *settings):
    loaded = load_scene(scene, settings)
    scenario = loaded.scenario()
    return StepStudy(scenario, compute(scenario, estimate=False))


@pytest.mark.validate
@pytest.mark.usefixtures("kernels")
def test_errors_fall_with_the_square_of_the_step(monkeypatch):
    monkeypatch.setattr(steps, "FRACTIONS", (0.4, 0.2, 0.1))
    monkeypatch.setattr(steps, "REPEATS", 1)
    study = study_of("exponential_wall", "lattice.points=30", "material.eta_star=20")
    found = study.measure(silent)
    assert sum(point.is_default for point in found) == 1
    for integrator in ("velocity_verlet", "trapezoidal"):
        own = [one for one in found if one.integrator == integrator]
        curve = [one for one in own if not one.is_default]
        dt, error, off = np.array(
            [(one.dt, one.error, one.trajectory_error) for one in curve]
        ).T
        for errors, tolerance in ((off, 0.1), (error, 0.2)):
            order, _ = np.polyfit(np.log(dt), np.log(errors), 1)
            assert order == pytest.approx(2.0, abs=tolerance)
        assert off[-1] < 1e-3
        for one in curve:
            assert one.steps * one.dt == pytest.approx(study.end)


@pytest.mark.usefixtures("kernels")
def test_steps_fit_the_resets_of_a_boundary():
    study = study_of(
        "absorbing_wall", "lattice.points=30", "wall.points=36", "wall.width=3.0"
    )
    resets = study.end / study.scenario.model.reset_interval
    assert resets == pytest.approx(round(resets), rel=1e-12)
    assert all(number % round(resets) == 0 for _, number in study.runs)


def test_the_sentence_says_what_matters_and_stands_in_the_report(tmp_path, capsys):
    changes = {SCATTER: 9e-4, FINER: 5e-4, HARDER: -0.04}
    expected = (
        "restitution: time step 1e-06, lattice scatter 0.0009, 4 times the points"
        " 0.0005, wall 10 times as hard -0.04: use more seeds, not smaller steps"
    )
    assert sentence("restitution", [STEP], changes) == expected
    report("restitution", [STEP], expected, tmp_path, "Title")
    assert capsys.readouterr().out.startswith(expected)
    assert len(list(tmp_path.glob("accuracy.*"))) == 3
    finer = changes | {FINER: -0.01}
    assert "more seeds and points," in sentence("restitution", [STEP], finer)
    coarse = [replace(STEP, error=0.1)]
    assert "use smaller steps" in sentence("restitution", coarse, changes)
    # A change that the time step hides does not speak for more points.
    assert "use smaller steps" in sentence("restitution", coarse, finer)
    assert sentence("xi", [], {HARDER: 0.1}).endswith(": nothing to gain")
