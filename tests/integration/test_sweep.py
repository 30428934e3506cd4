"""A row of a sweep is what `run` gives, whatever the order and the executor."""

import csv
import errno
import io
import json
import re
import shutil
import socket
import statistics
import sys
import threading
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, nullcontext, suppress

import numpy as np
import pytest
from filelock import FileLock
from programs import summary_in

from taichi_disk import Lattice, load_scene, load_sweep, run, run_sweep
from taichi_disk.base import engine
from taichi_disk.base.errors import InputError, SimulationError
from taichi_disk.cli import main
from taichi_disk.studies.sweep import executors, work

SMALL = """
scene: exponential_wall
lattice: {points: 60}
sweep: {eta_star: [0, 30], seed: [3, 4], velocity: [0.01, 0.02, 0.05]}
"""
WALL_STEPS = """
scene: absorbing_wall
lattice: {points: 40}
wall: {points: 50, width: 3.0, threshold: 0.2}
sweep: {dt: [auto, 0.002]}
"""
CRUSHED = """
scene: exponential_wall
lattice: {points: 60}
sweep: {seed: [3, 4], velocity: [0.02, 0.7]}
"""
pytestmark = pytest.mark.usefixtures("without_figures")  # that of `small` is enough
ONE = "scene: exponential_wall\nlattice: {points: 60}\nmaterial: {eta_star: 0.0}\n"


def swept(text, out, *settings, **options):
    """Compute the sweep `text` in this process."""
    return run_sweep(load_sweep(text, settings), out, jobs=1, **options)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return swept(SMALL, tmp_path_factory.mktemp("small") / "out")


def values_at(rows, name, **axes):
    """Return the numbers `name` at a place of the axes, one for each lattice."""
    return [
        float(row[name])
        for row in rows
        if all(float(row[axis]) == value for axis, value in axes.items())
    ]


def alone(result, row):
    """Return the summary of a run of a row's scene."""
    stored = load_scene(result.out / "points" / f"{row['key']}.yaml")
    return run(stored, lattices=1).summary


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "s.yaml").write_text(SMALL)
    return str(tmp_path / "s.yaml")


def table(folder):
    return (folder / "points.csv").read_bytes()


def points(folder):
    return sorted((folder / "points").glob("*.json"))


# ---- rows


def test_a_sweep_leaves_one_row_per_point_and_its_fits_and_figure(small):
    with (small.out / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12
    assert not small.failed
    assert [(row["eta_star"], row["seed"], row["velocity"]) for row in rows[:2]] == [
        ("0.0", "3", "0.01"),
        ("0.0", "3", "0.02"),
    ]
    assert all(abs(float(row["energy_imbalance"])) < 1e-3 for row in rows)
    summary = summary_in(small.out)
    assert [curve["eta_star"] for curve in summary["curves"]] == [0, 30]
    assert set(summary["curves"][1]["fits"]) == {"eq5", "eq4"}
    # The scatter over lattices, as a sample of them shows it.
    for curve in summary["curves"]:
        columns = (curve["x"], curve["mean"], curve["standard_deviation"])
        for v, mean, deviation in zip(*columns, strict=True):
            at = {"eta_star": curve["eta_star"], "velocity": v}
            e = values_at(rows, "restitution", **at)
            assert mean == pytest.approx(statistics.mean(e))
            assert deviation == pytest.approx(statistics.stdev(e))
    for kind in ("png", "svg", "pdf"):
        assert (small.out / f"figure.{kind}").stat().st_size > 5000


def test_a_sweep_without_a_figure_prints_fits(
    small, scene, tmp_path, monkeypatch, capsys
):
    def fail(diagram, out):
        raise SimulationError("cannot write figure.png: No space left on device")

    monkeypatch.setattr("taichi_disk.studies.figures.drawing.draw", fail)
    shutil.copytree(small.out / "points", tmp_path / "out" / "points")
    assert main(["sweep", scene, "--out", str(tmp_path / "out"), "--jobs", "1"]) == 1
    shown, notes = capsys.readouterr()
    assert "eq. (4) integrated" in shown
    assert "error: no figure: cannot write figure.png: No space left" in notes
    assert table(tmp_path / "out") == table(small.out)
    summary = summary_in(tmp_path / "out")
    assert summary["curves"][1]["fits"]["eq5"]["values"]["d1"] > 0.0


def test_a_row_is_what_running_its_scene_gives_bit_for_bit(small):
    for row in small.rows[::3]:
        summary = alone(small, row)
        shared = set(row) & set(summary)
        shared -= {"status", "reason", "warnings", "error_estimate"}
        assert {"steps", "integrator"} < shared
        assert len(shared) >= 4
        assert {name: row[name] for name in shared} == {
            name: summary[name] for name in shared
        }


@pytest.mark.parametrize(
    ("axes", "statuses", "reason"),
    [
        # In this short time, only the fast disk has left the wall.
        (
            "impact: {max_time: 30.0}\nsweep: {velocity: [0.003, 0.05]}",
            ["failed", "done"],
            "has not left the wall",
        ),
        ("sweep: {dt: [0.02, 0.5]}", ["done", "failed"], "stability limit"),
    ],
)
def test_failed_points_are_listed_tried_again_alone(axes, statuses, reason, tmp_path):
    result = swept(ONE + axes + "\n", tmp_path / "out")
    assert [row["status"] for row in result.rows] == statuses
    assert reason in result.failed[0]["reason"]
    assert reason in result.summary["failed"][0]["reason"]
    assert swept(ONE + axes + "\n", tmp_path / "out").summary["computed_now"] == 1


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (ZeroDivisionError("a\nb"), "unexpected ZeroDivisionError: a b"),
        (MemoryError(), "not enough memory"),
        (KeyError(), "unexpected KeyError: "),
    ],
)
def test_an_error_at_one_point_stops_no_other(error, reason, tmp_path, monkeypatch):
    compute = work.outcome_of

    def sometimes(scene, **options):
        if scene.impact.velocity == 0.05:
            raise error
        return compute(scene, **options)

    text = ONE + "sweep: {velocity: [0.05, 0.1]}\n"
    with monkeypatch.context() as patch:
        patch.setattr(work, "outcome_of", sometimes)
        result = swept(text, tmp_path / "out")
    assert [row["status"] for row in result.rows] == ["failed", "done"]
    assert result.failed[0]["reason"] == reason
    again = swept(text, tmp_path / "out")
    assert again.summary["computed_now"] == 1
    assert not again.failed


def test_a_number_that_is_not_finite_is_a_failure(tmp_path, monkeypatch):
    compute = work.outcome_of

    def unbalanced(scene, **options):
        outcome = compute(scene, **options)
        outcome.summary["energy"]["closing_imbalance"] = float("nan")
        return outcome

    monkeypatch.setattr(work, "outcome_of", unbalanced)
    (row,) = swept(ONE + "sweep: {velocity: [0.05]}\n", tmp_path / "out").rows
    assert row["reason"] == "energy_imbalance is not a finite number"


def test_errors_are_estimated_on_request_and_a_lattice_has_no_scatter(small, tmp_path):
    sweep = SMALL, tmp_path / "out", "sweep.velocity=[0.02, 0.05]", "sweep.seed=[3]"
    shutil.copytree(small.out, tmp_path / "out")
    plain = swept(*sweep)
    curves = plain.summary["curves"]
    assert [curve["standard_deviation"] for curve in curves] == [None, None]
    assert summary_in(tmp_path / "out")["curves"] == curves
    assert [row["error_estimate"] for row in plain.rows] == [None] * 4
    estimated = swept(*sweep, estimate=True)
    assert estimated.summary["computed_now"] == 4
    assert all(0 < row["error_estimate"] < 1e-2 for row in estimated.rows)
    for name in ("restitution", "steps"):
        assert values_at(estimated.rows, name) == values_at(plain.rows, name)
    assert swept(*sweep).summary["computed_now"] == 0


def test_points_of_other_versions_are_computed_anew(tmp_path, monkeypatch):
    sweep = ONE + "sweep: {velocity: [0.05]}", tmp_path / "out"
    assert [swept(*sweep).summary["computed_now"] for _ in range(2)] == [1, 0]
    here = executors.relevant_versions()
    assert {"taichi-disk", engine.PACKAGE, "numpy", "scipy"} == here.keys()
    module = sys.modules[run_sweep.__module__]
    for name in here:
        older = here | {name: "0.0.1"}
        monkeypatch.setattr(module, "relevant_versions", lambda older=older: older)
        assert [swept(*sweep).summary["computed_now"] for _ in range(2)] == [1, 0]
    assert len(points(tmp_path / "out")) == 5


def test_a_stored_point_is_read_as_strictly_as_a_scene(tmp_path):
    sweep = ONE + "sweep: {velocity: [0.05]}", tmp_path / "out"
    swept(*sweep)
    (file,) = points(tmp_path / "out")
    file.with_suffix(".yaml").unlink()  # which gives the row's numbers
    assert swept(*sweep).summary["computed_now"] == 1
    text = file.read_text()
    record = json.loads(text)
    numbers = record["numbers"]
    faults = {
        "status: must be done, not 'failed'": {"status": "failed"},
        "restitution: must be a finite number, not nan": {
            "numbers": numbers | {"restitution": np.nan}
        },
        "steps: must be a finite number, not '12'": {
            "numbers": numbers | {"steps": "12"}
        },
        "contact_time: must be a finite number, not None": {
            "numbers": {"restitution": 0.9}
        },
        "restitutoin: unknown; did you mean restitution?": {
            "numbers": numbers | {"restitutoin": 0.9}
        },
        "estimated: must be True or False": {"estimated": "no"},
        "unexpected keyword argument 'numbrs'": {"numbrs": {}},
    }
    for message, change in faults.items():
        file.write_text(json.dumps(record | change))
        with pytest.raises(InputError, match=re.escape(message)) as raised:
            swept(*sweep)
        assert str(file) in str(raised.value)
    half = text[: len(text) // 2]
    for unreadable in (half, f"[{text}]", "[" * 100_000, "\udcff\udcfe"):
        file.write_bytes(unreadable.encode("utf-8", "surrogateescape"))
        with pytest.raises(InputError, match=f"{file.name}.*delete the file"):
            swept(*sweep)
    file.write_text(text)
    assert swept(*sweep).summary["computed_now"] == 0


def test_a_lattice_file_is_read_again_if_it_has_changed(tmp_path):
    disk = Lattice.disk(60, 0)
    file = tmp_path / "points.csv"
    np.savetxt(file, disk.positions, delimiter=",", fmt="%.17g")
    scene = {
        "scene": "exponential_wall",
        "lattice": {"file": str(file)},
        "sweep": {"velocity": [0.05]},
    }
    (first,) = swept(scene, tmp_path / "out").rows
    assert first["status"] == "done"
    assert first["young"] is None
    turned = disk.positions @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    np.savetxt(file, turned, delimiter=",", fmt="%.17g")
    second = swept(scene, tmp_path / "out")
    assert second.summary["computed_now"] == 1
    assert second.rows[0]["restitution"] != first["restitution"]

    def edit(stage, done, total):
        np.savetxt(file, disk.positions, delimiter=",", fmt="%.17g")

    scene["sweep"]["velocity"] = [0.05, 0.06]
    with pytest.raises(InputError, match="changed during the sweep"):
        swept(scene, tmp_path / "out", progress=edit)
    assert len([*(tmp_path / "out/points").glob("*.json")]) == 2


THROWN = {"scene": "exponential_wall", "material": {"eta_star": 5}}


@pytest.mark.parametrize(
    ("scene", "result"),
    [
        (THROWN | {"impact": {"velocity": 0.1}}, "restitution"),
        ({"scene": "compression"}, "xi"),  # for which the free disk relaxes first
    ],
)
@pytest.mark.validate
def test_a_row_of_a_strained_lattice_is_what_running_its_scene_gives_at_any_k_b(
    scene, result, tmp_path
):
    disk = Lattice.disk(30, 0)
    file = tmp_path / "strained.npz"
    lengths = disk.rest_lengths * np.where(np.arange(len(disk.bonds)) % 2, 1.03, 0.97)
    np.savez(file, positions=disk.positions, bonds=disk.bonds, rest_lengths=lengths)
    swept_over = {"lattice": {"file": str(file)}, "sweep": {"k_b": [0.0, 300.0]}}
    found = swept(scene | swept_over, tmp_path / "out")
    for row in found.rows:
        summary = alone(found, row)
        assert row["status"] == "done"
        for name in ("dt", result):
            assert row[name] == summary[name]


# ---- what is there already


@pytest.mark.validate
def test_a_folder_of_a_run_or_of_a_person_is_not_touched(tmp_path):
    scene = load_scene(
        "compression", ["lattice.points=30", "compression.method=newton"]
    )
    run(scene, tmp_path / "run", video=False, lattices=1)
    with pytest.raises(InputError, match="holds a run"):
        swept(SMALL, tmp_path / "run")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "scene.yaml").write_text("# mine\n" + SMALL)
    with pytest.raises(InputError, match="File name too long"):
        swept(SMALL, tmp_path / ("x" * 300))
    with pytest.raises(InputError, match=r"scene\.yaml, which is not from a sweep"):
        swept(SMALL, tmp_path / "mine")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["scene.yaml"]
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="is a file"):
        swept(SMALL, tmp_path / "file")


def test_another_sweep_in_a_folder_keeps_its_points_and_says_that_its_table_is_replaced(
    tmp_path, notices
):
    for velocities, before in (
        ("[0.01]", False),
        ("[0.01]", True),
        ("[0.01, 0.03]", False),
    ):
        result = swept(ONE + f"sweep: {{velocity: {velocities}}}", tmp_path)
        # the figure of another table is removed with the table
        assert (tmp_path / "figure.svg").exists() == before
        (tmp_path / "figure.svg").touch()
    assert [text for text in notices.messages if "table" in text] == [
        f"{tmp_path} held another sweep: its points are kept, its table is replaced"
    ]
    assert result.summary["computed_now"] == 1


def test_a_sweep_over_steps_has_columns_for_the_asked_and_the_used_step(tmp_path):
    rows = swept(WALL_STEPS, tmp_path).rows
    assert [row["dt"] for row in rows] == ["auto", 0.002]
    # two of them fit between two resets
    assert rows[0]["dt_taken"] != rows[1]["dt_taken"] == 0.0015


def test_a_second_table_in_a_folder_in_use_is_refused_and_parts_are_not(tmp_path):
    one = ONE + "sweep: {velocity: [0.01, 0.02]}"
    other = ONE + "sweep: {velocity: [0.03]}"
    out = tmp_path / "out"
    (out / "points").mkdir(parents=True)
    (out / "points" / ".lock").touch()  # left by a killed process
    refused = []

    def meanwhile(stage, done, total):
        for scenes in (one, other):
            with pytest.raises(InputError, match="another sweep is writing") as refusal:
                swept(scenes, out)
            refused.append(str(refusal.value))
        swept(one, out, part="1/2")
        swept(other, out, part="1/1")

    result = swept(one, out, progress=meanwhile)
    assert len(refused) == 6
    assert all("--" not in text and str(out) in text for text in refused)
    assert (out / "scene.yaml").read_text() == result.sweep.to_yaml()
    assert len(table(out).splitlines()) == 3
    assert [path.name for path in (out / "points").glob(".*")] == [".lock"]
    assert swept(other, out).summary["computed_now"] == 0


@pytest.mark.parametrize("code", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_sweeps_go_on_where_there_are_no_locks(tmp_path, monkeypatch, notices, code):
    def refuse(self):
        raise OSError(code, "No locks available")

    monkeypatch.setattr(FileLock, "_acquire", refuse)
    assert not swept(ONE + "sweep: {velocity: [0.01]}", tmp_path).failed
    text = f"{tmp_path}: no lock is possible here (No locks available): let no other"
    assert any(text in message for message in notices.messages)


# ---- parts


def test_parts_are_gathered_with_nothing_computed_anew(small, tmp_path, notices):
    first = swept(SMALL, tmp_path / "a", part="1/2")
    assert notices.messages[0] == "6 scenes (part 1/2 of 12), 0 of them computed before"
    assert first.summary["computed_now"] == len(first.rows) == 6
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["points"]
    points(tmp_path / "a")[2].unlink()
    assert swept(SMALL, tmp_path / "a", part="1/2").summary["computed_now"] == 1
    swept(SMALL, tmp_path / "b", part="2/2")
    shutil.copytree(
        tmp_path / "b" / "points", tmp_path / "a" / "points", dirs_exist_ok=True
    )
    assert swept(SMALL, tmp_path / "a").summary["computed_now"] == 0
    assert table(tmp_path / "a") == table(small.out)


def test_every_scene_is_in_one_part_and_in_one_task_of_one_lattice():
    sweep = load_sweep("figure3")
    scenes = executors.ordered({str(k): scene for k, scene in enumerate(sweep.scenes)})
    tasks = executors.tasks_of(scenes)
    assert len(tasks) == 96
    assert sorted(key for task in tasks for key in task) == sorted(scenes)
    assert all(len({scenes[key].lattice.seed for key in task}) == 1 for task in tasks)
    shares = [executors.part_of(f"{k}/16", scenes) for k in range(1, 17)]
    assert [key for share in shares for key in share] == list(scenes)
    assert {len(share) for share in shares} == {36}
    # Each part has slow and fast, soft and stiff scenes: all take about as long.
    assert all(
        len({scene.impact.velocity for scene in share.values()}) > 8 for share in shares
    )


MALFORMED = [{"part": part} for part in ("0/4", "5/4", "1", "a/b", "1/2/3", "")]
MALFORMED += [{"jobs": jobs} for jobs in (0, -1, 1.5, "2")]


@pytest.mark.parametrize("options", MALFORMED)
def test_a_malformed_part_or_number_of_jobs_is_refused(options, tmp_path):
    message = "K/N"
    if "jobs" in options:
        message = (
            f"jobs: must be a whole number from 1 to 1,000, not {options['jobs']!r}"
        )
    with pytest.raises(InputError, match=message):
        run_sweep(load_sweep(SMALL), tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


# ---- executors


@pytest.mark.parametrize(
    ("points", "jobs", "started"),
    [(300, 1, None), (300, 2, 1), (300, 3, 2), (30_000, 1, None), (30_000, 2, 2)],
)
def test_a_sweep_computes_short_scenes_itself_too(points, jobs, started, monkeypatch):
    sweep = load_sweep("figure3", [f"lattice.points={points}"])
    scenes = {str(k): scene for k, scene in enumerate(sweep.scenes)}
    monkeypatch.setattr(executors, "Pool", nullcontext)  # stands for its size
    assert executors.executor_for(None, scenes, jobs, ExitStack()) == started


def test_other_versions_on_a_worker_are_refused(tmp_path, monkeypatch):
    here = executors.relevant_versions() | {
        engine.PACKAGE: "1.7.3",
        "taichi-disk": "0.0",
    }
    monkeypatch.setattr(executors, "relevant_versions", lambda: here)
    with (
        ThreadPoolExecutor(1) as threads,
        pytest.raises(InputError, match=r"has taichi-disk .* instead of 0\.0, taichi"),
    ):
        run_sweep(load_sweep(SMALL), tmp_path / "out", executor=threads)
    assert not points(tmp_path / "out")


def test_what_was_done_is_kept_when_the_workers_fail(small, tmp_path):
    class Failing(Executor):
        """Computes one task, then fails as a cluster may."""

        def __init__(self):
            self.calls = 0

        def submit(self, function, /, *arguments, **options):
            future = Future()
            self.calls += 1
            if self.calls == 1:
                future.set_result(function(*arguments))
            else:
                future.set_exception(OSError("connection lost"))
            return future

    with pytest.raises(SimulationError, match="connection lost"):
        run_sweep(load_sweep(SMALL), tmp_path / "out", executor=Failing())
    whole = {path.name: path.read_bytes() for path in points(small.out)}
    copied = {path.name: path.read_bytes() for path in points(tmp_path / "out")}
    assert copied
    assert copied.items() < whole.items()


HTTP = b"HTTP/1.1 400 Bad Request\r\n\r\n" * 10


@contextmanager
def answering(answer):
    """Yield the address of a server that is no scheduler."""
    connections = list[socket.socket]()

    def serve():
        with suppress(OSError):
            while True:
                connections.append(server.accept()[0])
                with suppress(OSError):
                    connections[-1].sendall(answer)

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=serve, daemon=True).start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
    for connection in connections:
        connection.close()


@pytest.mark.parametrize(
    "address",
    [
        nullcontext("tcp://127.0.0.1:9"),
        nullcontext("nonsense://x"),
        answering(b""),
        answering(HTTP),
        answering(b"\x01" + bytes(1000)),
    ],
    ids=("nobody", "nonsense", "mute", "http", "bytes"),
)
def test_an_address_without_a_scheduler_is_refused_soon(address, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "CONNECT_TIMEOUT", 0.3)
    began = time.monotonic()
    with address as at:
        no_answer = f"no Dask scheduler answers at {at}"
        with pytest.raises(InputError, match=no_answer):
            run_sweep(load_sweep(SMALL), tmp_path / "out", executor=at)
    assert time.monotonic() - began < 25.0
    assert list(tmp_path.iterdir()) == []


# ---- what a person sees


def test_the_command_says_how_many_scenes_and_prints_fits_and_where_the_files_are(
    small, scene, capsys
):
    assert main(["sweep", scene, "--out", str(small.out), "--jobs", "1"]) == 0
    shown, notes = capsys.readouterr()
    assert "note: 12 scenes, 12 of them computed before" in notes
    assert notes.count("eta_star = 30 is per point") == notes.count("per point") == 1
    assert "eta_star: 30, lattices per point: 2" in shown
    assert "eq. (4) integrated" in shown
    assert "12 points, 0 of them computed now, 0 failed" in shown
    assert f"files in {small.out}" in shown


def test_warnings_are_in_their_rows_and_counted_at_the_end(tmp_path, capsys):
    (tmp_path / "s.yaml").write_text(CRUSHED)
    command = f"sweep {tmp_path / 's.yaml'} --out {tmp_path / 'out'} --jobs 1"
    assert main(command.split()) == 0
    rows = list(csv.DictReader((tmp_path / "out" / "points.csv").open()))
    warned = ["turned inside out" in row["warnings"] for row in rows]
    assert warned == [float(row["velocity"]) > 0.5 for row in rows]
    (text,) = summary_in(tmp_path / "out")["warnings"]
    assert text.startswith("2 of 4 points have a warning, the first: ")
    assert f"warning: {text}" in capsys.readouterr().err


@pytest.mark.parametrize(("rim", "count"), [("true", 0), ("false", 1)])
def test_fits_of_literal_lattices_say_how_far_they_can_be_trusted(tmp_path, rim, count):
    sweep = {"velocity": [0.02, 0.03, 0.04], "seed": [0]}
    text = {"scene": "exponential_wall", "lattice": {"points": 30}, "sweep": sweep}
    summary = swept(text, tmp_path / "out", f"lattice.rim={rim}").summary
    assert summary["curves"][0]["fits"]
    assert sum("without a rim" in text for text in summary["warnings"]) == count


def test_any_result_is_drawn_against_any_axis(small):
    (axes,) = small.plot(x="velocity", y="contact_time").axes
    names = ("velocity  [c]", "contact time  [R/c]")
    assert (axes.get_xlabel(), axes.get_ylabel()) == names
    # names stand at the ends of curves
    names = [text.get_text() for text in axes.texts]
    assert sorted(names) == ["η* = 0", "η* = 30"]
    for eta_star, (line, *_) in zip([0.0, 30.0], axes.containers, strict=True):
        means = line.get_ydata(orig=False)
        for v, mean in zip((0.01, 0.02, 0.05), means, strict=True):
            at = {"eta_star": eta_star, "velocity": v}
            times = values_at(small.rows, "contact_time", **at)
            assert mean == pytest.approx(statistics.mean(times))
    (axes,) = small.plot(x="seed").axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("seed", "restitution e")
    with pytest.raises(InputError, match="x: angle is not swept; there are eta_star, "):
        small.plot(x="angle")
    with pytest.raises(InputError, match="y: no row has a number xi; there are "):
        small.plot(y="xi")


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        pytest.param({"x": "velocity"}, marks=pytest.mark.validate),
        pytest.param(
            {"x": "eta_star", "y": "contact_time"}, marks=pytest.mark.validate
        ),
    ],
)
def test_a_figure_cuts_no_label_off_whatever_is_changed(small, arguments):
    figure = small.plot(**arguments)
    axes = figure.axes[0]
    axes.set_xticks([axes.get_xlim()[1]], ["a long label"])
    axes.set_ylabel("two\nlines")
    figure.savefig(io.BytesIO())
    box = figure.get_tightbbox(figure.canvas.get_renderer())
    width, height = figure.get_size_inches()
    assert box.x0 >= 0.0
    assert box.y0 >= 0.0
    assert box.x1 <= width
    assert box.y1 <= height


# the last, because its threads let Taichi start anew
def test_any_executor_gives_the_same_bytes(small, tmp_path):
    with ThreadPoolExecutor(3) as threads:
        run_sweep(load_sweep(SMALL), tmp_path / "out", executor=threads)
    assert table(tmp_path / "out") == table(small.out)
