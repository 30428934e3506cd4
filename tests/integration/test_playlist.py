"""What the sandbox's list of scenes asks, and what a scenario says about its end."""

import re

import numpy as np
import pytest

from taichi_disk.runs import api
from taichi_disk.sandbox.app import list_presets

PLAYLIST = {one.name: one for one in list_presets(None)}
SMALL = {"lattice.points": 60}
WALL = (SMALL | {"wall.points": 140}, {"boundary": "absorbed"})


def shares(text):
    """Return the shares of the energy in a sentence [%] by what has them."""
    taken = re.findall(r"(\w+) took ([\d.]+) %", text)
    left = re.findall(r"([\d.]+) % is (left) in the disk", text)
    found = {name: float(share) for name, share in taken}
    return found | {name: float(share) for share, name in left}


def test_each_scene_asks_a_question():
    assert len(PLAYLIST) == 25
    for one in PLAYLIST.values():
        assert re.fullmatch(r"[A-Z][^?]+\?", one.question)


IMPACTS = (
    ("A fast bounce", SMALL, {"dashpots": "dissipated"}),
    ("No dashpots", SMALL, {}),
    pytest.param("Dashpots at the boundary", *WALL, marks=pytest.mark.validate),
    ("Another side on it", *WALL),
)


@pytest.mark.parametrize(("name", "few", "losses"), IMPACTS)
def test_an_impact_says_where_its_energy_is(name, few, losses):
    result = api.run(PLAYLIST[name].load().with_(few), lattices=1)
    series = result.series
    text = result.scenario.conclusion(series)
    assert text.startswith(f"It comes back at {result.restitution:.3f} of its speed. ")
    found = shares(text)
    energy = series["kinetic"][0]
    rest = 1.0  # what neither flies nor turns, and nothing has taken
    for taker, column in losses.items():
        share = series[column][-1] / energy
        rest -= share
        assert found.pop(taker) == pytest.approx(100.0 * share, abs=0.51)
    disk = result.scenario.lattice.positions[:60]
    inertia = ((disk - disk.mean(axis=0)) ** 2).sum(axis=1).mean()
    flight = 0.5 * (series["com_vx"][-1] ** 2 + series["com_vy"][-1] ** 2)
    rest -= (flight + series["angular_momentum"][-1] ** 2 / (2.0 * inertia)) / energy
    assert found.pop("left", 0.0) == pytest.approx(100.0 * rest, rel=0.05, abs=0.06)
    assert not found


OBLIQUE = (
    ("Backspin", "left"),
    ("No spin", "right"),
    ("A smooth wall", "right"),
    ("Spin bends the bounce", "left"),
)


@pytest.mark.parametrize(("name", "side"), OBLIQUE)
def test_an_oblique_impact_says_where_it_goes(name, side):
    result = api.run(PLAYLIST[name].load().with_(SMALL), lattices=1)
    series = result.series
    text = result.scenario.conclusion(series)
    before, after = np.hypot(series["com_vx"], series["com_vy"])[[0, -1]]
    kept = float(re.search(rf"([\d.]+) of its speed, to the {side}", text)[1])
    assert kept == pytest.approx(after / before, abs=2e-3)
    friction = 100.0 * series["friction"][-1] / series["kinetic"][0]
    assert shares(text).get("friction", 0.0) == pytest.approx(friction, abs=0.51)
    # the disk stays in the picture, which is as wide as the film's
    path = np.cumsum(np.gradient(series["t"]) * series["com_vx"])
    left, right, *_ = result.scenario.view
    assert left + 0.95 < path.min()
    assert path.max() < right - 0.95


def test_a_compression_says_how_much_lower_its_centre_lies():
    scene = PLAYLIST["Pressed on the wall"].load().with_(SMALL)
    result = api.run(scene, lattices=1)
    text = result.scenario.conclusion(result.series)
    assert f"lies {result.xi:.3g} R lower" in text
