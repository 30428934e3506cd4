"""A run that fails says so everywhere, keeps the last good state, and leaves nothing that looks like a result."""

from __future__ import annotations

import json

import numpy as np
import pytest

from taichi_disk import load_scene, run
from taichi_disk.cli import main
from taichi_disk.errors import InputError, SimulationError

SMALL = ("lattice.points=80", "material.eta_star=0")
FINISHED = {"timeseries.csv", "final.npz", "plot.png", "video.mp4"}
# Half as large again as the limit (some 0.05 R/c for 80 points).
WILD = (*SMALL, "time.dt=0.1")


def arguments(out, *settings):
    return ["run", "exponential_wall", "--out", str(out), "--no-video", *(f"--set={one}" for one in settings)]


def test_a_step_beyond_the_limit_is_refused_and_leaves_nothing(tmp_path, capsys):
    assert main(arguments(tmp_path / "out", *WILD)) == 2
    message = capsys.readouterr().err
    assert "stability limit" in message
    assert "--force" in message
    assert not (tmp_path / "out").exists()


def test_a_forced_blow_up_is_told_and_keeps_the_last_good_state(tmp_path, capsys):
    # Over the results of an earlier, good run: none of them may stay.
    for name in FINISHED:
        (tmp_path / name).write_text("old")
    assert main([*arguments(tmp_path, *WILD), "--force"]) == 1
    message = capsys.readouterr().err
    assert "blow-up" in message
    assert "stability limit" in message
    assert {path.name for path in tmp_path.iterdir()} == {"scene.yaml", "lattice.npz", "summary.json", "failure.npz"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert "blow-up" in summary["reason"]
    assert "restitution" not in summary
    last = np.load(tmp_path / "failure.npz")
    assert last["positions"].shape == last["velocities"].shape == (80, 2)
    assert np.isfinite(last["positions"]).all()
    assert np.isfinite(last["velocities"]).all()
    assert float(last["t"]) >= 0.0


def test_a_scene_that_cannot_be_built_says_so_where_an_earlier_run_lies(tmp_path, capsys):
    for name in (*FINISHED, "summary.json"):
        (tmp_path / name).write_text("old")
    impossible = ("lattice.points=8", "compression.pressure=1", "material.k_a=1e-6", "wall.a=1e6")
    command = ["run", "compression", "--out", str(tmp_path), "--no-video", *(f"--set={one}" for one in impossible)]
    assert main(command) == 1
    told = capsys.readouterr().err
    assert "Newton's method found no way downhill" in told and "method: relaxation" not in told
    assert {path.name for path in tmp_path.iterdir()} == {"scene.yaml", "summary.json"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "failed" and "no way downhill" in summary["reason"]


def test_no_separation_in_time_is_a_failure_with_advice(tmp_path):
    (tmp_path / "failure.npz").write_text("old")
    with pytest.raises(SimulationError, match="max_time"):
        run(load_scene("exponential_wall", (*SMALL, "impact.max_time=1.0")), tmp_path, video=False)
    assert {path.name for path in tmp_path.iterdir()} == {"scene.yaml", "lattice.npz", "summary.json"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert "max_time" in summary["reason"]


def test_a_compression_that_never_rests_is_a_failure_with_advice(tmp_path):
    with pytest.raises(SimulationError, match="newton"):
        run(load_scene("compression", (*SMALL, "compression.max_time=5")), tmp_path, video=False)
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "failed"


def test_an_interrupted_run_says_so(tmp_path):
    class Impatient:
        def start(self, stage, total):
            if stage == "simulate":
                raise KeyboardInterrupt

        def update(self, done): ...

        def stop(self): ...

    with pytest.raises(KeyboardInterrupt):
        run(load_scene("exponential_wall", SMALL), tmp_path, video=False, progress=Impatient())
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "interrupted"
    assert not FINISHED & {path.name for path in tmp_path.iterdir()}


def test_an_arch_that_cannot_be_is_refused_and_leaves_nothing(tmp_path):
    with pytest.raises(InputError, match="vulkan"):
        run(load_scene("exponential_wall", SMALL), tmp_path / "out", video=False, arch="vulkan")
    assert not (tmp_path / "out").exists()


@pytest.mark.validate
def test_a_hard_wall_makes_the_automatic_step_smaller_until_it_holds(tmp_path):
    # The estimate of the wall's stiffness may be too low; the step is then taken back and the run repeated.
    settings = ("lattice.points=80", "lattice.rim=false", "lattice.min_spacing=0", "material.eta_star=0")
    hard = ("wall.a=1e4", "impact.velocity=0.3")
    result = run(load_scene("exponential_wall", (*settings, *hard)), tmp_path, video=False)
    assert result.summary["dt"] <= 0.95 * result.summary["dt_limit"]
    assert result.summary["energy"]["worst_imbalance"] < 0.1
