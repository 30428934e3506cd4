"""What the sandbox's list of scenes claims, against the numbers of the scenes."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from taichi_disk import api
from taichi_disk.window.app import list_presets

PLAYLIST = {one.name: one for one in list_presets(None)}


@dataclass(frozen=True)
class Numbers:
    """What a scene of the list has become.

    Attributes:
        e, xi: restitution, compression [R]; 0 if it has none.
        lost: energies that dashpots, the boundary and friction have taken, over the
            kinetic energy of the start, by name.
        vibration: the rest of the kinetic energy at the end, in the same unit.
        before, after: velocity (x, y) of the centre of mass [c].
        spin: angular momentum before and after [M c R].
    """

    e: float
    xi: float
    lost: dict[str, float]
    vibration: float
    before: tuple[float, float]
    after: tuple[float, float]
    spin: tuple[float, float]


class Scenes:
    """The numbers of scenes by name, computed when first asked for."""

    def __init__(self, folder):
        self._folder = folder
        self._known: dict[str, Numbers] = {}

    def __getitem__(self, name: str) -> Numbers:
        if name not in self._known:
            self._known[name] = self._computed(name)
        return self._known[name]

    def _computed(self, name: str) -> Numbers:
        scene = PLAYLIST[name].load()
        folder = self._folder / re.sub(r"\W", "_", name)
        result = api.run(scene, folder, video=False, lattices=1)
        series = result.series
        kinetic = series["kinetic"][0] or 1.0
        return Numbers(
            e=result.summary.get("restitution", 0.0),
            xi=result.summary.get("xi", 0.0),
            lost={
                cause: series[cause][-1] / kinetic
                for cause in ("dissipated", "absorbed", "friction")
                if cause in series
            },
            vibration=series["vibration"][-1] / kinetic,
            before=(series["com_vx"][0], series["com_vy"][0]),
            after=(series["com_vx"][-1], series["com_vy"][-1]),
            spin=(series["angular_momentum"][0], series["angular_momentum"][-1]),
        )


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    return Scenes(tmp_path_factory.mktemp("playlist"))


def _bounce(one, _):
    return one.e == pytest.approx(0.93, abs=0.005) and one.lost[
        "dissipated"
    ] == pytest.approx(1.0 / 7.0, abs=0.005)


def _backspin(one, _):
    return one.before[0] > 0.01 and one.after[0] < -0.01 and one.lost["friction"] > 0.1


def _slower_is_larger(one, of):
    fast = of["A bounce"]
    ratio = one.before[1] / fast.before[1]
    return ratio == pytest.approx(0.2) and one.e > fast.e + 0.01


def _undamped(one, _):
    return (
        one.lost["dissipated"] == 0.0
        and one.e == pytest.approx(0.996, abs=0.0006)
        and one.vibration > 0.5 * (1.0 - one.e**2)
    )


def _strong(one, _):
    return 0.35 < one.lost["dissipated"] < 0.4


def _another_side(one, of):
    return 0.001 < abs(one.e - of["The paper's bounce"].e) < 0.01


def _fast(one, of):
    slow = of["The paper's bounce"]
    return one.e < slow.e and one.lost["dissipated"] > slow.lost["dissipated"]


def _no_spin(one, _):
    is_slower = 0.0 < one.after[0] < one.before[0]
    return abs(one.spin[0]) < 1e-9 and one.spin[1] < -0.01 and is_slower


def _topspin(one, _):
    flatter = one.after[0] / one.after[1] > -one.before[0] / one.before[1]
    return one.after[0] > one.before[0] and flatter


def _smooth(one, _):
    return one.spin[1] == pytest.approx(one.spin[0], rel=0.01) and one.spin[0] > 0.1


def _bent(one, _):
    was_straight = abs(one.before[0]) < 1e-9
    return was_straight and abs(one.after[0]) > 0.5 * one.after[1]


def _hard(one, of):
    soft = of["The paper's bounce"]
    ratio = PLAYLIST["A hard wall"].load().wall.a / 300.0
    more = one.lost["dissipated"] > soft.lost["dissipated"]
    return ratio == 10.0 and one.e < soft.e and more


def _swallows(one, _):
    return one.lost["absorbed"] == pytest.approx(0.1, abs=0.01)


def _reflects(one, _):
    return one.e > 0.995 and one.lost["absorbed"] == 0.0


def _dashpots(one, _):
    return one.lost["absorbed"] == pytest.approx(2.0 / 3.0, abs=0.02)


def _less_than_rigid(one, of):
    soft = abs(one.e - of["A wall that swallows waves"].e)
    rigid = abs(of["Another side"].e - of["The paper's bounce"].e)
    return soft < 0.3 * rigid


def _fast_on_soft(one, of):
    slow = of["A wall that swallows waves"]
    return one.e < slow.e and one.lost["absorbed"] > slow.lost["absorbed"]


def _pressed(one, _):
    return one.xi == pytest.approx(0.0153, abs=5e-5)


def _light(one, of):
    return one.xi > 0.4 * of["Pressed on the wall"].xi


def _heavy(one, of):
    return one.xi < 2.0 * of["Pressed on the wall"].xi


def _other_lattice(one, of):
    relative = one.xi / of["Pressed on the wall"].xi - 1.0
    return 1e-4 < abs(relative) < 0.01


CLAIMS: dict[str, Callable[[Numbers, Scenes], bool]] = {
    "A bounce": _bounce,
    "Backspin": _backspin,
    "The paper's bounce": _slower_is_larger,
    "No dashpots": _undamped,
    "Strong dashpots": _strong,
    "Another side": _another_side,
    "A fast bounce": _fast,
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
def test_the_answer_of_a_scene_is_true(scenes, name):
    assert CLAIMS[name](scenes[name], scenes), (name, scenes[name])
