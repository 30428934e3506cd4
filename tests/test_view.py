"""The sandbox: what is seen is what `run` computes, and hands' work is accounted for."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taichi_disk.errors import InputError
from taichi_disk.render.camera import Camera
from taichi_disk.render.colouring import COLOURINGS, spring_values
from taichi_disk.runner import run
from taichi_disk.scene import AbsorbingWallScene
from taichi_disk.scene_file import load_scene
from taichi_disk.stiffness import spring_energy
from taichi_disk.view.controls import Controls
from taichi_disk.view.drawing import thinned
from taichi_disk.view.keys import Keys
from taichi_disk.view.mouse import Mouse
from taichi_disk.view.panel import WIDTH
from taichi_disk.view.sandbox import Sandbox
from taichi_disk.view.shots import Shots
from taichi_disk.view.stage import as_run, set_up, with_key

SMALL = ["lattice.points=120", "impact.velocity=0.05"]
WALL = [*SMALL, "wall.points=160", "wall.threshold=0.11"]


@pytest.fixture(scope="module", autouse=True)
def started(taichi: None) -> None:
    """The tests share the kernels that Taichi compiled."""


@pytest.fixture(scope="module")
def shared() -> Iterator[Sandbox]:
    sandbox = Sandbox(load_scene("exponential_wall", SMALL))
    yield sandbox
    sandbox.destroy()


@pytest.fixture
def sandbox(shared: Sandbox) -> Sandbox:
    """As it was at first: compiling anew for each test would take seconds."""
    shared.scene = load_scene("exponential_wall", SMALL)
    shared.speed, shared.paused, shared.message = 1.0, False, ""
    shared.restart()
    return shared


def to_the_end(sandbox: Sandbox) -> None:
    sandbox.paused = False
    for _ in range(2000):
        sandbox.advance(0.237)  # no whole number of steps or rows
        if sandbox.paused:
            return
    raise AssertionError("the scene does not end")


def mechanical_energy(sandbox: Sandbox) -> float:
    """Kinetic and elastic energy and that of the wall, m v^2/2 + k s^2/2 + V0 exp(-a y), in NumPy."""
    lattice, physics = sandbox.motion.setup.lattice, sandbox.motion.world.physics
    kinetic = 0.5 * float((lattice.masses[:, None] * sandbox.motion.velocities**2).sum())
    elastic = spring_energy(sandbox.motion.positions, lattice.bonds, lattice.rest_lengths, physics.k_a, physics.k_b)
    return kinetic + float(elastic) + float((physics.V0 * np.exp(-physics.a * sandbox.motion.positions[:, 1])).sum())


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("exponential_wall", SMALL),
        # Each compiles a scene of its own, twice.
        pytest.param("absorbing_wall", WALL, marks=pytest.mark.validate),
        pytest.param("compression", SMALL[:1], marks=pytest.mark.validate),
    ],
)
def test_run_computes_from_the_saved_scene_what_was_seen(tmp_path: Path, name: str, overrides: list[str]) -> None:
    seen = Sandbox(load_scene(name, overrides))
    seen.speed = 3.0
    to_the_end(seen)
    seen.save(tmp_path / "scene.yaml")
    columns, result = seen.motion.ledger.columns(), seen.result
    seen.destroy()
    computed = run(load_scene(tmp_path / "scene.yaml"), tmp_path / "out", video=False)
    assert result is not None
    for key, value in result.items():
        assert computed.headline[key] == value
    table = np.genfromtxt(tmp_path / "out" / "timeseries.csv", delimiter=",", names=True)
    for key in ("t", "com_y", "wall_force", "dissipated", "absorbed"):
        assert np.array_equal(table[key], columns[key]), key


def test_time_passes_at_the_speed_asked_for_in_whole_steps(sandbox: Sandbox) -> None:
    dt = sandbox.motion.step.dt
    sandbox.speed = 0.5
    steps = sum(sandbox.advance(1 / 60) for _ in range(30))
    assert sandbox.motion.ledger.t == pytest.approx(steps * dt)
    assert abs(steps * dt - 0.25) <= dt
    sandbox.paused = True
    assert sandbox.advance(1.0) == 0
    sandbox.single_step()
    assert sandbox.motion.ledger.t == pytest.approx((steps + 1) * dt)


def test_more_time_than_the_machine_can_make_is_cut_short(sandbox: Sandbox) -> None:
    sandbox.speed = 1e6
    assert 0 < sandbox.advance(1.0, patience=0.0) < 1e6 / sandbox.motion.step.dt
    assert sandbox._due <= 1.0  # what could not be made is not owed


def test_a_changed_viscosity_reaches_the_kernel_at_once_and_keeps_the_energy_balance(sandbox: Sandbox) -> None:
    sandbox.advance(0.05)
    while sandbox.motion.ledger.now()["elastic"] < 1e-4:
        sandbox.advance(0.05)
    place, world = sandbox.motion.positions.copy(), sandbox.motion.world
    sandbox.set("material.eta_star", 12.5)
    assert np.array_equal(sandbox.motion.positions, place) and sandbox.motion.changed
    assert sandbox.motion.world is world
    # eta = eta* m c/R and m = M/N
    assert world.fields["eta"].to_numpy().item() == pytest.approx(12.5 / 120, rel=1e-15)
    to_the_end(sandbox)
    assert abs(sandbox.motion.ledger.imbalance()) < 2e-4 * sandbox.motion.setup.kinetic


def test_energy_changes_by_hand_are_no_imbalance(sandbox: Sandbox) -> None:
    sandbox.set("material.eta_star", 0.0)
    sandbox.restart()
    while sandbox.motion.ledger.now()["elastic"] < 1e-4:
        sandbox.advance(0.05)
    energy, force = mechanical_energy(sandbox), sandbox.motion.ledger.now()["wall_force"]
    sandbox.set("wall.a", 200.0)  # left where it is, the disk would get 8 times its kinetic energy
    assert sandbox.motion.ledger.now()["wall_force"] == pytest.approx(force, rel=1e-9)
    assert sandbox.motion.ledger.given() == pytest.approx(mechanical_energy(sandbox) - energy, rel=1e-9)
    # The wall's potential is its force over a.
    assert sandbox.motion.ledger.given() == pytest.approx(force * (1 / 200 - 1 / 300), rel=1e-6)
    to_the_end(sandbox)
    sandbox.hit_again()
    assert sandbox.motion.ledger.now()["com_vy"] == pytest.approx(-0.05, rel=1e-12)
    to_the_end(sandbox)
    assert sandbox.result is not None and 0.5 < sandbox.result["restitution"] < 1.5
    assert abs(sandbox.motion.ledger.imbalance()) < 2e-4 * sandbox.motion.setup.kinetic


def test_the_velocity_changes_at_once_in_flight_and_from_the_next_hit_on_in_contact(sandbox: Sandbox) -> None:
    sandbox.advance(0.05)
    sandbox.set("impact.velocity", 0.08)
    assert sandbox.motion.ledger.now()["com_vy"] == pytest.approx(-0.08, rel=1e-12)
    while sandbox.motion.ledger.now()["elastic"] < 1e-4:
        sandbox.advance(0.05)
    before = sandbox.motion.velocities.copy()
    sandbox.set("impact.velocity", 0.03)
    assert np.array_equal(sandbox.motion.velocities, before) and "next hit" in sandbox.message
    sandbox.hit_again()
    assert sandbox.motion.ledger.now()["com_vy"] == pytest.approx(-0.03, rel=1e-12)


def test_the_pull_of_the_mouse_gives_the_energy_that_the_disk_gains(sandbox: Sandbox) -> None:
    sandbox.set("material.eta_star", 0.0)
    sandbox.restart()
    while sandbox.motion.flying_in:
        sandbox.advance(0.05)
    energy = mechanical_energy(sandbox)
    mouse = Mouse(sandbox)
    mouse.press(0.0, 2.2)
    top = int(sandbox.motion.positions[:, 1].argmax())
    assert mouse.tie is not None and np.hypot(*(mouse.tie[0] - sandbox.motion.positions[top])) < 0.2
    for k in range(60):
        mouse.move(0.005 * k, 2.4)
        sandbox.advance(0.05)
    mouse.release()
    given = sandbox.motion.ledger.given()
    assert mouse.tie is None and given > 1e-5
    # The rest is the leapfrog's wobble, (h omega)^2/8 of the energy of what shakes fastest.
    assert mechanical_energy(sandbox) - energy == pytest.approx(given, rel=0.05)
    sandbox.advance(0.1)
    assert sandbox.motion.ledger.given() == given and sandbox.motion.changed


def test_the_end_is_reached_from_where_the_mouse_let_go(sandbox: Sandbox) -> None:
    sandbox.set("material.eta_star", 0.0)
    sandbox.restart()
    motion = sandbox.motion
    while motion.ledger.now()["com_vy"] < 0.02:
        sandbox.advance(0.05)
    motion.tie(0, 1.0, 3.0)
    sandbox.advance(0.2)
    before = motion.ledger.imbalance()
    motion.let_go()
    sandbox.speed = 1e3  # past the end at once: it goes back to the last look, and stops where the scene ends
    sandbox.advance(1.0, patience=60.0)
    assert sandbox.result is not None
    # What is left is the wobble of a point that shakes: it falls with the square of the step.
    assert abs(motion.ledger.imbalance() - before) < 2e-3 * motion.scale


def test_a_turned_disk_is_as_far_from_the_wall_and_as_unloaded_as_before(sandbox: Sandbox) -> None:
    before, lattice = sandbox.motion.positions.copy(), sandbox.motion.setup.lattice
    assert sandbox.motion.flying_in
    mouse, middle = Mouse(sandbox), before.mean(axis=0)

    def beside(angle: float) -> tuple[float, float]:
        return float(middle[0] + 0.5 * np.cos(0.3 + angle)), float(middle[1] + 0.5 * np.sin(0.3 + angle))

    mouse.press(*beside(0.0))
    mouse.move(*beside(1.0))
    mouse.move(*beside(0.7))  # the angle is from where the disk was, not from the last call
    assert mouse.turning
    mouse.release()
    assert not mouse.holding
    after = sandbox.motion.positions
    i, j = lattice.bonds.T
    assert np.allclose(np.hypot(*(after[i] - after[j]).T), lattice.rest_lengths, rtol=1e-12)
    assert after[:, 1].min() == pytest.approx(before[:, 1].min(), abs=1e-14)
    spoke = [complex(*(x[0] - x.mean(axis=0))) for x in (before, after)]
    assert np.angle(spoke[1] / spoke[0]) == pytest.approx(0.7, abs=1e-12)
    to_the_end(sandbox)
    assert not sandbox.motion.flying_in


def test_a_blow_up_is_told_and_a_smaller_step_offered(sandbox: Sandbox) -> None:
    usual = sandbox.motion.step
    # The mouse's pull cannot be made again: a step that is too long then stays so.
    mouse = Mouse(sandbox)
    sandbox.advance(0.1)
    sandbox.motion.step = replace(usual, dt=3.0 * usual.limit)
    sandbox.motion._begin(sandbox.motion.world.physics)
    sandbox.motion.tie(0, 0.0, 1.0)
    for _ in range(50):
        sandbox.advance(0.5)
    assert "blow-up" in str(sandbox.motion.blown) or "finite" in str(sandbox.motion.blown)
    assert sandbox.paused and np.isfinite(sandbox.motion.positions).all()
    mouse.release()
    keys = Keys(Controls(sandbox, Path()))
    assert "m" in dict(keys.buttons())
    keys.press("space")
    assert sandbox.advance(1.0) == 0
    keys.press("m")
    assert sandbox.motion.step.dt == pytest.approx(0.5 * usual.dt) and not sandbox.motion.blown
    to_the_end(sandbox)


def test_a_step_that_blows_up_is_shortened_before_anyone_is_troubled(sandbox: Sandbox) -> None:
    usual = sandbox.motion.step
    sandbox.motion.step = replace(usual, dt=3.0 * usual.limit)
    sandbox.motion._begin(sandbox.motion.world.physics)
    to_the_end(sandbox)
    assert sandbox.motion.step.dt < usual.limit and not sandbox.motion.blown
    assert abs(sandbox.motion.ledger.imbalance()) < 2e-5 * sandbox.motion.scale


def test_a_hard_wall_is_met_again_with_a_step_that_closes_the_ledger(sandbox: Sandbox) -> None:
    sandbox.set("wall.a", 30000.0)
    sandbox.restart()
    dt = sandbox.motion.step.dt
    seen = 0.0
    sandbox.paused = False
    while not sandbox.paused:
        before = sandbox.motion.ledger.t
        sandbox.advance(0.05)
        seen = max(seen, before)
        # Made again, it comes back to the moment that was seen already, and only then goes on with the clock.
        assert sandbox.motion.ledger.t + sandbox.motion.behind >= seen - 1e-9
    assert sandbox.motion.step.dt < dt and not sandbox.motion.changed
    assert sandbox.saved_scene().time.dt == sandbox.motion.step.dt
    assert abs(sandbox.motion.ledger.imbalance()) < 2e-5 * sandbox.motion.scale
    assert sandbox.motion.ledger.worst() < 1e-4 * sandbox.motion.scale


def test_what_a_moving_disk_cannot_have_is_left_out_and_not_saved() -> None:
    settings = ["time.integrator=vefrl", "time.tolerance=1e-6", "material.eta_star=0", *SMALL]
    stage = set_up(load_scene("exponential_wall", settings))
    time = as_run(stage, stage.scene).time
    assert (time.integrator, time.tolerance, time.dt) == ("velocity_verlet", "none", stage.step.dt)


def test_the_reach_of_the_contact_follows_a_softer_wall_and_a_slower_disk() -> None:
    scene = load_scene("absorbing_wall", [])
    for key, value in (("wall.a", 150.0), ("impact.velocity", 1e-3)):
        assert scene.wall.threshold == 0.1
        wider = with_key(scene, key, value)
        # V0 exp(-a l) is 1e-5 of v^2/2 there, or less.
        reach = wider.wall.V0 * np.exp(-wider.wall.a * wider.wall.threshold)
        assert 0.8e-5 < reach / (0.5 * wider.impact.velocity**2) <= 1e-5
    assert with_key(scene, "lattice.points", 2198).wall.points == 2 * 1269


def test_a_value_that_the_scene_refuses_changes_nothing(sandbox: Sandbox) -> None:
    scene = sandbox.scene
    sandbox.set("impact.gap", 1e-6)
    assert sandbox.scene == scene and "impact.gap" in sandbox.message


def test_another_scene_keeps_the_lattice(sandbox: Sandbox) -> None:
    sandbox.switch("compression")
    assert sandbox.scene.scene == "compression" and sandbox.scene.lattice.points == 120
    sandbox.advance(0.5)
    assert sandbox.motion.ledger.now()["com_vy"] < 0.0
    sandbox.set("compression.pressure", 0.02)
    assert sandbox.motion.world.fields["load"].to_numpy().item() == 0.02


def test_a_scene_that_cannot_be_built_is_explained_and_the_old_one_goes_on(
    sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def refuse(scene: AbsorbingWallScene) -> None:
        asked.append(scene)
        raise InputError("the wall is too thin")

    monkeypatch.setattr("taichi_disk.view.stage.body_of", refuse)
    sandbox.switch("absorbing_wall")
    assert sandbox.scene.scene == "exponential_wall" and sandbox.message == "the wall is too thin"
    (scene,) = asked
    assert scene.lattice == sandbox.scene.lattice
    # As dense as the disk and no deeper than the shipped one, for its 1099 points.
    assert scene.wall.points == round(1269 * 120 / 1099)
    sandbox.scene = load_scene("exponential_wall", ["lattice.points=2000000"])
    sandbox.switch("absorbing_wall")  # which would need too many points
    assert sandbox.scene.scene == "exponential_wall" and "2000000" in sandbox.message
    sandbox.advance(0.2)
    assert sandbox.motion.ledger.t > 0.0


def test_a_scene_with_rows_closer_than_its_steps_can_be_saved(sandbox: Sandbox) -> None:
    sandbox.scene = load_scene("exponential_wall", [*SMALL, "time.sample_interval=1e-4"])
    sandbox.restart()
    assert sandbox.saved_scene().time.sample_interval == sandbox.motion.step.dt


def test_colours_show_strain_force_speed_and_energy(sandbox: Sandbox) -> None:
    stretch = 1.01 * sandbox.motion.positions
    sandbox.motion.positions = stretch
    lattice, physics = sandbox.motion.setup.lattice, sandbox.motion.world.physics
    state = lattice, physics, stretch, sandbox.motion.velocities
    strain, force, speed, energy = (spring_values(*state, one) for one in COLOURINGS)
    s = 0.01 * lattice.rest_lengths
    assert np.allclose(strain, 0.01)
    assert np.allclose(force, physics.k_a * s + physics.k_b * s**3)
    assert np.allclose(speed, 0.05)
    assert np.allclose(energy, 0.5 * 0.05**2 / 120)


def test_every_key_that_the_panel_names_does_something(sandbox: Sandbox, tmp_path: Path) -> None:
    controls = Controls(sandbox, tmp_path)
    keys = Keys(controls)

    def state() -> tuple[object, ...]:
        wishes = (controls.recording, controls.picture_wanted, controls.closing)
        shown = (controls.colouring_number, controls.show_number)
        built = (controls.points, controls.seed, sandbox.scene.scene)
        t = sandbox.motion.ledger.t
        return sandbox.scene, sandbox.speed, sandbox.paused, sandbox.message, t, wishes, shown, built

    for key in ("e", "d", "Up", "Down", "a", "z", "Left", "Right", "c", *dict(keys.buttons())):
        before = state()
        keys.press(key)
        assert before != state(), key
    assert (tmp_path / "view-1.yaml").exists()
    controls.set_log_eta(-1.0)
    assert sandbox.scene.material.eta_star == 0.0
    keys.press("F7")


@pytest.mark.parametrize("key", ["n", "k", "e", "d", "Up", "Down", "a", "z"])
def test_no_key_goes_the_other_way_from_beyond_its_range(key: str, tmp_path: Path) -> None:
    begins = ["material.eta_star=5000", "wall.a=30000", "wall.V0=15000", "impact.velocity=0.5", "lattice.points=60"]
    if key in ("d", "Down", "z"):
        begins = ["material.eta_star=0", "wall.a=5", "wall.V0=2.5", "impact.velocity=2e-4", "lattice.points=60"]
    controls = Controls(Sandbox(load_scene("exponential_wall", begins)), tmp_path)

    def numbers() -> tuple[float, ...]:
        scene = controls.sandbox.scene
        assert scene.scene == "exponential_wall"
        return controls.points, scene.material.eta_star, scene.impact.velocity, scene.wall.a

    before = numbers()
    Keys(controls).press(key)
    moved = np.sign(np.array(numbers()) - before)
    # From 60 points there are more and no fewer; all others stand beyond what this key moves to.
    assert list(moved) == [1.0 if key == "n" else 0.0, 0.0, 0.0, 0.0]


def test_the_page_on_the_window_names_every_key(sandbox: Sandbox) -> None:
    page = (Path(__file__).parents[1] / "docs" / "window.md").read_text()
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    named = [key for row in rows for key in re.findall("`(.+?)`", row)]
    assert sorted(named) == sorted(Keys(Controls(sandbox, Path()))._actions())


def test_more_points_and_another_lattice_are_built_at_once(sandbox: Sandbox) -> None:
    controls, seen = Controls(sandbox, Path()), sandbox.motion
    keys = Keys(controls)
    for key in "nnkl":
        keys.press(key)
    assert sandbox.motion is seen and controls.points == 200
    world = seen.world
    controls.build()  # once, whatever came before
    assert sandbox.motion.world is world  # nothing is compiled for another size
    assert sandbox.scene.lattice.points == len(sandbox.motion.positions) == 200
    assert sandbox.scene.lattice.seed == 1
    bonds = sandbox.motion.setup.lattice.bonds
    keys.press("l")
    controls.build()
    assert sandbox.scene.lattice.seed == 2 and not np.array_equal(sandbox.motion.setup.lattice.bonds, bonds)
    assert sandbox.motion.ledger.t == 0.0 and not sandbox.motion.changed


def test_of_a_fine_lattice_no_more_springs_are_drawn_than_a_core_can_draw(sandbox: Sandbox) -> None:
    lattice = sandbox.motion.setup.lattice
    drawn = thinned(lattice, 150)
    assert 75 < len(drawn.bonds) == len(drawn.rest_lengths) <= 150
    i, j = drawn.bonds.T
    assert np.allclose(np.hypot(*(lattice.positions[i] - lattice.positions[j]).T), drawn.rest_lengths)
    assert np.histogram(lattice.positions[i, 0], 4, (-1.0, 1.0))[0].min() > 10  # from everywhere
    assert np.array_equal(thinned(lattice, 1000).bonds, lattice.bonds)


def test_files_that_cannot_be_written_are_told_and_the_window_lives(sandbox: Sandbox, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    controls = Controls(sandbox, out)
    shots = Shots(controls, lambda: np.zeros((WIDTH + 60, 50, 4), np.float32))
    camera = Camera.fit(sandbox.motion.setup.view, 0, 0, 60, 50, 5)
    controls.record()
    shots.take(0.1, camera)
    (out / "view-1.mp4").write_text("another window's")  # there was none when the film was begun
    controls.record()
    shots.take(0.1, camera)
    assert (out / "view-1.mp4").read_text() == "another window's"
    assert "view-2.mp4" in sandbox.message and sorted(one.name for one in out.iterdir()) == ["view-1.mp4", "view-2.mp4"]
    shutil.rmtree(out)
    out.write_text("")
    for wish in (controls.want_picture, controls.record):
        wish()
        for _ in range(50):
            shots.take(0.1, camera)
        assert "write" in sandbox.message and not controls.recording
        sandbox.message = ""
    Keys(controls).press("w")
    assert "Not a directory" in sandbox.message
