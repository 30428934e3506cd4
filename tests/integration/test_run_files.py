"""The files of a run: names, columns and units, and all data to repeat it with another
program."""

from __future__ import annotations

import errno
import json
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
import reference

from taichi_disk import Lattice, engine, load_scene, run
from taichi_disk.cli import main
from taichi_disk.errors import SimulationError
from taichi_disk.output import export, files
from taichi_disk.physics import ElasticWall, MatchedBoundary, Model, Springs
from taichi_disk.simulation.observables import COLUMNS

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


class Run(NamedTuple):
    """A finished run and its folder."""

    result: Any
    out: Path

    @property
    def summary(self):
        return json.loads((self.out / "summary.json").read_text())

    @property
    def table(self):
        names, *lines = (self.out / "timeseries.csv").read_text().splitlines()
        return dict(
            zip(names.split(","), np.loadtxt(lines, delimiter=",").T, strict=True)
        )


@pytest.fixture(scope="module")
def runs(tmp_path_factory, drawn_plots):
    place = tmp_path_factory.mktemp("runs")
    return {
        kind: Run(
            run(load_scene(kind, settings), place / kind, video=False, lattices=1),
            place / kind,
        )
        for kind, settings in SCENES.items()
    }


@pytest.mark.parametrize("kind", SCENES)
def test_files_summary_and_columns_are_those_of_the_contract(runs, kind):
    stored_run = runs[kind]
    summary = runs[kind].summary
    table = runs[kind].table
    names = {path.name for path in stored_run.out.iterdir()}
    assert names == {
        "scene.yaml",
        "summary.json",
        "timeseries.csv",
        "lattice.npz",
        "final.npz",
        "plot.png",
    }
    assert (stored_run.out / "plot.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")

    assert summary == stored_run.result.summary
    page = (Path(__file__).parents[2] / "docs/output.md").read_text(encoding="utf-8")
    assert set(summary) <= set(
        re.findall(
            r"`(\w+)`", page.partition("### summary.json")[2].partition("###")[0]
        )
    )
    assert summary["status"] == "done"
    assert summary["reason"] is None
    assert {"build", "simulate"} <= set(summary["wall_clock"])
    assert {"python", engine.PACKAGE, "numpy", "taichi-disk"} <= set(
        summary["versions"]
    )
    assert all(
        summary[key] == value for key, value in stored_run.result.numbers.items()
    )

    assert ",".join(table) == ALWAYS + (
        ",load,xi" if kind == "compression" else ",translation,rotation,vibration"
    )
    assert np.isfinite(list(table.values())).all()
    assert (np.diff(table["t"]) > 0).all()
    assert (table["t"][0] == 0.0) == (kind != "compression")
    parts = ("kinetic", "elastic", "wall", "dissipated", "absorbed", "sliding", "load")
    np.testing.assert_allclose(
        table["total"], sum(table.get(part, 0.0) for part in parts), rtol=1e-12
    )
    if kind != "compression":
        split = table["translation"] + table["rotation"] + table["vibration"]
        np.testing.assert_allclose(split, table["kinetic"], rtol=1e-12)


# key of summary.json: word of the cases below that have it
KEYS = {
    "scene status reason seed versions wall_clock date processor": "",
    "measured steps integrator error_estimate warnings video": "",
    "inverted_triangles": "",
    "dt dt_limit attempts error_source energy": "stepping",
    "restitution contact_time": "impact",
    "tangential_restitution spin_after tangential_impulse normal_impulse": "oblique",
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
CASES = [
    (THROWN, {}, {}),
    (f"{THROWN} several", {}, {"lattices": 2}),
    (f"{THROWN} oblique", {"impact.angle": 0.4}, {}),
    (f"{THROWN} oblique", {"impact.spin": 0.01}, {}),
    (f"{THROWN} oblique several", {"impact.angle": 0.4}, {"lattices": 2}),
    ("compression newton", {"compression.method": "newton"}, {}),
    pytest.param(
        "compression stepping",
        {"compression.method": "relaxation"},
        {},
        marks=pytest.mark.validate,
    ),
    (f"{THROWN} own python", {}, {"lattice": DISK}),
    (f"{THROWN} own python", {}, {"velocities": FALLING}),
    (f"{THROWN} own python", {}, {"lattice": DISK, "velocities": FALLING}),
    (f"{THROWN} own", {"lattice.file": "a.npz"}, {}),
    (f"{THROWN} own", {"lattice.velocities": "a.npz"}, {}),
    (f"{THROWN} own python", {"lattice.file": "a.npz"}, {"velocities": FALLING}),
]


@pytest.mark.parametrize(("words", "keys", "options"), CASES)
def test_each_key_of_the_summary_is_there_under_its_condition(
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
    described = (Path(__file__).parents[2] / "docs/output.md").read_text(
        encoding="utf-8"
    )
    written = [column for column in COLUMNS if column.written != "never"]
    table = "".join(
        f"| `{column.name}` | {column.meaning} | {column.unit} |\n"
        for column in written
    )
    assert table in described


def test_a_picture_that_fails_takes_no_result_with_it(tmp_path, monkeypatch):
    def fails(*_):
        raise RuntimeError("latex could not be found")

    monkeypatch.setattr("taichi_disk.api.work.plot_run", fails)
    monkeypatch.setattr("taichi_disk.render.film.draw_film", fails)
    # the process that would draw the plot
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    result = run(load_scene("exponential_wall", SMALL), tmp_path / "o", lattices=1)
    stored_run = Run(result, tmp_path / "o")
    assert {path.name for path in stored_run.out.iterdir()} == {
        "scene.yaml",
        "summary.json",
        "timeseries.csv",
        "lattice.npz",
        "final.npz",
    }
    assert stored_run.summary["status"] == "done"
    assert stored_run.summary["video_error"] == "latex could not be found"
    assert stored_run.summary["warnings"] == [
        "there is no plot.png: latex could not be found"
    ]


@pytest.mark.validate
def test_an_export_that_fails_takes_no_result_with_it(tmp_path, monkeypatch, capsys):
    def fails(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setitem(export.FORMATS, "xyz", export.Format(".xyz", fails))
    out = tmp_path / "o"
    words = [f"--set={one}" for one in SMALL]
    options = ["--no-video", "--lattices=1", "--export=xyz", f"--out={out}"]
    assert main(["run", "exponential_wall", *words, *options]) == 1
    printed = capsys.readouterr()
    assert printed.out.startswith("restitution e ")
    assert "error: cannot write trajectory.xyz: No space left" in printed.err
    summary = json.loads((out / "summary.json").read_text())
    assert summary["status"] == "done"
    assert "trajectory.xyz" in summary["export_error"]
    assert not list(out.glob("*.xyz"))
    assert (out / "plot.png").exists()


@pytest.mark.parametrize("name", ["final.npz", "timeseries.csv", "summary.json"])
def test_a_full_disk_takes_no_number_with_it(tmp_path, monkeypatch, capsys, name):
    written = files.atomic_write

    def full(path, writer):
        def write(new):
            writer(new)
            if path.name == name:
                raise OSError(errno.ENOSPC, "No space left on device")

        written(path, write)

    monkeypatch.setattr(files, "atomic_write", full)
    out = tmp_path / "o"
    words = [f"--set={one}" for one in SMALL]
    options = ["--no-video", "--lattices=1", f"--out={out}"]
    assert main(["run", "exponential_wall", *words, *options]) == 1
    printed = capsys.readouterr()
    assert printed.out.startswith("restitution e ")
    assert printed.err.endswith(
        f"error: cannot write {name}: No space left on device\n"
    )
    if name == "summary.json":
        assert list(tmp_path.iterdir()) == []
        assert "files in" not in printed.out
    else:
        summary = json.loads((out / "summary.json").read_text())
        assert summary["status"] == "failed"
        assert name in summary["reason"]
        assert str(summary["restitution"])[:6] in printed.out
        assert not list(out.glob(f"*{name}"))
        # It may be repeated: the folder holds a run.
        monkeypatch.setattr(files, "atomic_write", written)
        assert main(["run", "exponential_wall", *words, *options]) == 0


def test_the_summary_has_the_numbers_even_if_the_disk_stays_full(tmp_path, monkeypatch):
    written = files.atomic_write
    names = []

    def full(path, writer):
        names.append(path.name)
        if "final.npz" in names:
            raise SimulationError(f"cannot write {path.name}: No space left on device")
        written(path, writer)

    monkeypatch.setattr(files, "atomic_write", full)
    scene = load_scene("exponential_wall", SMALL)
    result = run(scene, tmp_path / "o", video=False, lattices=1)
    assert names[-2:] == ["final.npz", "summary.json"]
    assert result.summary["reason"] == "cannot write final.npz: No space left on device"
    summary = json.loads((tmp_path / "o" / "summary.json").read_text())
    assert summary["restitution"] == result.restitution
    assert summary["status"] == "failed"


@pytest.mark.parametrize("kind", ["exponential_wall", "absorbing_wall"])
def test_first_and_last_row_are_the_states_in_the_npz_files(runs, kind):
    stored_run = runs[kind]
    table = stored_run.table
    start = np.load(stored_run.out / "lattice.npz")
    final = np.load(stored_run.out / "final.npz")
    n = int(start["disk_points"])
    m = start["masses"][0]
    assert n == 100
    for row, state in ((0, start), (-1, final)):
        x = state["positions"][:n]
        v = state["velocities"][:n]
        centre = x.mean(axis=0)
        speed = v.mean(axis=0)
        spin = m * np.sum(
            (x - centre)[:, 0] * (v - speed)[:, 1]
            - (x - centre)[:, 1] * (v - speed)[:, 0]
        )
        kinetic = 0.5 * m * np.sum(state["velocities"] ** 2)
        names = (
            "com_x",
            "com_y",
            "com_vx",
            "com_vy",
            "angular_momentum",
            "lowest_y",
            "kinetic",
        )
        values = [*centre, *speed, spin, x[:, 1].min(), kinetic]
        assert [table[name][row] for name in names] == pytest.approx(
            values, rel=1e-11, abs=1e-14
        )
    summary = stored_run.summary
    assert (
        table["t"][-1] == final["t"] == pytest.approx(summary["steps"] * summary["dt"])
    )
    # far from the wall
    before, after = np.sqrt(table["com_vy"] ** 2 + 2.0 * table["wall"])[[0, -1]]
    assert after / before == pytest.approx(summary["restitution"], rel=1e-12)


def test_the_wall_s_force_is_the_change_of_momentum(runs):
    # d(com_vy)/dt = wall force (M = 1), by central differences between rows.
    table = runs["exponential_wall"].table
    t = table["t"]
    v = table["com_vy"]
    slope = (v[2:] - v[:-2]) / (t[2:] - t[:-2])
    peak = table["wall_force"].max()
    assert peak > 1e-3
    np.testing.assert_allclose(
        slope, table["wall_force"][1:-1], rtol=0, atol=0.02 * peak
    )


def test_lattice_npz_alone_repeats_the_run(runs):
    # An independent program uses only the file and the scene's parameters; the boundary
    # is matched.
    stored_run = runs["absorbing_wall"]
    start = np.load(stored_run.out / "lattice.npz")
    final = np.load(stored_run.out / "final.npz")
    d = (
        start["positions"][start["bonds"][:, 0]]
        - start["positions"][start["bonds"][:, 1]]
    )
    np.testing.assert_allclose(
        np.hypot(*d.T), start["rest_lengths"], rtol=0, atol=1e-13
    )
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


def test_the_saved_scene_is_the_scene_with_every_default_and_repeats_the_run_bitwise(
    runs,
):
    stored_run = runs["compression"]
    path = stored_run.out / "scene.yaml"
    assert load_scene(path) == load_scene("compression", SCENES["compression"])
    for key in (
        "points",
        "seed",
        "k_a",
        "eta_star",
        "a",
        "V0",
        "pressure",
        "integrator",
        "safety",
    ):
        assert re.search(rf"^  {key}: ", path.read_text(), re.MULTILINE), key
    before = {path.name: path.read_bytes() for path in stored_run.out.iterdir()}
    run(load_scene(path), stored_run.out, video=False, lattices=1)
    after = {path.name: path.read_bytes() for path in stored_run.out.iterdir()}
    # its wall clock
    assert {name for name in before if after[name] != before[name]} == {"summary.json"}
