"""Sweeps: a point's numbers are those of its scene alone, whatever is beside it, before it, or kills it."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from taichi_disk import load_scene, run
from taichi_disk.cli import main
from taichi_disk.lattice import disk_lattice
from taichi_disk.model.physics import Physics
from taichi_disk.scene_file import load_sweep
from taichi_disk.scenes import build
from taichi_disk.simulate import BlowUp
from taichi_disk.study.sweep import SweepResult, run_sweep
from taichi_disk.sweep_axes import Sweep
from taichi_disk.time_step import TimeStep

SMALL = """
scene: exponential_wall
lattice: {points: 60}
sweep: {eta_star: [0, 30], seed: [3, 4], velocity: [0.01, 0.02, 0.05]}
"""


def sweep_of(folder: Path, text: str, *overrides: str) -> Sweep:
    (folder / "s.yaml").write_text(text)
    return load_sweep(folder / "s.yaml", overrides)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> SweepResult:
    folder = tmp_path_factory.mktemp("small")
    return run_sweep(sweep_of(folder, SMALL), folder / "out", jobs=1)


def test_a_sweep_leaves_one_row_per_point_and_its_fits_and_figure(small: SweepResult) -> None:
    with (small.out / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12 and not small.failed
    assert [(row["eta_star"], row["seed"], row["velocity"]) for row in rows[:2]] == [
        ("0.0", "3", "0.01"),
        ("0.0", "3", "0.02"),
    ]
    assert all(abs(float(row["energy_imbalance"])) < 1e-3 for row in rows)
    summary = json.loads((small.out / "summary.json").read_text())
    assert [curve["eta_star"] for curve in summary["curves"]] == [0, 30]
    assert set(summary["curves"][1]["fits"]) == {"eq5", "eq5_d1_is_1", "eq4"}
    assert all((small.out / name).stat().st_size > 5000 for name in ("figure.png", "figure.svg"))


@pytest.mark.parametrize("row", [1, 10])
def test_a_row_is_what_running_its_scene_gives(small: SweepResult, tmp_path: Path, row: int) -> None:
    found = small.rows[row]
    how = [f"time.dt={found['dt']!r}", f"time.integrator={found['integrator']}"]
    alone = run(load_scene(small.out / "points" / f"{found['key']}.yaml", how), tmp_path / "out", video=False)
    # The same scheme and step; one lane adds up the elastic energy in another order, and nothing else.
    assert alone.headline["restitution"] == pytest.approx(found["restitution"], abs=1e-12)
    assert alone.summary["steps"] == found["steps"]


def test_only_what_is_missing_is_computed_and_the_table_is_the_same_bytes(small: SweepResult, tmp_path: Path) -> None:
    table = (small.out / "points.csv").read_bytes()
    for row in small.rows[1::5]:
        (small.out / "points" / f"{row['key']}.json").unlink()
    again = run_sweep(sweep_of(tmp_path, SMALL), small.out, jobs=1)
    assert again.summary["computed_now"] == 3
    assert (small.out / "points.csv").read_bytes() == table


def test_the_command_prints_fits_and_where_the_files_are(
    small: SweepResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "s.yaml").write_text(SMALL)
    assert main(["sweep", str(tmp_path / "s.yaml"), "--out", str(small.out), "--jobs", "1"]) == 0
    shown = capsys.readouterr().out
    assert "eta_star: 30, 2 lattices" in shown and "eq. (4) integrated" in shown
    assert "12 points, 0 of them computed now, 0 failed" in shown
    assert main(["sweep", "exponential_wall"]) == 2
    assert main(["run", str(tmp_path / "s.yaml")]) == 2


def test_points_do_not_depend_on_the_sweep_they_are_in(small: SweepResult, tmp_path: Path) -> None:
    part = run_sweep(sweep_of(tmp_path, SMALL, "sweep.velocity=[0.02]", "sweep.eta_star=[30]"), tmp_path / "o", jobs=1)
    whole = {row["key"]: row for row in small.rows}
    assert all(whole[row["key"]] == row for row in part.rows) and len(part.rows) == 2


def test_points_that_share_a_step_and_differ_in_their_rows_do_not_share_these(tmp_path: Path) -> None:
    # A reset boundary gives both the same step; the faster one needs rows closer by.
    text = "scene: absorbing_wall\nlattice: {points: 40}\nwall: {points: 50, width: 3.0}\n"
    text += "sweep: {velocity: [0.02, 0.05]}"
    both = run_sweep(sweep_of(tmp_path, text), tmp_path / "both", jobs=1).rows
    fast = run_sweep(sweep_of(tmp_path, text, "sweep.velocity=[0.05]"), tmp_path / "fast", jobs=1).rows
    assert both[0]["dt"] == both[1]["dt"] and both[1:] == fast


@pytest.mark.validate
def test_a_killed_sweep_goes_on_and_ends_with_the_same_bytes_in_any_number_of_processes(
    small: SweepResult, tmp_path: Path
) -> None:
    (tmp_path / "s.yaml").write_text(SMALL)
    command = [sys.executable, "-m", "taichi_disk", "sweep", str(tmp_path / "s.yaml"), "--out", str(tmp_path / "out")]
    first = subprocess.Popen([*command, "--jobs", "2"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 60
    while not list((tmp_path / "out").glob("points/[!.]*.json")) and time.monotonic() < until and first.poll() is None:
        time.sleep(0.01)
    workers = Path(f"/proc/{first.pid}/task/{first.pid}/children").read_text().split()
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    until = time.monotonic() + 60
    while any(Path(f"/proc/{worker}").exists() for worker in workers):
        assert time.monotonic() < until, "workers outlive their parent"
        time.sleep(0.1)
    done = len(list((tmp_path / "out").glob("points/[!.]*.json")))
    assert 0 < done <= 12
    second = subprocess.run([*command, "--jobs", "2"], capture_output=True, text=True, check=True)
    assert (tmp_path / "out" / "points.csv").read_bytes() == (small.out / "points.csv").read_bytes()
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["computed_now"] == 12 - done
    assert "12 points" in second.stdout


@pytest.mark.validate
def test_workers_leave_their_kernels_to_the_next_sweep(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(SMALL)
    cache = tmp_path / "cache"
    cache.mkdir()
    command = [sys.executable, "-m", "taichi_disk", "sweep", str(tmp_path / "s.yaml"), "--out", str(tmp_path / "out")]
    environment = os.environ | {"TI_OFFLINE_CACHE_FILE_PATH": str(cache)}
    subprocess.run([*command, "--jobs", "2"], env=environment, capture_output=True, check=True)
    assert sum(path.is_file() for path in cache.rglob("*")) > 3


def test_failed_points_are_listed_and_do_not_stop_the_others(tmp_path: Path) -> None:
    # A small lattice in a short time: only the fast disk is back by then.
    text = "scene: exponential_wall\nlattice: {points: 60}\nmaterial: {eta_star: 0.0}\n"
    sweep = sweep_of(tmp_path, text + "impact: {max_time: 30.0}\nsweep: {velocity: [0.003, 0.05]}\n")
    result = run_sweep(sweep, tmp_path / "out", jobs=1)
    assert [row["status"] for row in result.rows] == ["failed", "done"]
    assert "has not left the wall by t = 30" in result.failed[0]["reason"]
    assert result.summary["failed"][0]["velocity"] == 0.003
    assert run_sweep(sweep, tmp_path / "out", jobs=1).summary["computed_now"] == 0


def test_a_lane_that_blows_up_leaves_the_others_as_they_are_alone() -> None:
    from taichi_disk.study.lanes import LaneEngine

    engine = LaneEngine("f64")
    setups = [
        build(load_scene("exponential_wall", ["lattice.points=60", "material.eta_star=0", f"impact.velocity={v}"]))
        for v in (9.0, 0.05)
    ]
    step = TimeStep("velocity_verlet", 0.05, 0.05)  # good for 0.05 c, far too long for 9 c
    alone = dict(engine.run(setups[1:], step, 0.05))[0]
    both = dict(engine.run(setups, step, 0.05))
    # Told as a single run tells it.
    assert isinstance(both[0].failure, BlowUp) and "blow-up at step" in str(both[0].failure)
    assert both[1].failure is None and both[1].steps == alone.steps
    assert all(np.array_equal(both[1].columns[name], alone.columns[name]) for name in alone.columns)


@pytest.mark.parametrize(("integrator", "lanes"), [("velocity_verlet", 1), ("trapezoidal", 2)])
def test_a_restarted_world_is_a_new_one(taichi: None, integrator: str, lanes: int) -> None:
    from taichi_disk.model.world import World

    def arguments(seed: int, points: int = 60) -> tuple:
        disk = disk_lattice(points, seed)
        v = np.random.default_rng(seed).standard_normal((lanes, points, 2)) * 0.01
        physics = Physics(eta=(0.1 + seed) / 60, integrator=integrator, wall="rigid")
        x = disk.positions + np.array([[[0.0, 1.0]], [[0.1, 1.2]]])[:lanes]
        return disk, physics, v, 0.01 / (seed + 1), None, None, x

    world = World(*arguments(0))
    world.advance(3)
    expected = World(*arguments(1, 87)).advance(20)
    for other in (arguments(1, 60), arguments(0, 130)):  # fewer points and more have been there before
        assert world.restart(*other)
        world.advance(20)
        assert world.restart(*arguments(1, 87))
        assert np.array_equal(world.advance(20), expected)
    assert not world.restart(*arguments(0, 12_001))
    assert np.array_equal(world.restart(*arguments(1, 87)) and world.advance(20), expected)


def test_compressions_are_pressed_and_fitted(tmp_path: Path) -> None:
    text = "scene: compression\nlattice: {points: 60}\ncompression: {method: newton}\n"
    text += "sweep: {seed: [0, 1], pressure: [5.0e-3, 1.0e-2]}\n"
    result = run_sweep(sweep_of(tmp_path, text), tmp_path / "out", jobs=1)
    assert all(row["residual"] < 1e-6 and row["xi"] > 0 for row in result.rows)
    b = result.summary["curves"][0]["fits"]["eq2"]
    assert b["values"]["b_min"] <= b["values"]["b"] <= b["values"]["b_max"]
    assert result.rows[1]["xi"] > result.rows[0]["xi"]
