"""The panel of the sandbox: where its controls are, and what a pointer does on them. Without a window."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import combinations
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest

from taichi_disk.render.legend import text_width
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.controls import Button, Slider
from taichi_disk.window.scene_view import PANEL, SIZE
from taichi_disk.window.session import LEAST, Session, laid_out

TABLET = (1024, 768)


@pytest.fixture
def opened(kernels: KernelCache, tmp_path: Path) -> Callable[..., Session]:
    def make(scene: str = "exponential_wall", size: tuple[int, int] = SIZE) -> Session:
        settings = ["lattice.points=120"] + ["wall.points=150"] * (scene == "absorbing_wall")
        session = Session([(scene, partial(load_scene, scene, settings))], tmp_path / "out", kernels)
        session.draw(MagicMock(), size)
        return session

    return make


def show(session: Session, size: tuple[int, int] = SIZE) -> None:
    """A picture, in which all is done that is pending."""
    session.picture(MagicMock(), size, lambda: np.zeros((*size, 4), np.float32))


def places(session: Session) -> dict[str, tuple[tuple[float, float, float, float], Button | Slider]]:
    return {getattr(one, "key", one.label): (box, one) for box, one in session.panel.areas}


def value_of(session: Session, name: str) -> float:
    return next(one.value for one in session.controls.sliders("Experiment") if one.label == name)


def click(session: Session, name: str, part: float = 0.5) -> None:
    left, top, right, bottom = places(session)[name][0]
    session.press((left + part * (right - left), (top + bottom) / 2))
    session.release()
    show(session)


@pytest.mark.parametrize("scene", ["exponential_wall", "absorbing_wall"])
@pytest.mark.parametrize(
    "size", [SIZE, pytest.param(TABLET, marks=pytest.mark.validate), LEAST], ids=["window", "tablet", "least"]
)
def test_controls_lie_in_the_panel_apart_and_hold_their_text(
    opened: Callable[..., Session], scene: str, size: tuple[int, int]
) -> None:
    areas = list(places(opened(scene, size)).values())
    assert len(areas) >= 20
    for (left, top, right, bottom), one in areas:
        assert 0 <= left < right <= PANEL and 0 <= top < bottom <= size[1] - 4 * 17  # four lines of numbers below
        assert bottom - top >= (32 if size == LEAST else 40) and right - left >= 40
        if isinstance(one, Button):
            assert text_width(one.label, 11.0) < right - left - 6
            assert text_width(f"{one.value}  {one.key[:1]}", 11.0) < right - left - 6
    for (one, _), (other, _) in combinations(areas, 2):
        assert one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]


@pytest.mark.parametrize(
    ("scene", "labels"),
    [
        ("compression", ["η*", "P", "wall a", "points"]),
        ("exponential_wall", ["η*", "v / c", "angle", "spin", "friction", "wall a", "points"]),
        ("absorbing_wall", ["η*", "v / c", "angle", "spin", "wall a", "points"]),
    ],
)
def test_a_scene_has_the_sliders_of_its_own_keys(opened: Callable[..., Session], scene: str, labels: list[str]) -> None:
    assert [one.label for one in opened(scene).controls.sliders("Experiment")] == labels


def test_every_button_does_what_its_key_does(opened: Callable[..., Session]) -> None:
    session = opened("absorbing_wall")
    heard: list[str] = []
    session.controls.press = heard.append  # type: ignore[method-assign]
    buttons = [name for name, (_, one) in places(session).items() if isinstance(one, Button)]
    for name in buttons:
        click(session, name)
    assert heard == buttons and set(buttons) < set(session.controls.actions)


def test_a_slider_goes_from_end_to_end_and_stands_where_it_was_led(opened: Callable[..., Session]) -> None:
    session = opened()
    ends = {"η*": (0.0, 100.0), "v / c": (1e-3, 0.1), "wall a": (10.0, 3000.0), "points": (100, 5000)}
    for name, expected in ends.items():
        found = []
        for part in (0.0, 0.999):
            (left, _, right, bottom), _ = places(session)[name]
            session.press((left + 0.3 * (right - left), bottom - 1.0))
            session.move((left + (2.0 * part - 0.5) * (right - left), 400.0))  # beyond the end, and off the slider
            if name == "points":
                show(session)  # a lattice waits until the button is up
                assert session.sandbox.scene.lattice.points in (120, found[0] if found else 120)
            session.release()
            show(session)
            found.append(value_of(session, name))
        assert found == pytest.approx(expected)
        click(session, name, 0.4)
        value, low, high = value_of(session, name), *expected
        part = np.log(value / low) / np.log(high / low) if low else (value - low) / (high - low)
        assert part == pytest.approx(0.4, abs=0.02)


def test_the_pointer_beside_the_panel_turns_the_disk_and_the_wheel_brings_it_closer(
    opened: Callable[..., Session],
) -> None:
    session = opened()
    session.press((780.0, 200.0))
    session.move((880.0, 260.0))
    session.release()
    assert abs(session.sandbox.scene.impact.turn) > 0.1  # type: ignore[attr-defined]
    show(session)
    scale, at = session.view.camera.scale, (800.0, 300.0)
    there = session.view.point_at(*at)
    session.wheel(at, -60.0)
    assert session.view.camera.scale == pytest.approx(1.12 * scale) and session.view.point_at(*at) == pytest.approx(
        there
    )


def test_a_held_key_repeats_until_it_goes_up(opened: Callable[..., Session], monkeypatch: pytest.MonkeyPatch) -> None:
    session, clock = opened(), [0.0]
    monkeypatch.setattr("taichi_disk.window.session.perf_counter", lambda: clock[0])
    speeds = []
    session.key_down("f")
    for _ in range(10):
        clock[0] += 0.1
        show(session)
        speeds.append(session.sandbox.speed)
    session.key_up("f")
    show(session)
    assert speeds[:3] == [1.12] * 3 and 1.12**7 < speeds[-1] == session.sandbox.speed
    assert session.busy  # scales still grow for some pictures
    for _ in range(8):
        show(session)
    assert not session.busy


@pytest.mark.parametrize("shown", [(1400, 900), (800, 600), (390, 800), (1, 1), (8192, 140), (185, 8192)])
def test_a_picture_is_laid_out_for_enough_pixels_and_not_for_too_many(shown: tuple[int, int]) -> None:
    width, height = laid_out(*shown, 3e6)
    assert width * height < 3.1e6 and max(width, height) < 16384
    if min(shown) > 300:
        assert (
            width >= LEAST[0] and height >= LEAST[1] and width / height == pytest.approx(shown[0] / shown[1], rel=0.01)
        )
