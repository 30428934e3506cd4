"""The files of a run: names, units, and all data to repeat it with another program."""

import errno
import os
import re
import signal
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
import reference
import yaml
from programs import contents, python, summary_in

from taichi_disk import Lattice, Result, load_scene, run
from taichi_disk.base import engine, files
from taichi_disk.base.errors import InputError
from taichi_disk.cli import main
from taichi_disk.mechanics.physics import ElasticWall, MatchedBoundary, Model, Springs
from taichi_disk.mechanics.simulation.observables import COLUMNS
from taichi_disk.runs.output import export

SMALL = ("lattice.points=100", "time.safety=0.3")
WALL = (*SMALL, "wall.points=120", "wall.width=3.2", "wall.boundary=dashpot")
ALWAYS = (
    "t,com_x,com_y,com_vx,com_vy,angular_momentum,lowest_y,wall_force,"
    "kinetic,elastic,wall,dissipated,absorbed,total"
)
SCENES = {
    "exponential_wall": SMALL,
    "absorbing_wall": WALL,
    "compression": (*SMALL, "compression.method=newton"),
}


FILES = {"scene.yaml", "summary.json", "timeseries.csv", "lattice.npz", "final.npz"}
PAGE = (Path(__file__).parents[2] / "docs/output.md").read_text(encoding="utf-8")
FULL = OSError(errno.ENOSPC, "No space left on device")
PLOT = "taichi_disk.runs.api.work.plot_run"


class Run(NamedTuple):
    """A finished run and its folder."""

    result: Any
    out: Path

    @property
    def summary(self):
        return summary_in(self.out)

    @property
    def table(self):
        names, *lines = (self.out / "timeseries.csv").read_text().splitlines()
        columns = np.loadtxt(lines, delimiter=",").T
        return dict(zip(names.split(","), columns, strict=True))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    import matplotlib  # noqa: F401 (then this process draws, which is patched)

    place = tmp_path_factory.mktemp("runs")
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        for kind, settings in SCENES.items():
            scene = load_scene(kind, settings)
            result = run(scene, place / kind, video=False, lattices=1)
            found[kind] = Run(result, place / kind)
            # to draw a plot takes longer than a run
            patch.setattr(PLOT, lambda path, *_: path.touch())
    return found


@pytest.fixture
def command(tmp_path, capsys):
    """Return a function that runs a small impact, for its status and output."""

    def ended(*words):
        options = ["--no-video", "--lattices=1", f"--out={tmp_path / 'o'}", *words]
        settings = [f"--set={one}" for one in SMALL]
        status = main(["run", "exponential_wall", *settings, *options])
        return status, *capsys.readouterr()

    return ended


@pytest.mark.parametrize("kind", SCENES)
def test_files_summary_and_columns_are_those_of_the_contract(runs, kind):
    stored_run = runs[kind]
    summary = stored_run.summary
    table = stored_run.table
    files = contents(stored_run.out)
    assert set(files) == {*FILES, "plot.png"}
    assert kind != "exponential_wall" or files["plot.png"][1:4] == b"PNG"
    written = yaml.safe_load(files["scene.yaml"])
    for name, section in stored_run.result.scene.sections().items():
        assert set(written[name]) == set(section.schema())  # with every default

    assert summary == stored_run.result.summary
    section = PAGE.partition("### summary.json")[2].partition("###")[0]
    assert set(summary) <= set(re.findall(r"`(\w+)`", section))
    assert summary["status"] == "done"
    assert summary["reason"] is None
    assert {"build", "simulate"} <= set(summary["wall_clock"])
    versions = {"python", engine.PACKAGE, "numpy", "taichi-disk"}
    assert versions <= set(summary["versions"])
    assert summary | stored_run.result.numbers == summary

    is_pressed = kind == "compression"
    more = ",load,xi" if is_pressed else ",translation,rotation,vibration"
    assert ",".join(table) == ALWAYS + more
    assert np.isfinite(list(table.values())).all()
    assert (np.diff(table["t"]) > 0).all()
    assert (table["t"][0] == 0.0) == (not is_pressed)
    parts = ("kinetic", "elastic", "wall", "dissipated", "absorbed", "sliding", "load")
    total = sum(table.get(part, 0.0) for part in parts)
    np.testing.assert_allclose(table["total"], total, rtol=1e-12)
    if not is_pressed:
        split = table["translation"] + table["rotation"] + table["vibration"]
        np.testing.assert_allclose(split, table["kinetic"], rtol=1e-12)


# key of summary.json: word of the cases below that have it
KEYS = {
    "scene status reason seed versions wall_clock date processor": "",
    "measured steps integrator error_estimate warnings video": "",
    "inverted_triangles": "",
    "dt dt_limit attempts error_source energy": "stepping",
    "restitution contact_time": "impact",
    "tangential_restitution spin_after normal_impulse": "oblique",
    "tangential_impulse": "friction",
    "xi xi_nominal xi_extrapolated": "compression",
    "residual roll": "newton",
    "lattices": "several",
    "lattice_digest": "own",
    "own_start": "python",
}
TINY = {"lattice.points": 30, "material.viscosity": 0.0091}
DISK = Lattice.disk(30, seed=2)
FALLING = np.tile([0.0, -0.03], (30, 1))
THROWN = "impact stepping"
RELAXATION = ("compression stepping", {"compression.method": "relaxation"}, {})
CASES = [
    (THROWN, {}, {}),
    (f"{THROWN} several", {}, {"lattices": 2}),
    (f"{THROWN} oblique", {"impact.angle": 0.4}, {}),
    (f"{THROWN} oblique", {"impact.spin": 0.01}, {}),
    (f"{THROWN} oblique friction", {"impact.angle": 0.4, "wall.friction": 0.2}, {}),
    (f"{THROWN} oblique several", {"impact.angle": 0.4}, {"lattices": 2}),
    ("compression newton", {"compression.method": "newton"}, {}),
    pytest.param(*RELAXATION, marks=pytest.mark.validate),
    (f"{THROWN} own python", {}, {"lattice": DISK}),
    (f"{THROWN} own python", {}, {"velocities": FALLING}),
    (f"{THROWN} own python", {}, {"lattice": DISK, "velocities": FALLING}),
    (f"{THROWN} own", {"lattice.file": "a.npz"}, {}),
    (f"{THROWN} own", {"lattice.velocities": "a.npz"}, {}),
    (f"{THROWN} own python", {"lattice.file": "a.npz"}, {"velocities": FALLING}),
]


@pytest.mark.parametrize(("words", "keys", "options"), CASES)
def test_each_key_is_there_under_its_condition(
    tmp_path, monkeypatch, words, keys, options
):
    monkeypatch.chdir(tmp_path)
    names = ("positions", "bonds", "rest_lengths", "masses")
    arrays = {name: getattr(DISK, name) for name in names}
    np.savez("a.npz", **arrays, velocities=FALLING)
    kind = "compression" if "compression" in words else "exponential_wall"
    scene = load_scene(kind).with_(TINY | keys)
    summary = run(scene, **{"lattices": 1, **options}).summary
    expected = set()
    for names, condition in KEYS.items():
        if condition in words:
            expected.update(names.split())
    assert set(summary) - {"notes"} == expected


def test_the_columns_are_described_as_they_are_declared():
    written = [column for column in COLUMNS if column.written != "never"]
    table = "".join(
        f"| `{column.name}` | {column.meaning} | {column.unit} |\n"
        for column in written
    )
    assert table in PAGE


def test_a_picture_that_fails_takes_no_result_with_it(tmp_path, monkeypatch, notices):
    def fails(*_):
        raise RuntimeError("latex could not be found")

    monkeypatch.setattr(PLOT, fails)
    monkeypatch.setattr("taichi_disk.pictures.render.film.draw_film", fails)
    # the process that would draw the plot
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    result = run(load_scene("exponential_wall", SMALL), tmp_path / "o", lattices=1)
    assert set(contents(tmp_path / "o")) == FILES
    summary = result.summary
    assert summary == summary_in(tmp_path / "o")
    assert summary["status"] == "done"
    for stage, key in {"film": "video_error", "plot": "plot_error"}.items():
        assert summary[key] == "latex could not be found"
        assert f"no {stage}: {summary[key]}" in notices.messages


KILLED = """
import os, signal, sys
from taichi_disk.cli import main
from taichi_disk.pictures.render import film
film.draw_film = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
main(sys.argv[1:])
"""


def test_a_run_is_printed_and_in_its_folder_before_its_film(tmp_path, monkeypatch):
    out = tmp_path / "o"
    settings = [f"--set={name}={value}" for name, value in TINY.items()]
    done = python(
        *("-c", KILLED, "run", "exponential_wall", "--lattices=1", "--out", out),
        *settings,
    )
    assert done.returncode == -signal.SIGKILL
    assert done.stdout.startswith("restitution e ")
    assert done.stdout.endswith(f"files in {out}\n")
    assert set(contents(out)) - {"plot.png"} == FILES
    assert summary_in(out)["status"] == "done"
    assert summary_in(out)["video"] is None

    def interrupted(*_):
        raise KeyboardInterrupt

    # what a killed process has not finished does not make the folder another's
    (out / ".host-1.new.video.mp4").touch()
    monkeypatch.setattr("taichi_disk.pictures.render.film.draw_film", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(load_scene("exponential_wall").with_(TINY), out, lattices=1)
    assert set(contents(out)) - {"plot.png"} == FILES
    assert summary_in(out)["status"] == "done"
    assert os.listdir(tmp_path) == ["o"]


@pytest.mark.validate
def test_an_export_that_fails_takes_no_result_with_it(tmp_path, monkeypatch, command):
    def fails(*_):
        raise FULL

    monkeypatch.setitem(export.FORMATS, "xyz", (".xyz", fails))
    status, printed, errors = command("--export=xyz")
    assert status == 1
    assert printed.startswith("restitution e ")
    assert "o/trajectory.xyz: No space left" in errors
    summary = summary_in(tmp_path / "o")
    assert summary["status"] == "done"
    assert "trajectory.xyz" in summary["export_error"]
    assert set(contents(tmp_path / "o")) == {*FILES, "plot.png"}


@pytest.mark.usefixtures("without_plots")
@pytest.mark.parametrize(
    ("name", "stays_full"),
    [
        ("final.npz", False),
        ("final.npz", True),
        ("timeseries.csv", False),
        ("summary.json", False),
    ],
)
def test_a_full_disk_takes_no_number_with_it(
    tmp_path, monkeypatch, command, name, stays_full
):
    written = files.atomic_write
    tried = []

    def full(path, writer):
        tried.append(path.name)

        def write(new):
            writer(new)
            if path.name == name or (stays_full and name in tried):
                raise FULL

        written(path, write)

    with monkeypatch.context() as patch:
        patch.setattr(files, "atomic_write", full)
        status, printed, errors = command()
    assert status == 1
    assert printed.startswith("restitution e ")
    assert errors.endswith(f"error: cannot write {name}: No space left on device\n")
    if name == "summary.json":
        assert list(tmp_path.iterdir()) == []
        assert "files in" not in printed
    else:
        summary = summary_in(tmp_path / "o")
        assert summary["status"] == "failed"
        assert stays_full or name in summary["reason"]
        assert str(summary["restitution"])[:6] in printed
        assert name not in contents(tmp_path / "o")
        # It may be repeated: the folder holds a run.
        assert command()[0] == 0


# arrays of lattice.npz, with their types and numbers of axes
ARRAYS = (
    "positions f2 bonds i2 rest_lengths f1 masses f1 disk_points i0 disk_surface i1"
    " triangles i2 origin U0 velocities f2 unloaded f2"
)
OF_WALLS = "wall_surface i1 wall_boundary i1 wall_impedance f2"


@pytest.mark.parametrize("kind", SCENES)
def test_the_npz_files_hold_the_arrays_of_the_contract(runs, kind):
    expected = ARRAYS
    if kind == "absorbing_wall":
        expected += f" {OF_WALLS}"
    for name, arrays in (
        ("lattice.npz", expected),
        ("final.npz", "positions f2 velocities f2 t f0"),
    ):
        with np.load(runs[kind].out / name) as file:
            found = {key: f"{one.dtype.kind}{one.ndim}" for key, one in file.items()}
        words = arrays.split()
        assert found == dict(zip(words[::2], words[1::2], strict=True))
    result = runs[kind].result
    with np.load(runs[kind].out / "final.npz") as file:
        assert np.array_equal(file["positions"], result.positions)
        assert np.array_equal(file["velocities"], result.velocities)
        assert file["t"] == result.series["t"][-1]


def test_lattice_npz_alone_repeats_the_run(runs):
    # An independent program uses only the file and the scene's parameters.
    stored_run = runs["absorbing_wall"]
    start = np.load(stored_run.out / "lattice.npz")
    final = np.load(stored_run.out / "final.npz")
    ends = start["positions"][start["bonds"]]
    lengths = np.hypot(*(ends[:, 0] - ends[:, 1]).T)
    np.testing.assert_allclose(lengths, start["rest_lengths"], rtol=0, atol=1e-13)
    assert (np.diff(start["positions"][start["wall_surface"], 0]) > 0).all()
    own = Model(
        Springs(1.0, 1e-3),
        ElasticWall(300.0, 150.0, 0.1),
        boundary=MatchedBoundary(start["wall_impedance"]),
    )
    plain = reference.Model(SimpleNamespace(**start), own)
    _, v = plain.solve(
        start["positions"], start["velocities"], (0.0, float(final["t"])), rtol=1e-8
    )[-1]
    assert stored_run.summary["restitution"] == pytest.approx(
        v[:100, 1].mean() / 0.02, abs=2e-5
    )


@pytest.mark.usefixtures("without_plots")
def test_a_run_keeps_its_outline_and_repeats_it_in_a_folder_that_moved(tmp_path):
    quick = {"video": False, "lattices": 1}
    drawing = tmp_path / "square.csv"
    drawing.write_text("0,0\n1,0\n1,1\n0,1\n")
    scene = load_scene("exponential_wall", [f"lattice.outline={drawing}", *SMALL])
    first = run(scene, tmp_path / "first", video=False)
    assert len(first.summary["lattices"]["restitution"]["values"]) == 8
    assert not first.summary["warnings"]

    def edit(stage, done, total):
        if stage == "lattices":
            drawing.write_text("0,0\n1,0\n1,2\n0,2\n")

    edited = run(scene, lattices=2, progress=edit)
    assert "seed 1: the file of the outline was" in edited.summary["warnings"][0]
    with pytest.raises(InputError, match="outline has changed since the run"):
        first.save(tmp_path / "saved")
    other = run(scene, tmp_path / "first", count_on=True, **quick)
    assert other.out.name == "first-2"
    assert other.restitution != first.restitution
    first.out.rename(tmp_path / "moved")
    again = run(load_scene(tmp_path / "moved/scene.yaml"), tmp_path / "moved", **quick)
    assert again.out.name == "moved"
    assert Result.load(again.out).restitution == first.restitution
    assert (again.positions == first.positions).all()
    assert (again.save(tmp_path / "saved") / "outline.csv").is_file()
