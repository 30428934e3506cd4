"""Keys and numbers of the sandbox, without a page or a window."""

from functools import partial
from itertools import pairwise

import pytest

from taichi_disk.experiments.scenes import load_scene
from taichi_disk.sandbox.controls import MIN_VISCOSITY, REPEATING_KEYS, Controls, Preset
from taichi_disk.sandbox.sandbox import Sandbox


@pytest.fixture
def controls(kernels):
    playlist = []
    for speed in (0.02, 0.05):
        settings = ["lattice.points=120", f"impact.velocity={speed}"]
        load = partial(load_scene, "exponential_wall", settings)
        playlist.append(Preset(f"v = {speed}", "", load))
    return Controls(Sandbox(playlist[0].load()), playlist)


@pytest.mark.validate
def test_every_key_is_explained_and_reaches_what_it_names(controls):
    sandbox = controls.sandbox
    explained = " ".join(keys for keys, _ in controls.reference).split()
    assert set(explained) == set(controls.actions) >= {*REPEATING_KEYS} - {"i", "u"}
    assert len(explained) == len({*explained})
    for key in ("a", "Up", "e", "t", "c", "m", "n"):
        controls.press(key)
    # the next scene has its own values
    assert sandbox.scene.wall.a == 300.0
    assert controls.number == 1
    assert sandbox.scene.impact.velocity == 0.05
    assert sandbox.scene.video.theme == "dark"
    assert sandbox.speed == 1.12
    for _ in range(60):
        controls.press("d")
    assert sandbox.scene.material.eta_star == 0.0
    controls.press("e")
    assert sandbox.scene.material.eta_star == MIN_VISCOSITY["material.eta_star"]
    for _ in range(60):
        controls.press("a")
    assert sandbox.scene.wall.a == 3000.0
    controls.press("k")
    assert sandbox.scene.lattice.points == 180
    controls.press("F1")  # a key without a meaning


def test_the_second_key_of_a_pair_undoes_the_first(controls):
    sandbox = controls.sandbox

    def values():
        scene = sandbox.scene
        own = scene.impact.velocity, scene.wall.a, scene.material.eta_star
        return [*own, scene.lattice.points, sandbox.speed]

    before = values()
    for first, second in ("sm", "ed", ("Up", "Down"), "az", "kj"):
        controls.press(first)
        assert values() != pytest.approx(before, rel=0.05)
        controls.press(second)
        assert values() == pytest.approx(before, rel=0.02)


@pytest.mark.validate
def test_the_keys_for_points_keep_the_viscosity_of_the_body(controls):
    sandbox = controls.sandbox
    eta = sandbox.time.segment.scenario.model.springs.eta
    assert controls.dashpot_key == "material.eta_star"
    for key in ("k", "j", "j"):
        controls.press(key)
        assert sandbox.time.segment.scenario.model.springs.eta == eta == 10.0 / 120
    assert sandbox.scene.lattice.points != 120
    assert controls.dashpot_key == "material.viscosity"
    controls.press("e")
    assert sandbox.scene.material.viscosity == pytest.approx(1.12 * eta, rel=1e-2)
    for _ in range(80):
        controls.press("d")
    assert sandbox.scene.material.viscosity == 0.0
    controls.press("e")
    assert sandbox.scene.material.viscosity == MIN_VISCOSITY["material.viscosity"]


@pytest.mark.validate
def test_a_collected_curve_spans_a_factor_of_30_in_even_ratios(controls):
    controls.collect()
    loads = [0.1, *controls.sandbox.remaining_loads[1:]]
    assert len(loads) == 8
    assert loads[0] / loads[-1] == pytest.approx(30.0, rel=0.02)
    ratios = [left / right for left, right in pairwise(loads)]
    # loads are rounded to two digits
    assert ratios == pytest.approx([30.0 ** (1 / 7)] * 7, rel=0.05)


def test_a_scene_of_the_list_may_set_the_pace(controls):
    sandbox = controls.sandbox
    controls.playlist[1] = controls.playlist[1]._replace(pace=3.0)
    for number in (1, 0):  # the pace of the second is the user's
        controls.play(number)
        assert sandbox.speed == 3.0
        assert sandbox.slow


def test_a_speed_above_c_is_refused_and_a_large_n_limited_in_words(
    controls, monkeypatch
):
    sandbox = controls.sandbox
    controls.attempt(controls.set, "impact.velocity", 5.0)
    assert sandbox.scene.impact.velocity == 0.02
    assert "5 c" in sandbox.message
    controls.attempt(controls.set, "impact.velocity", 0.3)
    assert sandbox.scene.impact.velocity == 0.3
    monkeypatch.setattr("taichi_disk.sandbox.controls.MAX_POINTS", 150)
    controls.attempt(controls.set, "lattice.points", 1e6)
    assert sandbox.scene.lattice.points == 150
    assert "150" in sandbox.message
    assert "1000000" in sandbox.message
