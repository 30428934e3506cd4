"""Taichi Forge, which runs where Taichi does not, gives the same bits and films."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FORK = ("taichi-forge==0.7.0", "taichi-forge-runtime==0.7.0")
SCENES = {
    "exponential_wall": (
        "--set=lattice.points=200",
        "--set=video.size=128",
        "--set=video.seconds=0.5",
    ),
    "compression": ("--no-video", "--set=lattice.points=200"),
    "absorbing_wall": (
        "--no-video",
        "--set=lattice.points=200",
        "--set=wall.points=300",
    ),
}


pytestmark = pytest.mark.validate


@pytest.fixture(scope="module")
def fork(tmp_path_factory):
    """Return a Python with all packages of this one and the fork, no Taichi."""
    folder = tmp_path_factory.mktemp("fork")
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    python = str(folder / "bin" / "python")
    install = [python, "-m", "pip", "install", "--quiet"]
    subprocess.run([*install, "--no-deps", *FORK, "dill", "colorama"], check=True)
    (site,) = folder.glob("lib/python*/site-packages")
    packages = [path for path in sys.path if path.endswith("-packages")]
    (site / "zz_others.pth").write_text("\n".join(packages) + "\n")
    (site / "sitecustomize.py").write_text(
        'import sys\nsys.modules["taichi"] = None  # as if it were not installed\n'
    )
    return python


def ended(*command):
    """Return a process that has ended well, with what it printed."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done


@pytest.mark.parametrize("scene", SCENES)
def test_the_fork_computes_bitwise_the_same_and_films_with_hard_lines(
    fork, scene, tmp_path
):
    outputs = []
    for name, python in (("taichi", sys.executable), ("taichi-forge", fork)):
        out = tmp_path / name
        run = (python, "-m", "taichi_disk", "run", scene, "--out", str(out))
        outputs.append(ended(*run, *SCENES[scene]).stderr)
        assert name in json.loads((out / "summary.json").read_text())["versions"]
    assert outputs[0] == outputs[1]
    for file in ("final.npz", "timeseries.csv"):
        computed = (tmp_path / "taichi" / file).read_bytes()
        assert computed == (tmp_path / "taichi-forge" / file).read_bytes(), file
    if scene == "exponential_wall":
        # The fork's window keeps its own shaders, which draw springs as hard lines.
        film = (tmp_path / "taichi" / "video.mp4").stat().st_size
        other = (tmp_path / "taichi-forge" / "video.mp4").stat().st_size
        assert film < other < 9 * film


STEP = """
from time import process_time
from taichi_disk import load_scene
from taichi_disk.base import runtime
from taichi_disk.mechanics.integrators import VELOCITY_VERLET
runtime.start(1)
from taichi_disk.mechanics.simulation.simulation import Simulation
scenario = load_scene("exponential_wall").scenario()
simulation = Simulation(
    scenario.lattice, scenario.model, VELOCITY_VERLET, scenario.velocities, 2e-3
)
times = []
for _ in range(8):
    began = process_time()
    simulation.advance(1000, 1000)
    times.append(process_time() - began)
print(min(times))
"""


def test_a_step_of_the_fork_takes_as_long_as_taichis(fork):
    # by default, which compiles faster, it takes eleven times as long
    own, other = (
        float(ended(python, "-c", STEP).stdout) for python in (sys.executable, fork)
    )
    assert other < 1.5 * own
