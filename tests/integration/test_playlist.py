"""What the sandbox's list of scenes claims, against the numbers of the scenes."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache

import pytest

from taichi_disk import api
from taichi_disk.window.app import list_presets

PLAYLIST = {one.name: one for one in list_presets(None)}


@cache
def played(name):
    """Return the result of a scene of the list."""
    return api.run(PLAYLIST[name].load(), lattices=1)


def first(one, name):
    return one.series[name][0]


def last(one, name):
    return one.series[name][-1]


def lost(one, cause):
    """Return the energy that a cause has taken over the kinetic energy of the start."""
    return one.series[cause][-1] / one.series["kinetic"][0]


def near(value, expected, tolerance):
    return abs(value - expected) < tolerance


def paper():
    return played("The paper's bounce")


def absorbing():
    return played("A wall that swallows waves")


def pressed():
    return played("Pressed on the wall").xi


def loses_more(one, than, cause):
    is_lower = one.restitution < than.restitution
    return is_lower and lost(one, cause) > lost(than, cause)


def differs(one, other):
    """Return by how much the restitution of two bounces differs."""
    return abs(one.restitution - other.restitution)


def slower_is_larger(one):
    fast = played("A bounce")
    ratio = first(one, "com_vy") / first(fast, "com_vy")
    return near(ratio, 0.2, 1e-6) and one.restitution > fast.restitution + 0.01


def undamped(one):
    e = one.restitution
    is_known = near(e, 0.996, 0.0006) and lost(one, "dissipated") == 0.0
    return is_known and lost(one, "vibration") > 0.5 * (1.0 - e**2)


def no_spin(one):
    is_turned = last(one, "angular_momentum") < -0.01
    is_turned = is_turned and near(first(one, "angular_momentum"), 0.0, 1e-9)
    return is_turned and 0.0 < last(one, "com_vx") < first(one, "com_vx")


def topspin(one):
    before = first(one, "com_vx") / -first(one, "com_vy")
    is_faster = last(one, "com_vx") > first(one, "com_vx")
    return is_faster and last(one, "com_vx") / last(one, "com_vy") > before


def smooth(one):
    before = first(one, "angular_momentum")
    return before > 0.1 and near(last(one, "angular_momentum"), before, 0.01 * before)


def bent(one):
    is_straight = near(first(one, "com_vx"), 0.0, 1e-9)
    return is_straight and abs(last(one, "com_vx")) > 0.5 * last(one, "com_vy")


CLAIMS: dict[str, Callable[[api.Result], bool]] = {
    "A bounce": lambda one: (
        near(one.restitution, 0.93, 0.005)
        and near(lost(one, "dissipated"), 1.0 / 7.0, 0.005)
    ),
    "Backspin": lambda one: (
        first(one, "com_vx") > 0.01
        and last(one, "com_vx") < -0.01
        and lost(one, "friction") > 0.1
    ),
    "The paper's bounce": slower_is_larger,
    "No dashpots": undamped,
    "Strong dashpots": lambda one: 0.35 < lost(one, "dissipated") < 0.4,
    "Another side": lambda one: 0.001 < differs(one, paper()) < 0.01,
    "A fast bounce": lambda one: loses_more(one, paper(), "dissipated"),
    "No spin": no_spin,
    "Topspin": topspin,
    "A smooth wall": smooth,
    "Spin bends the bounce": bent,
    "A hard wall": lambda one: (
        one.scene.wall.a == 3000.0 and loses_more(one, paper(), "dissipated")
    ),
    "A wall that swallows waves": lambda one: near(lost(one, "absorbed"), 0.1, 0.01),
    "A wall that reflects": lambda one: (
        one.restitution > 0.995 and lost(one, "absorbed") == 0.0
    ),
    "Dashpots at the boundary": lambda one: near(lost(one, "absorbed"), 2 / 3, 0.02),
    "Another side on it": lambda one: (
        differs(one, absorbing()) < 0.3 * differs(played("Another side"), paper())
    ),
    "Fast on the soft wall": lambda one: loses_more(one, absorbing(), "absorbed"),
    "Pressed on the wall": lambda one: near(one.xi, 0.0153, 5e-5),
    "A light load": lambda one: one.xi > 0.4 * pressed(),
    "A heavy load": lambda one: one.xi < 2.0 * pressed(),
    "Another lattice": lambda one: 1e-4 < abs(one.xi / pressed() - 1.0) < 0.01,
}


def test_each_scene_asks_a_question_and_answers_it():
    assert set(PLAYLIST) == set(CLAIMS)
    for one in PLAYLIST.values():
        question, answer = re.fullmatch(r"([^?]+\?) ([^?]+\.)", one.sentence).groups()
        assert question[0].isupper()
        assert answer[0].isupper()


@pytest.mark.validate
@pytest.mark.parametrize("name", CLAIMS)
def test_the_answer_of_a_scene_is_true(name):
    assert CLAIMS[name](played(name)), (name, played(name).summary)
