"""What a run leaves behind: names, columns and units, and enough to repeat it with another program."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from reference import Model

from taichi_disk import load_scene, run

SMALL = ("lattice.points=100", "time.safety=0.3")
WALL = (*SMALL, "wall.points=120", "wall.width=3.2")
COLUMNS = (
    "t,com_x,com_y,com_vx,com_vy,angular_momentum,lowest_y,wall_force,kinetic,elastic,wall,dissipated,absorbed,total"
)


@pytest.fixture(scope="module")
def impact(tmp_path_factory):
    out = tmp_path_factory.mktemp("impact")
    return run(load_scene("exponential_wall", SMALL), out, video=False), out


@pytest.fixture(scope="module")
def absorbing(tmp_path_factory):
    out = tmp_path_factory.mktemp("absorbing")
    return run(load_scene("absorbing_wall", (*WALL, "wall.boundary=dashpot")), out, video=False), out


@pytest.fixture(scope="module")
def compression(tmp_path_factory):
    out = tmp_path_factory.mktemp("compression")
    settings = (*SMALL, "compression.method=newton")
    return run(load_scene("compression", settings), out, video=False), out


def table_of(out):
    text = (out / "timeseries.csv").read_text()
    names = text.splitlines()[0].split(",")
    return dict(zip(names, np.loadtxt(text.splitlines()[1:], delimiter=",").T, strict=True))


def test_files_are_those_of_the_contract(impact, absorbing, compression):
    for _, out in (impact, absorbing, compression):
        names = {path.name for path in out.iterdir()}
        assert names == {"scene.yaml", "summary.json", "timeseries.csv", "lattice.npz", "final.npz", "plot.png"}


def test_rows_asked_for_far_apart_are_rows_of_the_full_series_and_its_end(impact, tmp_path):
    run(load_scene("exponential_wall", (*SMALL, "time.sample_interval=1.0")), tmp_path / "o", video=False)
    full, few = table_of(impact[1]), table_of(tmp_path / "o")
    every = round(1.0 / full["t"][1])
    chosen = sorted({*range(0, len(full["t"]), every), len(full["t"]) - 1})
    assert np.ptp(np.diff(few["t"])[:-1]) < 1e-9 and few["t"][1] == pytest.approx(1.0, abs=0.5 * full["t"][1])
    assert all(np.array_equal(few[name], full[name][chosen]) for name in full)


def test_summary_says_what_was_computed_and_how(impact, absorbing, compression):
    common = {"scene", "status", "reason", "seed", "precision", "versions", "wall_clock", "measured"}
    common |= {"steps", "integrator"}
    for (result, out), keys in (
        (impact, {"restitution", "contact_time", "dt", "energy"}),
        (absorbing, {"restitution", "contact_time", "dt", "energy"}),
        (compression, {"xi", "xi_nominal"}),
    ):
        summary = json.loads((out / "summary.json").read_text())
        assert summary == result.summary
        assert common | keys <= set(summary)
        assert summary["status"] == "done"
        assert summary["reason"] is None
        assert summary["precision"] == "f64"
        assert {"build", "simulate"} <= set(summary["wall_clock"])
        assert {"python", "taichi", "numpy", "taichi-disk"} <= set(summary["versions"])
        for key in result.headline:
            assert summary[key] == result.headline[key]


def test_timeseries_has_the_columns_of_the_contract(impact, absorbing, compression):
    more = ((impact, ""), (absorbing, ""), (compression, ",load"))
    for (_, out), columns in more:
        assert (out / "timeseries.csv").read_text().splitlines()[0] == COLUMNS + columns
        table = table_of(out)
        assert np.isfinite(list(table.values())).all()
        assert (np.diff(table["t"]) > 0).all()
        assert table["t"][0] == 0.0
        parts = sum(
            table.get(one, 0.0) for one in ("kinetic", "elastic", "wall", "dissipated", "absorbed", "sliding", "load")
        )
        np.testing.assert_allclose(table["total"], parts, rtol=1e-12)


def test_first_and_last_row_are_the_states_in_the_npz_files(impact, absorbing):
    for result, out in (impact, absorbing):
        table, start, final = table_of(out), np.load(out / "lattice.npz"), np.load(out / "final.npz")
        n, m = int(start["disk_points"]), start["masses"][0]
        assert n == 100
        for row, state in ((0, start), (-1, final)):
            x, v = state["positions"][:n], state["velocities"][:n]
            centre, speed = x.mean(axis=0), v.mean(axis=0)
            spin = m * np.sum((x - centre)[:, 0] * (v - speed)[:, 1] - (x - centre)[:, 1] * (v - speed)[:, 0])
            kinetic = 0.5 * m * np.sum(state["velocities"] ** 2)
            for name, value in (
                ("com_x", centre[0]),
                ("com_y", centre[1]),
                ("com_vx", speed[0]),
                ("com_vy", speed[1]),
                ("angular_momentum", spin),
                ("lowest_y", x[:, 1].min()),
                ("kinetic", kinetic),
            ):
                assert table[name][row] == pytest.approx(value, rel=1e-11, abs=1e-14), name
        assert table["t"][-1] == final["t"] == pytest.approx(result.summary["steps"] * result.summary["dt"])
        assert table["com_vy"][-1] == pytest.approx(0.02 * result.headline["restitution"], rel=1e-12)


def test_force_and_energies_mid_run_are_consistent(impact):
    # d(com_vy)/dt = wall force (M = 1), by central differences between rows.
    table = table_of(impact[1])
    t, v = table["t"], table["com_vy"]
    slope = (v[2:] - v[:-2]) / (t[2:] - t[:-2])
    peak = table["wall_force"].max()
    assert peak > 1e-3
    np.testing.assert_allclose(slope, table["wall_force"][1:-1], rtol=0, atol=0.02 * peak)


def test_lattice_npz_alone_repeats_the_run(absorbing):
    # An independent program with nothing but the file and the scene's numbers: matched boundary.
    result, out = absorbing
    start, final = np.load(out / "lattice.npz"), np.load(out / "final.npz")
    for name in ("positions", "velocities", "bonds", "rest_lengths", "masses", "disk_points"):
        assert name in start
    assert start["bonds"].dtype == np.int32
    d = start["positions"][start["bonds"][:, 0]] - start["positions"][start["bonds"][:, 1]]
    np.testing.assert_allclose(np.hypot(*d.T), start["rest_lengths"], rtol=0, atol=1e-13)
    assert (np.diff(start["positions"][start["wall_surface"], 0]) > 0).all()
    model = Model(
        start["bonds"],
        start["rest_lengths"],
        start["masses"][0],
        int(start["disk_points"]),
        k_b=1e-3,
        disk_surface=start["disk_surface"],
        wall_surface=start["wall_surface"],
        boundary=start["wall_boundary"],
        impedance=start["wall_impedance"],
    )
    _, v = model.solve(start["positions"], start["velocities"], float(final["t"]), rtol=1e-8)
    assert result.headline["restitution"] == pytest.approx(v[:100, 1].mean() / 0.02, abs=2e-5)


def test_saved_scene_is_the_scene_with_every_default(impact):
    _, out = impact
    text = (out / "scene.yaml").read_text()
    assert load_scene(out / "scene.yaml") == load_scene("exponential_wall", SMALL)
    for key in ("points", "seed", "k_a", "eta_star", "a", "V0", "velocity", "gap", "integrator", "safety"):
        assert re.search(rf"^  {key}: ", text, re.MULTILINE), key


def test_plot_is_a_picture(impact):
    assert (impact[1] / "plot.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_running_twice_in_one_process_works(tmp_path):
    # `run` the function must not be shadowed by a module of that name once it has been imported.
    from taichi_disk import load_scene, run

    for name in ("one", "two"):
        result = run(load_scene("compression", (*SMALL, "compression.method=newton")), tmp_path / name, video=False)
        assert result.status == "done"
    import taichi_disk

    assert callable(taichi_disk.run)
