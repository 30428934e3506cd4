"""taichi_disk from Python: the promises of the library."""

import inspect
import os
import pickle
import shutil
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import jedi
import numpy as np
import pytest
from programs import contents, printed_by, python, summary_in

import taichi_disk
from taichi_disk import (
    InputError,
    Lattice,
    Result,
    load_scene,
    load_sweep,
    mechanics,
    run,
    run_sweep,
)
from taichi_disk.base.machine import cores
from taichi_disk.experiments.computation.diagnostics import BlowUp
from taichi_disk.mechanics.lattice import OwnStart

pytestmark = pytest.mark.usefixtures("without_plots")
SMALL = {"lattice.points": 60, "material.eta_star": 0}
SCENE = load_scene("exponential_wall").with_(SMALL)


@pytest.fixture(scope="module")
def result():
    return run(SCENE, lattices=1)


def alone(scene=SCENE, *more, **options):
    """Run a scene on its own lattice, without a film."""
    return run(scene, *more, **{"video": False, "lattices": 1} | options)


def test_everything_in_all_is_there():
    for name in taichi_disk.__all__:
        assert getattr(taichi_disk, name) is not None
    assert sorted(taichi_disk.__all__) == dir(taichi_disk)
    assert "Simulation" in dir(mechanics)
    assert all(getattr(mechanics, name) for name in dir(mechanics))


def test_names_are_completed_before_anything_is_imported():
    program = jedi.Script("from taichi_disk import run\nrun('compression').")
    assert "standard_error" in {one.name for one in program.complete()}


@pytest.mark.validate
def test_a_type_checker_finds_a_name_that_does_not_exist(tmp_path):
    lines = "from taichi_disk import rnu\nfrom taichi_disk.mechanics import Latice"
    (tmp_path / "own.py").write_text(lines)
    done = python("-m", "mypy", tmp_path / "own.py", cwd=tmp_path)
    assert done.stdout.count("[attr-defined]") == 2, done.stdout


def test_states_are_those_of_the_time_series(result):
    series = result.series
    times, x, v = result.trajectory(series["t"][::20])
    assert x.shape == v.shape == (len(times), 60, 2)
    heights = x[:, :, 1].mean(axis=1)
    np.testing.assert_allclose(heights, series["com_y"][::20], rtol=1e-12)
    state = result.state(times[3])
    assert state.t == times[3]
    assert (state.positions == x[3]).all()
    assert (state.velocities == v[3]).all()


def test_a_field_is_that_of_its_state_and_at_points_has_a_value_for_each(result):
    strain = result.field("strain")  # of the greatest compression
    assert strain.on == "springs"
    x = result.greatest_compression.positions
    i, j = result.lattice.bonds.T
    expected = np.hypot(*(x[i] - x[j]).T) / result.lattice.rest_lengths - 1
    np.testing.assert_allclose(strain.values, expected, atol=1e-13)
    pressure = result.field("pressure", at="points")
    assert (pressure.on, pressure.values.shape) == ("points", (60,))
    assert result.field("pressure").on == "triangles"
    with pytest.raises(InputError, match="at: must be"):
        result.field("pressure", 1.0, at="springs")
    with pytest.raises(InputError, match="pressure"):
        result.field("presure", 1.0)
    with pytest.raises(AttributeError, match="it has restitution, contact_time"):
        _ = result.xi


def test_a_disk_is_pushed_hardest_and_stands_lowest_at_the_greatest_compression(result):
    state = result.greatest_compression
    heights = [x[:, 1].mean() for x in result.trajectory(result.series["t"][::5])[1]]
    assert state.positions[:, 1].mean() < min(heights) + 1e-3
    assert (state.positions == result.state(state.t).positions).all()


def test_the_time_series_is_a_table(result):
    table = result.dataframe()
    assert list(table) == list(result.series)
    assert (table["com_y"] == result.series["com_y"]).all()


def test_run_changes_keys_like_with_and_writes_nothing_unless_a_folder_is_named(
    result, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    changed = run(SCENE, velocity=0.03, lattices=1)
    assert changed.scene == SCENE.with_(velocity=0.03)
    assert all(seconds >= 0.0 for seconds in changed.summary["wall_clock"].values())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("keyword", "meant"),
    [
        ("eta", "material.eta_star"),
        ("velocit", "impact.velocity"),
        ("latices", "lattices"),
        ("overwite", "overwrite"),
        ("progres", "progress"),
    ],
)
def test_a_misspelt_keyword_of_run_is_answered_by_the_nearest_name(keyword, meant):
    answer = rf"^{keyword}: unknown (key|argument of run); did you mean {meant}\?$"
    with pytest.raises(InputError, match=answer):
        run("exponential_wall", **{keyword: 1})


def test_a_saved_result_loads_bitwise_and_its_summary_names_a_film(result, tmp_path):
    for array in (result.series["t"], result.positions, result.velocities):
        with pytest.raises(ValueError, match="read-only"):
            array -= array[0]
    result.save(tmp_path / "r")
    assert_same(Result.load(tmp_path / "r"), result)
    assert summary_in(tmp_path / "r")["restitution"] == result.restitution
    # the film of this scene that exists
    other = replace(result, summary=result.summary | {"video": "video.mp4"})
    for film in (None, "video.gif"):
        if film:
            (tmp_path / "r" / film).touch()
        other.save(tmp_path / "r")
        assert summary_in(tmp_path / "r")["video"] == film


def test_custom_velocities_are_thrown_and_saved_and_make_another_run(tmp_path):
    velocities = np.tile([0.01, -0.03], (60, 1))
    own = alone(SCENE, tmp_path / "own", velocities=velocities)
    plain = alone(SCENE.with_(velocity=0.03))
    # the wall is flat, and has no friction
    assert own.restitution == pytest.approx(plain.restitution, abs=1e-7)
    assert own.series["com_vx"][-1] == pytest.approx(0.01, rel=1e-12)
    again = Result.load(tmp_path / "own")
    for result in (own, again):  # one scene, which is the throw of the velocities
        assert result.scene.impact == result.scenario.scene.impact
        assert result.scene.impact.velocity == pytest.approx(np.hypot(0.01, 0.03))
        assert result.scene.impact.angle == pytest.approx(np.arctan2(0.01, 0.03))
    assert own.scene.time == own.scenario.scene.time
    assert_same(again, own)
    with pytest.raises(InputError, match=r"another run"):
        alone(SCENE, tmp_path / "own")


def test_a_slow_throw_keeps_all_digits_of_its_speed():
    slow = SCENE.with_(velocity=1e-4)
    faster = 1.000000001e-4
    thrown = slow.thrown_with(slow.body(), np.tile([0.0, -faster], (60, 1)))
    assert thrown.impact.velocity == pytest.approx(faster, rel=1e-12, abs=0)


@pytest.mark.parametrize(
    ("velocities", "message"),
    [
        ("fast", "array of real numbers"),
        (np.zeros((59, 2)), r"shape \(60, 2\), not \(59, 2\)"),
        (np.tile([np.nan, 0.0], (60, 1)), "numbers from -100 to 100 c"),
        (np.tile([0.0, 0.01], (60, 1)), r"must point down, .* not \+0\.01 c"),
        (np.tile([0.0, -100.1], (60, 1)), "numbers from -100 to 100 c"),
    ],
)
def test_velocities_that_do_not_fit_are_refused(velocities, message):
    with pytest.raises(InputError, match=f"velocities.* {message}"):
        alone(SCENE, velocities=velocities)


@pytest.mark.validate
def test_a_scene_takes_the_disk_of_a_lattice_that_has_a_wall():
    walled = load_scene("absorbing_wall").with_(SMALL | {"wall.points": 100})
    newton = {"lattice.points": 60, "compression.method": "newton"}
    pressed = load_scene("compression").with_(newton)
    over_wall = alone(pressed, lattice=walled.scenario().lattice)
    assert over_wall.xi == pytest.approx(alone(pressed).xi, rel=1e-9)


def test_titles_say_where_a_lattice_and_velocities_come_from(tmp_path):
    other = Lattice.disk(60, seed=5)
    np.savetxt(tmp_path / "points.csv", other.positions, delimiter=",")
    plain = SCENE.scenario()
    origins = {
        "seed 0": plain,
        "seed 5": SCENE.scenario(other),
        "custom lattice": SCENE.scenario(Lattice.from_points(other.positions)),
        "points.csv": SCENE.with_(file=str(tmp_path / "points.csv")).scenario(),
    }
    for origin, scenario in origins.items():
        assert scenario.words.title[-1] == f"N = 60    {origin}"
    own = OwnStart(None, np.tile([0.0, -0.05], (60, 1)))
    thrown = SCENE.scenario(own=own)
    assert thrown.scene.lattice.velocities == "none"
    assert thrown.stored_scene.lattice.velocities == "lattice.npz"
    pressed = load_scene("compression").with_({"lattice.points": 60})
    pressed = pressed.scenario(own=OwnStart(None, np.full((60, 2), 1e-3)))
    for scenario in (thrown, pressed):
        assert "own velocities" in scenario.words.title[1]
    assert "own velocities" not in plain.words.title[1]


def test_what_cannot_be_computed_as_given_is_refused(result, tmp_path):
    heavy = replace(result.lattice, masses=np.linspace(0.5, 1.6, 60) / 60)
    slow = np.tile([0.0, -1e-4], (60, 1))
    near = SCENE.with_({"impact.gap": 0.08})
    never = tmp_path / "never" / "never.png"
    refusals = {
        r"must add up to 1 M, not 1\.05": lambda: alone(lattice=heavy),
        "from_points": lambda: alone(lattice=result.lattice.positions),
        "ax: must be axes of Matplotlib": lambda: result.draw(ax=3),
        "sweep: must be what load_sweep returns, not None": lambda: run_sweep(
            None, "x"
        ),
        "export: needs a folder": lambda: alone(export="xyz"),
        "lattices: must be a whole number .* not True": lambda: alone(lattices=True),
        r"out: impact\.velocity=0\.1 looks like a change": lambda: alone(
            SCENE, "impact.velocity=0.1"
        ),
        "overwrite: must be True or False, not 'no'": lambda: alone(overwrite="no"),
        "video: must be True or False, not 'no'": lambda: result.save(
            tmp_path, video="no"
        ),
        r"impact\.gap.* exceeds 1e-3": lambda: alone(near, velocities=slow),
    }
    for message, act in refusals.items():
        with pytest.raises(InputError, match=message):
            act()
    for name, most in (("lattices", 10_000), ("threads", cores())):
        for count in (0, -1, 2.5, "8", most + 1):
            text = f"{name}: must be a whole number from 1 to {most:,}, .*not {count!r}"
            with pytest.raises(InputError, match=text):
                alone(**{name: count})
    for frames in (0, -1, 2.5, 10**12):
        with pytest.raises(InputError, match="frames: must be a whole number"):
            result.export("never.xyz", frames=frames)
    for compare in (3, [3], "result"):
        with pytest.raises(InputError, match="compare: must be a result of run"):
            result.film(never, compare=compare)
    with pytest.raises(InputError, match="5 runs side by side: compare 4 at most"):
        result.film(never, compare=[result] * 4)
    assert list(tmp_path.iterdir()) == []


ONE_NUMBER = """
from taichi_disk import InputError, load_scene, run
scene = load_scene("exponential_wall").with_(points=20)
try:
    first = run(scene, threads=-1, lattices=1)
except InputError:
    first = run(scene, lattices=1)
run(scene.with_(eta_star=0), lattices=1)
again = run(scene, threads=cores, lattices=1)
try:
    run(scene, threads=1 if cores > 1 else 2, lattices=1)
except InputError as error:
    assert first.state(1.0).positions.tobytes() == again.state(1.0).positions.tobytes()
    print(error)
"""


@pytest.mark.validate
def test_the_threads_of_a_process_are_chosen_once_and_all_its_results_live_on():
    code = ONE_NUMBER.replace("cores", str(cores()))
    printed = printed_by("-c", code)
    assert "this process already computes with" in printed or cores() == 1


@pytest.mark.parametrize("number", ["1", "0", "-1", "many", ""])
@pytest.mark.validate
def test_the_environment_says_how_many_threads_where_nobody_else_does(number):
    code = (
        "from taichi_disk.base import engine, runtime; runtime.start();"
        " print(engine.ti.cfg.cpu_max_num_threads)"
    )
    done = python("-c", code, env=os.environ | {"TAICHI_DISK_THREADS": number})
    if number == "1":
        assert done.stdout == "1\n"
    else:
        assert done.stdout == ""
        assert "TAICHI_DISK_THREADS: must be a whole number from 1 to" in done.stderr


# ---- progress


@pytest.mark.parametrize(
    ("kind", "keys", "stages"),
    [
        ("exponential_wall", {"impact.velocity": 2e-3}, ["simulate", "estimate"]),
        # an equilibrium has no time step
        ("compression", {"compression.method": "newton"}, ["simulate"]),
    ],
)
@pytest.mark.validate
def test_a_progress_callback_gets_every_stage_from_its_start(
    kind, keys, stages, tmp_path
):
    calls = []

    def progress(*what):
        calls.append(what)

    scene = load_scene(kind).with_({"lattice.points": 60} | keys)
    done = alone(scene, tmp_path / "o", progress=progress, lattices=2)
    assert [calls.pop(), calls.pop()] == [("lattices", 1, 1), ("lattices", 0, 1)]
    assert list(dict.fromkeys(stage for stage, _, _ in calls)) == stages
    assert calls[0][1] == 0
    for name in stages:
        times = [now for stage, now, _ in calls if stage == name]
        assert times == sorted(times)
        assert times[-1] <= calls[-1][2]
    calls.clear()
    Result.load(tmp_path / "o", progress=progress)
    assert calls[0] == ("simulate", 0, calls[0][2])
    assert done.numbers


@pytest.mark.parametrize("progress", [3, "bar", lambda done: None, object(), []])
def test_a_progress_of_another_shape_is_refused_by_name(result, progress, tmp_path):
    name = getattr(progress, "__name__", type(progress).__name__)
    message = (
        rf"progress: must be a function of \(stage, done, total\), which {name} is not"
    )
    sweep = load_sweep({"scene": "exponential_wall", "sweep": {"seed": [0]}})
    for call in (
        lambda: run(result.scene, tmp_path / "o", progress=progress, lattices=1),
        lambda: result.film(tmp_path / "o.mp4", progress=progress),
        lambda: run_sweep(sweep, tmp_path / "o", progress=progress),
    ):
        with pytest.raises(InputError, match=message):
            call()
    assert not list(tmp_path.iterdir())


def test_a_progress_callback_may_not_compute_and_spoils_nothing(result):
    calls = [
        lambda: run(other, lattices=1),
        lambda: result.state(1.0),
        lambda: result.film("never.mp4"),
    ]
    refused = []
    scene = SCENE.with_(velocity=2e-3)
    other = SCENE.with_(points=30)
    expected = alone(scene).restitution

    def curious(stage, done, total):
        for call in calls:
            with pytest.raises(InputError, match="a progress callback cannot run"):
                call()
            refused.append(done)

    assert alone(scene, progress=curious).restitution == expected
    assert len(refused) >= len(calls)
    with pytest.raises(InputError, match="a progress callback cannot run"):
        alone(scene, progress=lambda stage, done, total: run(other))
    assert alone(scene).restitution == expected


def test_a_lattice_file_gives_what_the_lattice_gives(tmp_path):
    def stored(seed):
        positions = Lattice.disk(60, seed).positions
        np.savetxt(
            file, positions, delimiter=",", header="x,y", comments="", fmt="%.17g"
        )
        return Lattice.from_points(positions)

    def removes(stage, done, total):
        copy.unlink(missing_ok=True)

    file = tmp_path / "points.csv"
    copy = tmp_path / "copy.csv"
    lattice = stored(3)
    scene = tmp_path / "s.yaml"
    scene.write_text(
        "scene: exponential_wall\nlattice: {file: points.csv}\n"
        "material: {eta_star: 0}\n"
    )
    by_file = alone(load_scene(scene))
    by_array = alone(lattice=lattice)
    assert by_file.restitution == pytest.approx(by_array.restitution, rel=1e-12)
    assert by_file.lattice.disk_points == 60
    assert "points.csv" in " ".join(by_file.scenario.words.title)
    shutil.copy(file, copy)
    removed = alone(by_file.scene.with_(file=str(copy)), progress=removes)
    assert removed.summary["lattice_digest"] == by_file.summary["lattice_digest"]
    by_file.save(tmp_path / "r")
    stored(4)
    # the run has stored its lattice
    assert Result.load(tmp_path / "r").restitution == by_file.restitution
    with pytest.raises(InputError, match="holds another run"):
        alone(load_scene(scene), tmp_path / "r")


@pytest.mark.parametrize(
    "times",
    ["soon", [[1.0], [1.0, 2.0]], [], [2.0, 1.0], [-1.0], [1e9], [np.nan], [10**400]],
)
def test_times_outside_the_run_are_refused(result, times):
    with pytest.raises(InputError, match=r"no moment|times: must be ascending"):
        result.trajectory(times)


def test_a_moment_is_a_number_of_any_kind_or_a_word_at_every_door(result, tmp_path):
    contact = result.contact.first_sample
    moments = ("contact", contact, str(contact), np.array(contact), np.array([contact]))
    states = [result.state(moment) for moment in moments]
    result.export(tmp_path / "a.npz", times=["contact"])
    fields = [result.field("pressure", moment).values for moment in moments]
    times, *_ = result.trajectory(["contact", "end"])
    assert {times[0], *(state.t for state in states)} == {states[0].t}
    assert all((one == fields[0]).all() for one in fields)
    assert np.load(tmp_path / "a.npz")["t"].tolist() == [states[0].t]
    with pytest.raises(InputError, match="no moment soon: write greatest, contact, "):
        result.state("soon")


DISK = Lattice.disk(60, seed=3)
ELLIPSE = Lattice.from_points(DISK.positions * [1.1, 0.9])
STRAINED = Lattice.from_points(
    ELLIPSE.positions, ELLIPSE.bonds, ELLIPSE.rest_lengths * 1.002
)
RING = Lattice.disk(150, hole=0.3)
FACTORS = np.where(RING.bonds[:, 0] % 3, 1.0, 2.0)
NON_UNIFORM = Lattice.from_points(
    RING.positions, RING.bonds, stiffness=FACTORS, masses=1.0 + np.arange(150) % 2
)
THROWN = np.random.default_rng(0).normal(0.0, 1e-3, (60, 2)) + [0.002, -0.04]
OWN = {
    "strained": (
        "exponential_wall",
        {"impact.spin": 0.01},
        {"lattice": STRAINED, "velocities": THROWN},
    ),
    "walled": (
        "absorbing_wall",
        {"wall.points": 100},
        {"lattice": ELLIPSE, "velocities": THROWN},
    ),
    "pressed": ("compression", {"compression.method": "newton"}, {"lattice": STRAINED}),
    "non-uniform": (
        "absorbing_wall",
        {"wall.points": 200, "impact.spin": 0.01},
        {"lattice": NON_UNIFORM},
    ),
}


def assert_same(one, other):
    assert one.numbers == other.numbers
    assert one.series.keys() == other.series.keys()
    assert all(
        (one.series[name] == values).all() for name, values in other.series.items()
    )


def validated(*names):
    """Return the names, those of long checks with their mark."""
    return [
        pytest.param(name, marks=() if name in names else pytest.mark.validate)
        for name in OWN
    ]


@pytest.mark.parametrize("name", validated("strained", "walled"))
def test_scene_yaml_alone_repeats_a_run_with_custom_arrays_bitwise(tmp_path, name):
    kind, changes, own = OWN[name]
    scene = load_scene(kind).with_(changes)
    moved = tmp_path / "moved"
    first = alone(scene, tmp_path / "first", **own)
    (tmp_path / "first").rename(moved)  # a run needs only its folder
    before = contents(moved)
    stored = load_scene(moved / "scene.yaml")
    again = alone(stored, tmp_path / "again")
    in_place = alone(stored, moved)
    loaded = Result.load(tmp_path / "again", estimate=False)
    loaded.save(tmp_path / "saved")
    for other in (again, in_place, loaded):
        assert_same(first, other)
    for folder in ("moved", "again", "saved"):
        after = contents(tmp_path / folder)
        changed = {name for name in before if after[name] != before[name]}
        assert changed == {"summary.json"}  # its wall clock
    with pytest.raises(InputError, match="holds another run"):
        alone(scene, moved)


def test_a_result_that_is_not_the_stored_one_is_noticed(result, tmp_path, notices):
    result.save(tmp_path / "r")
    path = tmp_path / "r" / "scene.yaml"
    path.write_text(path.read_text().replace("points: 60", "points: 61", 1))
    other = Result.load(tmp_path / "r", estimate=False)
    assert "in summary.json: scene.yaml, summary.json or" in notices.messages[0]
    assert other.lattice.disk_points == 61


def test_a_lattice_that_is_not_the_run_s_any_more_is_noticed(tmp_path):
    alone(SCENE, tmp_path / "r", lattice=ELLIPSE)
    path = tmp_path / "r" / "lattice.npz"
    stored = dict(np.load(path))
    for changes in (
        {"rest_lengths": ELLIPSE.rest_lengths * 1.01},
        {"triangles": np.roll(ELLIPSE.triangles, 1, axis=1)},
        {"triangles": ELLIPSE.triangles[::-1]},
    ):
        np.savez(path, **{**stored, **changes})
        with pytest.raises(InputError, match="have changed since the run"):
            Result.load(tmp_path / "r")


@pytest.mark.parametrize("name", validated("pressed"))
def test_a_pickled_result_has_its_series_and_states(name):
    kind, changes, own = OWN[name]
    result = alone(load_scene(kind).with_(changes), **own)
    copy = pickle.loads(pickle.dumps(result))
    assert_same(result, copy)
    for t in (0.3, 0.7):
        assert (result.state(t).positions == copy.state(t).positions).all()


def test_a_blow_up_comes_back_from_another_process_too():
    failure = pickle.loads(pickle.dumps(BlowUp("bad", {"t": np.ones(1)})))
    assert str(failure) == "bad"
    assert failure.last_good["t"] == 1.0


def test_an_export_has_each_step_once_and_says_which(result, tmp_path, notices):
    last = float(result.series["t"][-1])
    result.export(tmp_path / "a.npz", times=[0.0, last])
    result.export(tmp_path / "b.npz", frames=9 * result.summary["steps"])
    assert len(np.load(tmp_path / "b.npz")["t"]) == result.summary["steps"] + 1
    assert not notices.messages
    result.export(tmp_path / "c.npz", times=[0.0, 0.3 * last])
    t = np.load(tmp_path / "c.npz")["t"]
    times = f"t = {t[0]:.6g}, {t[1]:.6g} R/c"
    nearest = f"the states are those of the nearest steps, at {times}"
    assert notices.messages == [nearest]
    result.export(tmp_path / "d.npz", times=t)
    assert len(notices.messages) == 1
    result.export(tmp_path / "e.npz", times=0.9 * last * np.linspace(0.1, 1.0, 7))
    first = ", ".join(f"{t:.6g}" for t in np.load(tmp_path / "e.npz")["t"][:5])
    assert notices.messages[1].endswith(f"steps, at t = {first}, … R/c")


@pytest.mark.parametrize(
    ("path", "message"),
    [
        *((one, "must be a path, not ") for one in (5, b"x", ["x"], 1.5)),
        ("a\0.png", r"a path has no null characters, as 'a\\x00"),
    ],
)
def test_anything_but_a_path_is_refused_as_a_path(result, path, message):
    for act in (
        result.save,
        result.film,
        result.export,
        Result.load,
        lambda out: alone(SCENE, out),
    ):
        with pytest.raises(InputError, match=message):
            act(path)


def test_messages_in_python_name_arguments(result, tmp_path, monkeypatch):
    result.save(tmp_path / "r")
    scenario = replace(result.scenario, scene=result.scene.with_(velocity=0.03))
    other = replace(result, scenario=scenario)
    (tmp_path / "file").touch()
    monkeypatch.chdir(tmp_path)
    again = r"overwrite=True replaces it\); choose another folder as `out`"
    for act, path, message in (
        (other.save, "r", again),
        (other.save, ".", "name a folder in it as `out`"),
        (other.save, "file/r", "choose another as `out`"),
        (Result.load, "nothing", "no run is here"),
    ):
        with pytest.raises(InputError, match=message) as refusal:
            act(path)
        assert "--" not in str(refusal.value)
    (tmp_path / "r" / "summary.json").write_text("{}")
    with pytest.raises(InputError, match=r"no summary\.json that can be read"):
        Result.load("r")


@pytest.mark.parametrize(
    "function", [run, run_sweep, Result.load, Result.film, Result.export, Result.save]
)
def test_defaults_can_be_pickled_as_caches_of_functions_do(function):
    for parameter in inspect.signature(function).parameters.values():
        assert pickle.loads(pickle.dumps(parameter.default)) == parameter.default


# ---- threads, at the end, because Taichi starts anew for them


def results_of_threads():
    """Return what four threads compute of two scenes."""
    with ThreadPoolExecutor(4) as threads:
        return list(threads.map(results_of_scene, range(4)))


def results_of_scene(k):
    scene = load_scene("exponential_wall", ["lattice.points=30"])
    result = run(scene.with_(eta_star=10 * (k % 2)), lattices=1)
    state = result.state(5.0)
    moved = result.trajectory([1.0, 4.0])[1]
    return result.restitution, state.positions.tobytes(), moved.tobytes()


def test_threads_that_compute_different_scenes_have_the_results_of_one():
    assert results_of_threads() == 2 * [results_of_scene(k) for k in (0, 1)]


@pytest.mark.validate
def test_threads_may_be_the_first_that_compute_in_a_process():
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = pool.submit(results_of_threads).result()
    assert there == 2 * [results_of_scene(k) for k in (0, 1)]
