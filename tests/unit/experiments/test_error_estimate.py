"""The error estimate: exact if errors are powers of the step, else safe."""

import numpy as np
import pytest
from bodies import computed, words

from taichi_disk.experiments.computation import error_estimate
from taichi_disk.experiments.computation.diagnostics import BlowUp
from taichi_disk.experiments.computation.error_estimate import richardson
from taichi_disk.experiments.scenes import load_scene
from tests.validation.hard_cases import HARD_RESET

# friction holds points, whose number depends on the step
HELD = words("""
    exponential_wall lattice.points=58 lattice.seed=3290 wall.friction=0.6
    impact.velocity=0.017432537234003606 impact.angle=-1.2053025128894208
    material.eta_star=0 wall.a=114.41203024444383 wall.V0=57.206015122206914
""")
# the step crosses more than a quarter of the wall's decay length
CROSSED = words("""
    exponential_wall lattice.points=316 lattice.seed=9002 material.eta_star=0
    impact.velocity=0.09243455696132839 impact.angle=0.289942393455374
    lattice.hole=0.3881259104443627 wall.a=1761.1271665782585 wall.V0=880.5635832891293
""")
SMALL = words("exponential_wall lattice.points=30 lattice.seed=1 material.eta_star=0")
HARD = (*SMALL, "wall.a=3000", "wall.V0=1500", "impact.velocity=0.1")


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize(
    "others",
    [[0.02], [0.007], [0.007, 0.0035]],
    ids=["longer", "shorter", "half and quarter"],
)
def test_the_estimate_is_exact_where_the_error_is_a_power_of_the_step(order, others):
    runs = [(dt, 0.9 + 3.0 * dt**order) for dt in (0.014, *others)]
    assert richardson(0.014, runs, order) == pytest.approx(3.0 * 0.014**order, rel=1e-5)


def test_two_results_that_agree_do_not_hide_a_third_one():
    assert richardson(
        1.0, [(1.0, 0.5), (0.5, 0.5), (0.25, 0.6)], order=1
    ) == pytest.approx(0.4)


def truth(kernels, *settings):
    """Return e with steps so short that the error, of order 4, is below 1e-7."""
    fine = ("time.integrator=takahashi_imada", "time.safety=0.05")
    scenario, outcome = computed(kernels, *settings, *fine, estimate=False)
    return scenario.result(outcome.series)["restitution"]


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param(HELD, id="friction holds points"),
        pytest.param(CROSSED, id="a step crosses much of the wall"),
    ],
)
def test_every_result_has_an_estimate_that_holds_where_errors_are_no_power_of_the_step(
    settings, kernels
):
    # With a step ratio of 1.25 and order 2, the errors were 9 and 1.9 times as large.
    scenario, outcome = computed(kernels, *settings)
    found = error_estimate.measured(scenario, outcome.series)
    errors = outcome.summary["error_estimate"]
    assert next(iter(errors)) == "restitution"
    assert set(errors) == set(found)
    assert "vibration_left" in errors
    fine = (
        f"time.dt={outcome.summary['dt'] / 16}",
        f"time.integrator={outcome.summary['integrator']}",
    )
    scenario, outcome = computed(kernels, *settings, *fine, estimate=False)
    exact = error_estimate.measured(scenario, outcome.series)
    true = {name: abs(found[name] - value) for name, value in exact.items()}
    for name, error in true.items():
        assert error <= errors[name] + 1e-13, name
    # nor are the estimates much too large
    assert errors["restitution"] < 10.0 * true["restitution"]
    assert errors["contact_time"] < 15.0 * true["contact_time"]


def test_the_estimate_of_contact_time_holds_if_half_the_rows_agree_by_chance(kernels):
    # If every other row is left out, the contact time changes by an eighth of its
    # error; if two of three rows are left out, by nine times its error.
    settings = words("""
        exponential_wall lattice.points=100 lattice.seed=4606 impact.velocity=0.005391
        wall.a=167.3 wall.V0=83.65 impact.turn=-0.7813 impact.angle=-1.0415
        lattice.hole=0.345 material.eta_star=0
    """)
    scenario, outcome = computed(kernels, *settings)
    fine = (
        f"time.dt={outcome.summary['dt'] / 8}",
        f"time.sample_interval={scenario.row_interval / 8}",
    )
    _, closer = computed(kernels, *settings, *fine, estimate=False)
    error = abs(
        scenario.result(outcome.series)["contact_time"]
        - scenario.result(closer.series)["contact_time"]
    )
    assert error <= outcome.summary["error_estimate"]["contact_time"] < 8.0 * error


@pytest.mark.parametrize("spin", [0.0, 0.3])
def test_if_a_step_does_not_resolve_the_wall_the_estimate_is_half_the_worst_imbalance(
    spin, kernels
):
    # Relative to the kinetic energy K of the flight; with a spin, whose energy is part
    # of E, relative to sqrt(E K). In this step the disk crosses the wall's decay length
    # 1/a: Richardson's estimate times ERROR_SAFETY is three quarters of the true error.
    scenario, outcome = computed(
        kernels, *HARD, f"impact.spin={spin}", "time.dt=0.00327"
    )
    flight = 0.5 * 0.1**2
    whole = 0.5 * (scenario.velocities**2).sum() / 30
    lost = np.abs(outcome.series["total"] - outcome.series["total"][0]).max()
    estimate = outcome.summary["error_estimate"]["restitution"]
    assert estimate >= 0.499 * lost / np.sqrt(whole * flight)
    if spin == 0.0:
        e = scenario.result(outcome.series)["restitution"]
        assert abs(e - truth(kernels, *HARD)) <= estimate < 5e-3


def test_a_step_resolves_a_wall_if_it_crosses_less_than_half_its_decay_length():
    settings = ["wall.a=200", "wall.V0=50", "impact.velocity=0.08"]
    longest = load_scene("exponential_wall", settings).scenario().wall_step
    assert 0.9 < longest * 0.08 / (0.5 / 200) <= 1.0


def test_a_result_that_another_step_does_not_confirm_is_a_failure(kernels):
    # With a quarter of the step the disk goes through the wall.
    fast = words("""
        absorbing_wall lattice.points=20 lattice.seed=5 impact.velocity=0.3324
        wall.k_a=0.0547 wall.a=1047 wall.V0=523.7 wall.points=60 wall.width=3.6
        wall.threshold=0.3 wall.boundary=dashpot
    """)
    with pytest.raises(BlowUp, match=r"with \S+ R/c there is one.*gone through") as out:
        computed(kernels, *fast)
    assert out.value.last_good["positions"].shape == (80, 2)


def test_a_longer_step_that_fails_is_followed_by_a_shorter_one(kernels, monkeypatch):
    scene = (*SMALL, "time.safety=0.2")
    _, usual = computed(kernels, *scene)  # with a shorter step at once
    monkeypatch.setattr(error_estimate, "_other_steps", lambda run: [20 * run.step.dt])
    _, other = computed(kernels, *scene)
    assert other.summary["error_estimate"] == usual.summary["error_estimate"]


@pytest.mark.parametrize(
    "step", ["0.0015", pytest.param("auto", marks=pytest.mark.validate)]
)
def test_a_disk_that_comes_back_from_below_the_wall_has_no_result(step, kernels):
    # It flies on, as if it had bounced, so that its last state shows nothing.
    fast = words(f"""
        absorbing_wall lattice.points=33 lattice.seed=26 wall.k_a=0.0269
        impact.velocity=0.4475 wall.a=424.1 wall.V0=212 wall.points=99 wall.width=3.6
        wall.threshold=0.3 wall.boundary=pinned wall.contact=smooth time.dt={step}
    """)
    with pytest.raises(BlowUp, match="gone through the surface"):
        computed(kernels, *fast, estimate=False)


RESET_AT_THE_END = """
    absorbing_wall lattice.points=60 lattice.seed=5731 material.viscosity=0
    impact.velocity=0.009864 impact.angle=-0.4806 impact.spin=-0.02138
    impact.turn=-2.6732 wall.a=134.2 wall.V0=67.1 wall.points=180 wall.width=8
    wall.threshold=0.2867 wall.k_a=2.601 wall.boundary=reset
    wall.reset_interval=0.1527 wall.contact=springs
"""
BESIDE_A_SPIN = """
    exponential_wall lattice.points=149 lattice.seed=638941 material.eta_star=0
    impact.velocity=0.01479 impact.spin=0.1524 wall.a=72.56 wall.V0=36.28
"""


@pytest.mark.parametrize(
    ("scene", "exact"),
    [
        # by steps 32 and 64 times shorter; a run and two shorter ones agree to 7e-7
        (RESET_AT_THE_END, {"vibration_left": (0.01237946, 5.0)}),
        # by a step 30 times shorter; two runs agree to 4e-7 by chance
        (BESIDE_A_SPIN, {"vibration_left": (-0.00148189, 20.0)}),
        # by DOP853 at three tolerances; two runs claimed 2.3e-4 and 9.7e-6
        (
            f"absorbing_wall {HARD_RESET}",
            {"restitution": (0.895978, 5.0), "vibration_left": (0.043972, 10.0)},
        ),
    ],
    ids=["reset at the end", "beside a fast spin", "hard wall"],
)
def test_estimates_hold_where_runs_agree_by_chance(scene, exact, kernels):
    scenario, outcome = computed(kernels, *words(scene))
    found = error_estimate.measured(scenario, outcome.series)
    for name, (true, most) in exact.items():
        off = abs(found[name] - true)
        assert off <= outcome.summary["error_estimate"][name] < most * off
