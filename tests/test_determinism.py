"""The same scene gives the same bytes: again, with more threads, after other scenes, from its own scene.yaml."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from taichi_disk import load_scene, run

SMALL = ("lattice.points=80",)
WALL = (*SMALL, "wall.points=100", "wall.width=3.0")
SCENES = {
    "exponential_wall": SMALL,
    "compression": (*SMALL, "compression.tolerance=1e-3"),
    "absorbing_wall": (*WALL, "material.eta_star=5", "time.integrator=trapezoidal"),
}

ELSEWHERE = """
import sys
from taichi_disk import load_scene, run
out, threads, name, *settings = sys.argv[1:]
run(load_scene(name, settings), out, video=False, threads=int(threads))
"""


def bytes_of(out: Path) -> dict[str, object]:
    """Every file's bytes; of the summary all but how long it took."""
    found: dict[str, object] = {path.name: path.read_bytes() for path in sorted(out.iterdir())}
    summary = json.loads((out / "summary.json").read_text())
    del summary["wall_clock"]
    return found | {"summary.json": summary}


def assert_same(one: dict[str, object], other: dict[str, object]) -> None:
    assert sorted(one) == sorted(other)
    for name in one:
        assert one[name] == other[name], name


def elsewhere(out: Path, threads: int, name: str) -> dict[str, object]:
    command = [sys.executable, "-c", ELSEWHERE, str(out), str(threads), name, *SCENES[name]]
    subprocess.run(command, check=True, cwd=Path(__file__).parent.parent, timeout=120)
    return bytes_of(out)


def twice(names, folder: Path) -> dict[str, dict[str, object]]:
    """Run all `names` in this process, then again in the other order, each from the scene.yaml it left."""
    first = {}
    for name in names:
        run(load_scene(name, SCENES[name]), folder / name, video=False)
        first[name] = bytes_of(folder / name)
    for name in reversed(names):
        again = folder / f"{name} again"
        run(load_scene(folder / name / "scene.yaml"), again, video=False)
        assert_same(first[name], bytes_of(again))
    return first


def test_a_run_gives_the_same_bytes_again_and_in_another_process(tmp_path):
    first = twice(["exponential_wall"], tmp_path)
    assert_same(first["exponential_wall"], elsewhere(tmp_path / "two", 2, "exponential_wall"))


@pytest.mark.validate
def test_scenes_in_any_order_give_the_same_bytes(tmp_path):
    twice(list(SCENES), tmp_path)


@pytest.mark.validate
@pytest.mark.parametrize("name", SCENES)
def test_threads_do_not_matter(name, tmp_path):
    one, two = (elsewhere(tmp_path / str(threads), threads, name) for threads in (1, 2))
    assert_same(one, two)


@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize("integrator", ["trapezoidal", pytest.param("velocity_verlet", marks=pytest.mark.validate)])
def test_a_world_goes_on_from_a_saved_state_with_the_same_bytes(integrator):
    from dataclasses import replace

    from worlds import disk_and_wall, matched, moving_down

    from taichi_disk.model.physics import Physics
    from taichi_disk.model.world import World

    lattice = disk_and_wall(60, 80, height=0.05)
    physics = replace(matched(lattice, Physics(wall="elastic", eta=0.2)), integrator=integrator)
    world = World(lattice, physics, moving_down(lattice, 0.05), 2e-3)
    world.advance(1, 300)
    state = world.export_state()
    expected = world.advance(4, 50)
    world.advance(1, 77)
    world.import_state(state)
    np.testing.assert_array_equal(world.advance(4, 50), expected)
    # In how many launches does not matter either.
    world.import_state(state)
    pieces = np.concatenate([world.advance(1, 50), world.advance(3, 50)])
    np.testing.assert_array_equal(pieces, expected)
    world.destroy()
