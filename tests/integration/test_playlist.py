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


def ends(one, name):
    """Return the first and the last value of a column."""
    return one.series[name][[0, -1]]


def lost(one, cause):
    """Return the energy that a cause has taken over the kinetic energy of the start."""
    return one.series[cause][-1] / one.series["kinetic"][0]


def the_paper_s():
    return played("The paper's bounce")


def absorbing():
    return played("A wall that swallows waves")


def pressed():
    return played("Pressed on the wall").xi


def _bounce(one):
    is_known = one.restitution == pytest.approx(0.93, abs=0.005)
    return is_known and lost(one, "dissipated") == pytest.approx(1.0 / 7.0, abs=0.005)


def _backspin(one):
    before, after = ends(one, "com_vx")
    return before > 0.01 and after < -0.01 and lost(one, "friction") > 0.1


def _slower_is_larger(one):
    fast = played("A bounce")
    ratio = ends(one, "com_vy")[0] / ends(fast, "com_vy")[0]
    return ratio == pytest.approx(0.2) and one.restitution > fast.restitution + 0.01


def _undamped(one):
    e = one.restitution
    is_known = e == pytest.approx(0.996, abs=0.0006) and lost(one, "dissipated") == 0.0
    return is_known and lost(one, "vibration") > 0.5 * (1.0 - e**2)


def _strong(one):
    return 0.35 < lost(one, "dissipated") < 0.4


def _another_side(one):
    return 0.001 < abs(one.restitution - the_paper_s().restitution) < 0.01


def _loses_more(one):
    slow = the_paper_s()
    is_lower = one.restitution < slow.restitution
    return is_lower and lost(one, "dissipated") > lost(slow, "dissipated")


def _no_spin(one):
    before, after = ends(one, "angular_momentum")
    fast, slow = ends(one, "com_vx")
    return abs(before) < 1e-9 and after < -0.01 and 0.0 < slow < fast


def _topspin(one):
    before, after = ends(one, "com_vx")
    down, up = ends(one, "com_vy")
    return after > before and after / up > -before / down


def _smooth(one):
    before, after = ends(one, "angular_momentum")
    return after == pytest.approx(before, rel=0.01) and before > 0.1


def _bent(one):
    before, after = ends(one, "com_vx")
    return abs(before) < 1e-9 and abs(after) > 0.5 * ends(one, "com_vy")[1]


def _hard(one):
    return one.scene.wall.a == 3000.0 and _loses_more(one)


def _swallows(one):
    return lost(one, "absorbed") == pytest.approx(0.1, abs=0.01)


def _reflects(one):
    return one.restitution > 0.995 and lost(one, "absorbed") == 0.0


def _dashpots(one):
    return lost(one, "absorbed") == pytest.approx(2.0 / 3.0, abs=0.02)


def _less_than_rigid(one):
    soft = abs(one.restitution - absorbing().restitution)
    rigid = abs(played("Another side").restitution - the_paper_s().restitution)
    return soft < 0.3 * rigid


def _fast_on_soft(one):
    slow = absorbing()
    is_lower = one.restitution < slow.restitution
    return is_lower and lost(one, "absorbed") > lost(slow, "absorbed")


def _pressed(one):
    return one.xi == pytest.approx(0.0153, abs=5e-5)


def _light(one):
    return one.xi > 0.4 * pressed()


def _heavy(one):
    return one.xi < 2.0 * pressed()


def _other_lattice(one):
    return 1e-4 < abs(one.xi / pressed() - 1.0) < 0.01


CLAIMS: dict[str, Callable[[api.Result], bool]] = {
    "A bounce": _bounce,
    "Backspin": _backspin,
    "The paper's bounce": _slower_is_larger,
    "No dashpots": _undamped,
    "Strong dashpots": _strong,
    "Another side": _another_side,
    "A fast bounce": _loses_more,
    "No spin": _no_spin,
    "Topspin": _topspin,
    "A smooth wall": _smooth,
    "Spin bends the bounce": _bent,
    "A hard wall": _hard,
    "A wall that swallows waves": _swallows,
    "A wall that reflects": _reflects,
    "Dashpots at the boundary": _dashpots,
    "Another side on it": _less_than_rigid,
    "Fast on the soft wall": _fast_on_soft,
    "Pressed on the wall": _pressed,
    "A light load": _light,
    "A heavy load": _heavy,
    "Another lattice": _other_lattice,
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
