"""What the sandbox shows is what `run` computes, also after going back."""

import numpy as np
import pytest

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.computation.contact import apexes
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.simulation.observables import ENERGY_INDICES, INDEX
from taichi_disk.sandbox import history
from taichi_disk.sandbox.app import list_presets
from taichi_disk.sandbox.graphs import curve_values
from taichi_disk.sandbox.sandbox import Sandbox, with_key

SMALL = ["lattice.points=120", "impact.velocity=0.05", "material.eta_star=1"]
EXPLICIT = ["material.eta_star=0", "time.integrator=velocity_verlet"]
ROUGH = [*SMALL, "material.eta_star=0", "impact.angle=0.8", "wall.friction=0.4"]
HARD = [*SMALL, "wall.a=30000"]  # needs a second attempt with a shorter step
WALL = [*SMALL[:2], "wall.points=160", "wall.threshold=0.11"]


def opened(kernels, settings=SMALL, scene="exponential_wall"):
    return Sandbox(load_scene(scene, settings))


@pytest.fixture
def sandbox(kernels):
    return opened(kernels)


def computed(scene):
    """What `run` computes, and its primary result."""
    scenario = scene.scenario()
    outcome = compute(scenario)
    return outcome, scenario.primary(outcome.series)[1]


def to_the_end(sandbox):
    sandbox.paused = False
    for _ in range(3000):
        sandbox.advance(0.237)  # no whole number of steps or rows
        if sandbox.paused:
            return
    raise AssertionError("the scene does not end")


def into_contact(sandbox):
    sandbox.paused = False
    while sandbox.time.display.row[INDEX["elastic"]] < 1e-4:
        sandbox.advance(0.05)


# ---- what is seen is what run computes


@pytest.mark.parametrize(
    ("scene", "settings"),
    [
        ("exponential_wall", SMALL),
        pytest.param("exponential_wall", HARD, marks=pytest.mark.validate),
        pytest.param("exponential_wall", ROUGH, marks=pytest.mark.validate),
        pytest.param("absorbing_wall", WALL, marks=pytest.mark.validate),
        pytest.param("compression", SMALL[:1], marks=pytest.mark.validate),
    ],
)
def test_a_result_is_a_run_s_to_the_bit_also_after_going_back(kernels, scene, settings):
    sandbox = opened(kernels, settings, scene)
    seen = 0.0
    sandbox.speed = 3.0
    sandbox.paused = False
    while not sandbox.paused:
        sandbox.advance(0.237)
        # no picture goes back, not even where a shorter step is tried
        assert sandbox.time.display.t >= seen
        seen = sandbox.time.display.t
    assert sandbox.time.segment.control.attempt > 1 or settings is not HARD
    columns = sandbox.time.segment.columns
    outcome, expected = computed(load_scene(scene, settings))
    assert sandbox.results[-1].value == expected
    assert not sandbox.time.display.segment.label
    assert all(np.array_equal(columns[name], outcome.series[name]) for name in columns)

    spacing = max(np.diff([one.t for one in sandbox.time.checkpoints]))
    start = sandbox.time.checkpoints[0].t
    for part in (0.8, 0.37, 0.0):
        sandbox.scrub(part * seen)
        past = sandbox.time.display
        assert abs(past.t - max(part * seen, start)) <= spacing
        t, x, v = next(outcome.replay(np.array([past.t])))
        assert t == pytest.approx(past.t, abs=1e-12)
        assert np.array_equal(past.x, x)
        assert np.array_equal(past.v, v)
        sandbox.pause()  # go on from there
        assert sandbox.time.display.t == past.t
        assert sandbox.time.checkpoints[-1].t == past.t  # later ones are forgotten
        assert np.array_equal(sandbox.time.display.row, past.row)
        sandbox.speed = 1e6
        # the scene ends at its row, however fast the machine
        sandbox.advance(1.0, max_seconds=60.0)
        assert sandbox.paused
        end = outcome.series["t"][-1]
        assert sandbox.time.display.t == pytest.approx(end, rel=1e-15)
        assert {one.value for one in sandbox.results} == {expected}
        columns = sandbox.time.segment.columns
        assert np.array_equal(columns["com_vy"], outcome.series["com_vy"])


def test_a_throw_that_is_drawn_becomes_the_scene_s_and_the_next_hit_s(sandbox):
    sandbox.throw()  # nothing has been drawn
    assert sandbox.starts == 1
    sandbox.aim(0.3, -0.4)
    assert sandbox.drawn_throw == (0.025, pytest.approx(np.arctan2(0.3, 0.4), abs=1e-3))
    assert sandbox.scene.impact.angle == 0.0
    sandbox.throw()
    velocity = sandbox.time.display.v[: sandbox.scene.lattice.points].mean(axis=0)
    assert velocity == pytest.approx([0.015, -0.02], rel=2e-3)
    assert sandbox.drawn_throw is None
    assert sandbox.at_start
    sandbox.aim(-1.0, 0.5)  # not up, but along the wall
    assert sandbox.drawn_throw[1] == -1.5
    sandbox.drawn_throw = None
    sandbox.paused = False
    sandbox.advance(1.0)
    sandbox.aim(1.0, -1.0)  # it moves
    assert sandbox.drawn_throw is None
    sandbox.set("impact.angle", -0.4)
    sandbox.hit_again()
    velocity = sandbox.time.segment.present.v.mean(axis=0)
    down = -0.025 * np.array([np.sin(0.4), np.cos(0.4)])
    assert velocity == pytest.approx(down, rel=1e-9)


def test_a_saved_scene_gives_what_was_seen_of_a_disk_turned_by_hand(sandbox, tmp_path):
    before = sandbox.time.display.x
    sandbox.turn(1.0, final=False)
    # the angle is from where the disk was, not from the last call
    sandbox.turn(0.7, final=False)
    shown = sandbox.time.display.x
    sandbox.turn(0.7)
    spoke = [complex(*(x[0] - x.mean(axis=0))) for x in (before, shown)]
    assert np.angle(spoke[1] / spoke[0]) == pytest.approx(0.7, abs=1e-6)
    assert sandbox.at_start
    assert not sandbox.time.display.segment.label
    # Turned, the disk feels the wall at another height, and is dented a little.
    shift = sandbox.time.display.x - shown
    across, up = shift.mean(axis=0)
    assert abs(across) < 1e-12
    assert abs(up) < 0.01
    np.testing.assert_allclose(shift - [across, up], 0.0, atol=1e-6)
    sandbox.turn(3.0)
    sandbox.set("material.eta_star", 3.0)
    to_the_end(sandbox)
    (tmp_path / "scene.yaml").write_text(sandbox.scene.to_yaml(), encoding="utf-8")
    scene = load_scene(tmp_path / "scene.yaml")
    assert scene.impact.turn == pytest.approx(3.7 - 2 * np.pi, abs=1e-4)
    assert scene.material.eta_star == 3.0
    assert sandbox.results[-1].value == computed(scene)[1]
    assert sandbox.results[-1].turn == scene.impact.turn


# ---- time


def imbalance(sandbox):
    """Error of the energy balance since the segment began, over the energy in play."""
    segment = sandbox.time.segment
    error = float(segment.balance.imbalance(segment.row[None])[0])
    return abs(error) / segment.scenario.reference_energy


def test_time_passes_at_the_speed_asked_for_in_whole_steps(sandbox):
    assert sandbox.paused
    assert sandbox.advance(1.0) == 0
    sandbox.pause()
    sandbox.speed = 0.5
    sandbox.slow = True
    dt = sandbox.time.segment.step.dt
    start = sandbox.time.display.t
    steps = sum(sandbox.advance(1 / 60) for _ in range(30))
    assert sandbox.time.display.t - start == pytest.approx(steps * dt)
    assert abs(steps * dt - 0.25) <= dt
    sandbox.speed = 1e6
    assert 0 < sandbox.advance(1.0, max_seconds=0.0) < 1e6 / dt
    sandbox.speed = 0.5
    assert sandbox.advance(0.0) <= 1  # what could not be made is not owed


@pytest.mark.parametrize(("force", "expected"), [(1.2, 0.1), (0.8, 0.5)])
def test_slow_motion_begins_at_a_hundredth_of_a_hit_s_force(sandbox, force, expected):
    """A hit stops the momentum M v within about a time unit of the springs."""
    sandbox.pause()
    sandbox.slow = True
    sandbox.speed = 0.5
    segment = sandbox.time.segment
    springs = segment.scenario.model.springs
    velocity = -sandbox.time.display.row[INDEX["com_vy"]]
    steps = []
    for _ in range(60):  # until the pace has settled
        segment.row[INDEX["wall_force"]] = 0.01 * force * velocity / springs.time_unit
        steps.append(sandbox.advance(1 / 60))
    pace = np.mean(steps[-20:]) * segment.step.dt * 60
    assert pace == pytest.approx(expected, rel=0.15)


def test_states_are_remembered_evenly_beyond_a_run_s_time_limit(kernels, monkeypatch):
    monkeypatch.setattr(history, "MAX_STATES", 60)
    sandbox = opened(kernels, [*SMALL, "impact.max_time=5"])
    for eta_star in (1.0, 2.0):
        sandbox.set("material.eta_star", eta_star)
        for _ in range(4):
            sandbox.time.go(500, np.inf)
    times = np.array([one.t for one in sandbox.time.checkpoints])
    apart = np.diff(times)
    assert 60 > len(times) >= 29
    assert times[0] < 1.0
    assert 5.0 < sandbox.time.display.t < times[-1] + apart.max()
    # within a factor of two, but about the change and the scene's end
    is_apart = np.abs(np.log2(apart / np.median(apart))) > 1.01
    assert np.count_nonzero(is_apart) <= 4
    assert sandbox.time.checkpoints[0].segment is not sandbox.time.segment


def test_single_states_back_and_forth(sandbox):
    start = sandbox.time.display.t
    into_contact(sandbox)
    last = sandbox.time.display.t
    sandbox.step(-2)
    assert sandbox.time.display.t < last
    assert sandbox.paused
    assert sandbox.time.lead < 0.0
    sandbox.step(3)
    # beyond the last state time goes on
    assert sandbox.time.display.t > last
    assert sandbox.time.lead == 0.0
    sandbox.step(-1_000_000)
    assert sandbox.time.display.t == start


def test_a_disk_that_folds_is_warned_of_at_the_end_as_by_run(kernels):
    sandbox = opened(kernels, ["lattice.points=60", "impact.velocity=0.9"])
    assert not any("inside out" in text for text in sandbox.warnings)
    to_the_end(sandbox)
    (folds,) = [text for text in sandbox.warnings if "inside out" in text]
    outcome, _ = computed(sandbox.scene)
    assert folds in outcome.summary["warnings"]


# ---- changes by the user


def test_a_changed_viscosity_reaches_the_kernel_and_keeps_the_energy_balance(sandbox):
    into_contact(sandbox)
    x = sandbox.time.display.x
    before = sandbox.time.display.t
    program = sandbox.time.segment.simulation.program
    sandbox.set("material.eta_star", 1.5)
    assert np.array_equal(sandbox.time.display.x, x)
    assert sandbox.time.display.segment.label
    simulation = sandbox.time.segment.simulation
    assert simulation.program is program  # nothing was compiled
    assert simulation.model.springs.eta == 1.5 / 120  # eta = eta* m c/R, m = M/N
    to_the_end(sandbox)
    assert imbalance(sandbox) < 2e-4
    assert sandbox.results[-1].disturbance == "disturbed"
    assert "disturbed" in sandbox.answer
    sandbox.scrub(0.9 * before)
    sandbox.pause()  # to go on from before the change undoes it
    assert not sandbox.time.display.segment.label
    assert sandbox.scene.material.eta_star == 1.0


def test_another_wall_begins_anew_with_its_own_rows(sandbox):
    into_contact(sandbox)
    before = sandbox.time.segment.interval
    scene = sandbox.scene
    with pytest.raises(InputError, match=r"impact\.gap"):
        sandbox.set("impact.gap", 1e-6)
    assert sandbox.scene == scene  # what is refused changes nothing
    assert not sandbox.at_start
    sandbox.set("wall.a", 3000.0)
    scenario = sandbox.scene.scenario()
    driver = sandbox.time.segment
    assert driver.stride == max(1, round(scenario.row_interval / driver.step.dt))
    assert driver.interval < 0.5 * before
    assert sandbox.at_start
    assert sandbox.paused
    assert not sandbox.time.display.segment.label


def test_the_velocity_counts_before_the_start_and_later_from_the_next_hit(sandbox):
    sandbox.set("impact.velocity", 0.08)
    assert sandbox.time.display.row[INDEX["com_vy"]] == pytest.approx(-0.08, rel=1e-5)
    assert sandbox.at_start
    into_contact(sandbox)
    before = sandbox.time.display.v
    sandbox.set("impact.velocity", 0.03)
    assert np.array_equal(sandbox.time.display.v, before)
    assert "next hit" in sandbox.message
    sandbox.hit_again()
    assert sandbox.time.display.row[INDEX["com_vy"]] == pytest.approx(-0.03, rel=1e-12)
    to_the_end(sandbox)
    assert [one.disturbance for one in sandbox.results] == ["hit again"]
    assert 0.3 < sandbox.results[0].value < 1.5


def test_a_new_velocity_is_not_taken_for_that_of_the_hit_in_progress(sandbox):
    into_contact(sandbox)
    sandbox.set("impact.velocity", 0.01)
    sandbox.set("material.eta_star", 1.1)
    to_the_end(sandbox)
    (disturbed,) = sandbox.results
    assert disturbed.disturbance == "disturbed"
    assert disturbed.load == 0.05
    assert 0.9 < disturbed.value < 1.0
    assert disturbed.contact_time is None  # it began before


@pytest.mark.parametrize("is_pulled", [False, True])
def test_a_change_after_the_result_leaves_it_as_it_is(sandbox, is_pulled):
    to_the_end(sandbox)
    results = sandbox.results
    answer = sandbox.answer
    measured = sandbox.time.segment
    if is_pulled:
        sandbox.pull(0.0, 3.0)
        sandbox.advance(0.05)
        sandbox.release()
    sandbox.set("material.eta_star", 20.0)
    to_the_end(sandbox)
    assert sandbox.status == "disturbed"
    assert (sandbox.results, sandbox.answer) == (results, answer)
    assert sandbox.time.measured is measured
    sandbox.set("impact.velocity", 0.08)
    sandbox.hit_again()
    to_the_end(sandbox)
    (expected,) = results
    again = sandbox.results[-1]
    assert again.load == 0.08
    assert again.contact_time > 1.0
    sandbox.remove(-1.0)  # no row of the table
    sandbox.remove(2.0)
    assert sandbox.results == [expected, again]
    sandbox.remove(0.0)
    assert sandbox.results == [again]


def test_the_reach_of_the_contact_follows_a_softer_wall_and_a_slower_disk():
    scene = load_scene("absorbing_wall", [])
    for key, value in (("wall.a", 150.0), ("impact.velocity", 1e-3)):
        wider = with_key(scene, key, value)
        # V0 exp(-a l) is 1e-5 of v^2/2 there, or less.
        reach = wider.wall.V0 * np.exp(-wider.wall.a * wider.wall.threshold)
        assert 0.8e-5 < reach / (0.5 * wider.impact.velocity**2) <= 1e-5
    deeper = with_key(scene, "lattice.points", 2198)
    assert deeper.wall.points == 2 * 1269


def test_what_the_mouse_pulled_is_not_made_again_and_its_energy_no_imbalance(kernels):
    sandbox = opened(kernels, [*SMALL, *EXPLICIT])
    into_contact(sandbox)
    untouched = sandbox.time.display.t
    sandbox.pull(0.0, 2.2)
    assert sandbox.grip == int(sandbox.time.display.x[:, 1].argmax())
    for k in range(60):
        sandbox.pull(0.005 * k, 2.4)
        sandbox.advance(0.05)
    segment = sandbox.time.segment
    row = sandbox.time.display.row
    start = sandbox.time.checkpoints[0].row
    given = row[ENERGY_INDICES].sum() - start[ENERGY_INDICES].sum()
    assert given > 1e-5
    reference = segment.scenario.reference_energy
    assert imbalance(sandbox) * reference < 0.05 * given
    sandbox.release()
    assert sandbox.grip < 0
    assert sandbox.time.display.segment.label
    to_the_end(sandbox)  # a disk that was let go ends as any other
    assert imbalance(sandbox) < 2e-4
    assert sandbox.results[-1].disturbance == "disturbed"
    sandbox.scrub(untouched + 1.0)  # while the mouse pulled: it cannot pull again
    moment = sandbox.time.display
    sandbox.pause()
    assert sandbox.time.display.segment.label
    assert sandbox.time.display.t == moment.t
    assert np.array_equal(sandbox.time.display.x, moment.x)
    sandbox.scrub(0.9 * untouched)
    sandbox.pause()
    assert not sandbox.time.display.segment.label
    to_the_end(sandbox)
    for change in (lambda: sandbox.set("material.eta_star", 0.2), sandbox.hit_again):
        sandbox.pull(0.0, 9.0)  # time goes on, as for every change
        assert not sandbox.paused
        assert sandbox.advance(0.1) > 0
        assert sandbox.status == "disturbed"
        change()
        assert sandbox.grip < 0


def test_a_pulled_disk_moves_beside_another_as_it_does_alone(kernels):
    def pulled(*sandboxes):
        for k, one in enumerate(sandboxes):
            one.pause()
            one.pull(0.3, 2.4 + k)
        for _ in range(20):
            for one in sandboxes:
                one.advance(0.03, np.inf)
        return sandboxes[0].time.display.x

    alone = pulled(opened(kernels))
    assert np.array_equal(pulled(opened(kernels), opened(kernels)), alone)


def test_a_blow_up_is_told_and_any_change_gives_time_back(kernels):
    # A step set by the user that is stable until the wall pushes harder than estimated.
    hard = ["lattice.points=60", "impact.gap=0.1", "impact.velocity=0.1", "wall.a=3000"]
    sandbox = opened(kernels, [*EXPLICIT, *hard])
    limit = sandbox.time.segment.step.limit
    sandbox.begin(sandbox.scene.with_({"time.dt": 0.999 * limit}))
    for change in ("rewind", "start", "hit"):
        to_the_end(sandbox)
        assert "blow-up" in sandbox.message
        assert "back to the start" in sandbox.message
        assert np.isfinite(sandbox.time.display.x).all()
        sandbox.pause()
        assert sandbox.advance(1.0) == 0  # a meaningless state stays as it is
        if change == "hit":
            sandbox.hit_again()
            assert sandbox.time.segment.hit_began > 0.0
            continue
        if change == "rewind":
            sandbox.scrub(0.5 * sandbox.time.display.t)
        else:
            sandbox.begin()
        sandbox.pause()
        assert sandbox.advance(0.1) > 0
    assert not sandbox.paused


def test_presets_are_the_scenes_of_the_list_after_that_which_was_given():
    first = load_scene("compression", [])
    entries = list_presets(first)
    assert entries[0].load() == first
    assert len(entries) == len(list_presets(None))  # it is one of them
    kinds = {"compression", "exponential_wall", "absorbing_wall"}
    assert {one.load().scene for one in entries} == kinds


# ---- gravity


def test_a_disk_under_gravity_goes_on_bouncing_after_its_result(kernels):
    settings = ["lattice.points=30", "impact.bounces=2", "impact.gravity=1e-2"]
    sandbox = opened(kernels, settings, "bouncing_disk")
    outcome, e = computed(sandbox.scene)
    sandbox.paused = False
    sandbox.speed = 50.0
    while not sandbox.results:
        sandbox.advance(0.237)
    assert sandbox.results[0].value == e
    assert not sandbox.paused
    second = outcome.summary["restitution_2"]
    words = f"Bounce by bounce e: {e:.3f} {second:.3f}. Of the energy, "
    assert sandbox.answer.startswith(words)
    columns = outcome.series
    (top, _) = apexes(columns)
    for rows, known in ((top, "e:"), (top + 1, f"e: {e:.3f}")):
        earlier = {name: values[:rows] for name, values in columns.items()}
        assert sandbox.time.segment.scenario.bounces(earlier) == known
    # the curves of the page hold all of the energy, with that of the height
    segment = sandbox.time.segment
    curves = curve_values(segment, segment.rows, sandbox.time.start.body.inertia)
    assert np.ptp(curves[:, :-2].sum(axis=1)) < 1e-4 * curves[:, 0].max()
    while sandbox.time.segment.now < 1.1 * outcome.series["t"][-1]:
        assert sandbox.advance(1.0)
    assert sandbox.status == "same as taichi-disk run"
    # Sent down from above it is faster at the wall than the scene's speed.
    sandbox.scrub(outcome.series["t"][-1])  # the same moment each time
    sandbox.hit_again()
    while len(sandbox.results) < 2:
        sandbox.advance(0.237)
    assert 0.7 < sandbox.results[1].value < 1.0
