"""What a page can throw again, condition by condition."""

from types import SimpleNamespace

import numpy as np
import pytest

from taichi_disk import load_scene
from taichi_disk.mechanics.lattice import OwnStart
from taichi_disk.pictures.web.throws import throwable

POINTS = np.tile([0.0, -0.05], (60, 1))


def of_run(kind="exponential_wall", own=None, **changes):
    scene = load_scene(kind).with_({"lattice.points": 60} | changes)
    run = SimpleNamespace(scenario=scene.scenario(own=own))
    return throwable(SimpleNamespace(run=run))


def test_a_plain_throw_is_thrown_again():
    core = {"lattice.core_radius": 0.6, "lattice.core_density": 2.0}
    assert of_run()
    assert of_run(**core, **{"material.eta_star": 0, "wall.a": 500.0})


@pytest.mark.parametrize(
    "change",
    [
        {"impact.angle": 0.3},
        {"impact.spin": 0.1},
        {"wall.friction": 0.2},
        {"impact.gap": 0.2},
        {"time.dt": 0.001},
        {"time.tolerance": 1e-4},
        {"material.dashpot": "axial"},
        {"lattice.core_radius": 0.6, "lattice.core_stiffness": 2.0},
        {"kind": "absorbing_wall", "wall.points": 100},
        {"kind": "compression"},
        {"own": OwnStart(None, POINTS)},
    ],
    ids=str,
)
def test_what_a_page_cannot_compute_is_not_thrown_again(change):
    assert not of_run(**change)


def test_a_lattice_of_a_file_is_not_thrown_again(tmp_path):
    points = load_scene("exponential_wall").with_({"lattice.points": 60}).body()
    np.savetxt(tmp_path / "a.csv", points.positions, delimiter=",")
    assert not of_run(**{"lattice.file": str(tmp_path / "a.csv")})
