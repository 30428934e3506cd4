"""The sandbox without its window: what is seen is what `run` computes, also after going
back; hands' work is marked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import control_of

import taichi_disk
from taichi_disk.computation.driver import Driver
from taichi_disk.computation.outcome import Outcome, compute
from taichi_disk.errors import InputError
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.observables import ENERGY_INDICES, INDEX
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.app import list_presets
from taichi_disk.window.history import MAX_STATES, Segment
from taichi_disk.window.sandbox import Experiment, Sandbox, with_key

SMALL = ["lattice.points=120", "impact.velocity=0.05", "material.eta_star=1"]
UNDAMPED = [*SMALL, "material.eta_star=0"]
ROUGH = [*UNDAMPED, "impact.angle=0.8", "wall.friction=0.4"]
HARD = [*SMALL, "wall.a=30000"]  # needs a second attempt with a shorter step
WALL = [
    "lattice.points=120",
    "impact.velocity=0.05",
    "wall.points=160",
    "wall.threshold=0.11",
]


def opened(
    kernels: KernelCache, settings: list[str] = SMALL, scene: str = "exponential_wall"
) -> Sandbox:
    return Sandbox(load_scene(scene, settings), kernels=kernels)


def computed(kernels: KernelCache, scene: Any) -> tuple[Outcome, float]:
    """What `run` computes, and its primary result."""
    scenario = scene.scenario()
    outcome = compute(scenario)
    return outcome, scenario.primary(outcome.series)[1]


def to_the_end(sandbox: Sandbox) -> None:
    sandbox.paused = False
    for _ in range(3000):
        sandbox.advance(0.237)  # no whole number of steps or rows
        if sandbox.paused:
            return
    raise AssertionError("the scene does not end")


def into_contact(sandbox: Sandbox) -> None:
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
def test_the_result_is_that_of_a_run_bit_for_bit_also_after_going_back(
    kernels: KernelCache, scene: str, settings: list[str]
) -> None:
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
    outcome, expected = computed(kernels, load_scene(scene, settings))
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
        assert np.array_equal(sandbox.time.display.row, past.row)
        sandbox.speed = 1e6
        # the scene ends at its row, however fast the machine
        sandbox.advance(1.0, max_seconds=60.0)
        assert sandbox.paused
        assert sandbox.time.display.t == pytest.approx(
            outcome.series["t"][-1], rel=1e-15
        )
        assert {one.value for one in sandbox.results} == {expected}
        assert np.array_equal(
            sandbox.time.segment.columns["com_vy"], outcome.series["com_vy"]
        )


@pytest.mark.validate
def test_a_state_on_display_keeps_its_velocities_when_a_shorter_step_is_tried(
    kernels: KernelCache,
) -> None:
    hard = [
        "lattice.points=60",
        "material.eta_star=0",
        "wall.a=3000",
        "impact.velocity=0.1",
    ]
    sandbox = opened(kernels, hard)
    first = sandbox.time.segment
    sandbox.speed = 3.0
    sandbox.paused = False
    while sandbox.time.segment is first:
        sandbox.advance(0.05, max_seconds=1.0)
    assert "computed again with a shorter step" in sandbox.message
    shown = sandbox.time.display
    assert sandbox.time.lead > 0.0
    assert shown.segment is first
    assert sandbox.time.segment.step.dt < 0.9 * first.step.dt
    shown_velocities = shown.v
    same = Driver(first.scenario, first.step, kernels)
    same.advance(steps=shown.snapshot.step)
    assert np.array_equal(shown_velocities, same.simulation.velocities())


def test_a_throw_that_is_drawn_becomes_the_scene_s_and_the_next_hit_s(
    kernels: KernelCache,
) -> None:
    sandbox = opened(kernels)
    sandbox.throw()  # nothing has been drawn
    assert sandbox.starts == 1
    sandbox.aim(0.3, -0.4)
    assert sandbox.drawn_throw == (0.025, pytest.approx(np.arctan2(0.3, 0.4), abs=1e-3))
    assert sandbox.scene.impact.angle == 0.0  # type: ignore[union-attr]
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
    assert velocity == pytest.approx(
        0.025 * np.array([-np.sin(0.4), -np.cos(0.4)]), rel=1e-9
    )


def test_a_run_of_a_saved_scene_gives_what_was_seen_of_a_disk_turned_by_hand(
    kernels: KernelCache, tmp_path: Path
) -> None:
    sandbox = opened(kernels)
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
    # Turned, the disk begins to feel the wall at another height, and is dented a
    # little.
    across, up = (sandbox.time.display.x - shown)[:120].mean(axis=0)
    n = 120
    assert abs(across) < 1e-12
    assert abs(up) < 0.01
    np.testing.assert_allclose(
        sandbox.time.display.x[:n] - [across, up], shown[:n], atol=1e-6
    )
    sandbox.turn(3.0)
    sandbox.set("material.eta_star", 3.0)
    to_the_end(sandbox)
    (tmp_path / "scene.yaml").write_text(sandbox.scene.to_yaml(), encoding="utf-8")
    scene: Any = load_scene(tmp_path / "scene.yaml")
    assert scene.impact.turn == pytest.approx(3.7 - 2 * np.pi, abs=1e-4)
    assert scene.material.eta_star == 3.0
    assert sandbox.results[-1].value == computed(kernels, scene)[1]
    assert sandbox.results[-1].turn == scene.impact.turn


@pytest.mark.validate
def test_a_row_of_the_table_tells_throws_of_different_lattices_apart(
    kernels: KernelCache,
) -> None:
    sandbox = opened(kernels)
    for seed in (3, 4):
        sandbox.set("lattice.seed", seed)
        to_the_end(sandbox)
    assert [one.seed for one in sandbox.results] == [3, 4]
    columns = (Path(taichi_disk.__file__).parent / "web" / "results.js").read_text(
        encoding="utf-8"
    )
    assert all(
        f"{name}: " in columns.split("const COLUMNS")[1].split(";")[0]
        for name in Experiment._fields
    )


# ---- time


def imbalance(sandbox: Sandbox) -> float:
    """Error of the energy balance since the segment began, over the energy in play."""
    segment = sandbox.time.segment
    error = float(segment.balance.imbalance(segment.row[None])[0])
    return abs(error) / segment.scenario.reference_energy


def test_time_passes_at_the_speed_asked_for_in_whole_steps_and_slowly_in_contact(
    kernels: KernelCache,
) -> None:
    sandbox = opened(kernels)
    assert sandbox.paused
    assert sandbox.at_start
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


@pytest.mark.parametrize(("force", "is_slow"), [(1.2, True), (0.8, False)])
def test_slow_motion_begins_at_a_hundredth_of_the_force_of_a_hit(
    kernels: KernelCache, force: float, is_slow: bool
) -> None:
    """A hit stops the momentum M v within about a time unit of the springs."""
    sandbox = opened(kernels)
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
    expected = 0.1 if is_slow else 0.5
    assert pace == pytest.approx(expected, rel=0.15)


@pytest.mark.validate
def test_many_states_are_remembered_evenly_also_across_changes(
    kernels: KernelCache,
) -> None:
    sandbox = opened(kernels, [*SMALL, "lattice.points=40", "time.dt=4e-3"])
    for eta_star in (1.0, 2.0):
        sandbox.set("material.eta_star", eta_star)
        for _ in range(12 * MAX_STATES // 500):
            sandbox.time.go(500, np.inf)
    times = np.array([one.t for one in sandbox.time.checkpoints])
    apart = np.diff(times)
    assert MAX_STATES > len(times) >= 600
    assert times[0] < 1.0
    assert sandbox.time.display.t - times[-1] < apart.max()
    # about the change and the scene's end
    assert np.count_nonzero(np.abs(apart - np.median(apart)) > 1e-9) <= 4
    assert sandbox.time.checkpoints[0].segment is not sandbox.time.segment


@pytest.mark.validate
def test_time_goes_on_after_the_scene_s_end_and_its_limit_and_back_from_there(
    kernels: KernelCache,
) -> None:
    settings = [
        "lattice.points=60",
        "material.eta_star=0",
        "time.safety=0.3",
        "impact.max_time=2.0",
    ]
    segment = Segment(control_of(load_scene("exponential_wall", settings)), kernels)
    start = segment.present
    assert segment.advance(steps=round(3.0 / segment.step.dt)) == "running"
    while segment.advance(steps=1000) == "running":
        pass
    assert segment.end
    over = segment.simulation.step_number
    expected = segment.end.vectors
    assert segment.advance(steps=100) == "finished"
    assert (segment.end.step, segment.simulation.step_number) == (over, over + 100)
    segment.back_to(start)
    assert segment.advance() == "finished"
    assert segment.end.step == over
    assert np.array_equal(segment.end.vectors, expected)


def test_single_states_back_and_forth(kernels: KernelCache) -> None:
    sandbox = opened(kernels)
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


# ---- changes by the user


def test_a_changed_viscosity_reaches_the_kernel_at_once_and_keeps_the_energy_balance(
    kernels: KernelCache,
) -> None:
    sandbox = opened(kernels)
    into_contact(sandbox)
    x = sandbox.time.display.x
    simulation = sandbox.time.segment.simulation
    sandbox.set("material.eta_star", 1.5)
    assert np.array_equal(sandbox.time.display.x, x)
    assert sandbox.time.display.segment.label
    assert sandbox.time.segment.simulation is simulation  # nothing was compiled
    assert simulation.model.springs.eta == 1.5 / 120  # eta = eta* m c/R, m = M/N
    to_the_end(sandbox)
    assert imbalance(sandbox) < 2e-4
    assert sandbox.results[-1].disturbance == "disturbed"
    assert sandbox.message.endswith(", disturbed")


def test_another_wall_begins_anew_with_its_own_rows(kernels: KernelCache) -> None:
    sandbox = opened(kernels)
    into_contact(sandbox)
    before = sandbox.time.segment.interval
    sandbox.set("wall.a", 3000.0)
    scenario = sandbox.scene.scenario()
    driver = sandbox.time.segment
    assert driver.stride == max(1, round(scenario.row_interval / driver.step.dt))
    assert driver.interval < 0.5 * before
    assert sandbox.at_start
    assert sandbox.paused
    assert not sandbox.time.display.segment.label


def test_the_velocity_counts_at_once_before_the_start_and_later_from_the_next_hit(
    kernels: KernelCache,
) -> None:
    sandbox = opened(kernels)
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


def test_a_new_velocity_is_not_taken_for_that_of_the_hit_in_progress(
    kernels: KernelCache,
) -> None:
    sandbox = opened(kernels)
    to_the_end(sandbox)
    expected = sandbox.results[-1]
    assert expected.contact_time and expected.contact_time > 1.0
    sandbox.set("impact.velocity", 0.01)
    sandbox.set("material.eta_star", 2.0)
    to_the_end(sandbox)
    disturbed = sandbox.results[-1]
    assert disturbed.disturbance == "disturbed"
    assert disturbed.load == expected.load
    assert disturbed.value == pytest.approx(expected.value, abs=0.02)
    assert disturbed.contact_time is None  # the contact was over before
    sandbox.hit_again()
    to_the_end(sandbox)
    again = sandbox.results[-1]
    assert again.load == 0.01 and again.contact_time and again.contact_time > 1.0


@pytest.mark.validate
def test_going_back_before_a_change_undoes_it(kernels: KernelCache) -> None:
    sandbox = opened(kernels)
    to_the_end(sandbox)
    expected = sandbox.results[-1].value
    sandbox.begin()
    into_contact(sandbox)
    there = sandbox.time.display.t
    sandbox.set("material.eta_star", 50.0)
    to_the_end(sandbox)
    assert sandbox.results[-1].value != expected
    assert sandbox.time.display.segment.label
    sandbox.scrub(0.9 * there)
    sandbox.pause()
    assert not sandbox.time.display.segment.label
    assert sandbox.scene.material.eta_star == 1.0
    to_the_end(sandbox)
    first, changed, last = sandbox.results
    assert (
        (first.value, first.disturbance)
        == (last.value, last.disturbance)
        == (
            expected,
            "",
        )
    )
    assert changed.disturbance == "disturbed"


def test_a_value_that_the_scene_refuses_changes_nothing(kernels: KernelCache) -> None:
    sandbox = opened(kernels)
    scene = sandbox.scene
    segment = sandbox.time.segment
    with pytest.raises(InputError, match=r"impact\.gap"):
        sandbox.set("impact.gap", 1e-6)
    assert sandbox.scene == scene
    assert sandbox.time.segment is segment


def test_the_reach_of_the_contact_follows_a_softer_wall_and_a_slower_disk() -> None:
    scene = load_scene("absorbing_wall", [])
    for key, value in (("wall.a", 150.0), ("impact.velocity", 1e-3)):
        wider: Any = with_key(scene, key, value)
        # V0 exp(-a l) is 1e-5 of v^2/2 there, or less.
        reach = wider.wall.V0 * np.exp(-wider.wall.a * wider.wall.threshold)
        assert 0.8e-5 < reach / (0.5 * wider.impact.velocity**2) <= 1e-5
    deeper: Any = with_key(scene, "lattice.points", 2198)
    assert deeper.wall.points == 2 * 1269


def test_what_the_mouse_pulled_cannot_be_made_again_and_its_energy_is_no_imbalance(
    kernels: KernelCache,
) -> None:
    sandbox = opened(kernels, UNDAMPED)
    into_contact(sandbox)
    untouched = sandbox.time.display.t
    sandbox.pull(0.0, 2.2)
    assert sandbox.grip
    assert sandbox.grip[0] == int(sandbox.time.display.x[:, 1].argmax())
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
    assert not sandbox.grip
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
    sandbox.pull(0.0, 9.0)  # time goes on, as for every change
    assert not sandbox.paused
    assert sandbox.advance(0.1) > 0
    assert sandbox.status == "disturbed"


@pytest.mark.parametrize("change", ["hit", "rewind", "start"])
def test_a_blow_up_is_told_and_any_change_gives_time_back(
    kernels: KernelCache, change: str
) -> None:
    # A step set by the user that is stable until the wall pushes harder than estimated.
    hard = [
        "lattice.points=60",
        "material.eta_star=0",
        "impact.velocity=0.1",
        "wall.a=3000",
        "impact.gap=0.1",
    ]
    sandbox = opened(kernels, hard)
    sandbox.begin(
        sandbox.scene.with_({"time.dt": 0.999 * sandbox.time.segment.step.limit})
    )
    to_the_end(sandbox)
    assert "blow-up" in sandbox.message
    assert "back to the start" in sandbox.message
    assert np.isfinite(sandbox.time.display.x).all()
    sandbox.pause()
    assert sandbox.advance(1.0) == 0  # a meaningless state stays as it is
    if change == "hit":
        sandbox.hit_again()
        assert sandbox.time.segment.hit_began > 0.0
    else:
        if change == "rewind":
            sandbox.scrub(0.5 * sandbox.time.display.t)
        else:
            sandbox.begin()
        sandbox.pause()
        assert sandbox.advance(0.1) > 0
    assert not sandbox.paused


# ---- scenes to step through


def test_presets_are_the_shipped_scenes_and_what_they_suggest() -> None:
    groups = list(dict.fromkeys(one.group for one in list_presets(None)))
    assert len(groups) == 4
    assert list_presets(None)[1].name == "Backspin"
    first = load_scene("compression", [])
    entries = list_presets(first)
    scenes = [one.load() for one in entries]
    assert scenes[0] == first
    assert {one.scene for one in scenes} == {
        "compression",
        "exponential_wall",
        "absorbing_wall",
    }
    assert len(entries) == 21
    assert all(one.name and one.sentence.endswith(".") for one in entries)


@pytest.mark.validate
def test_a_row_of_the_table_can_be_removed(kernels: KernelCache) -> None:
    sandbox = opened(kernels)
    row = Experiment._make([None] * len(Experiment._fields))
    sandbox.results = [row._replace(value=k) for k in range(3)]
    sandbox.remove(1.0)
    assert [one.value for one in sandbox.results] == [0, 2]
    sandbox.remove(-1.0)  # no row of the table
    sandbox.remove(2.0)
    assert [one.value for one in sandbox.results] == [0, 2]
