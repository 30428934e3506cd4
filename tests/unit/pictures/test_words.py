"""Words and scales of pictures: large enough, whole, and apart."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import font_manager, get_data_path

from taichi_disk import load_scene
from taichi_disk.pictures.render.letters import Letters, lacking
from taichi_disk.pictures.render.moments import Caption
from taichi_disk.pictures.render.pictures import Disk, arranged
from taichi_disk.pictures.render.words import Title, round_below


@pytest.mark.parametrize("value", [0.0123, 9.2, 2.3e-5, 1e-12, 999.9999999999999])
def test_the_arrow_of_the_scale_stands_for_a_round_force(value):
    below = round_below(value)
    assert value / 2.5 < below <= value
    assert f"{below:.6e}"[:8] in ("1.000000", "2.000000", "5.000000")


def test_letters_that_the_font_lacks_come_from_a_font_of_the_system(monkeypatch):
    monkeypatch.setattr(font_manager, "findSystemFonts", list)
    assert lacking("η* = 100, ξ, Mc²/R, −5") == ""
    assert lacking("盤 a 盤") == "盤盤"
    assert lacking("ᶁ") == "ᶁ"
    others = Path(get_data_path()) / "fonts/ttf/STIXGeneral.ttf"
    monkeypatch.setattr(font_manager, "findSystemFonts", lambda: [str(others)])
    face = Letters(720).text
    assert face.font("ᶁ = 5").path == others
    assert face.font("η* = 5").path == face.font("a").path != others
    assert lacking("ᶁ = 5") == ""


@pytest.mark.parametrize("width", [3.8, 8.0])
def test_words_leave_room_for_a_disk_and_an_elastic_wall(width):
    scenario = load_scene("absorbing_wall", ["lattice.points=60"]).scenario()
    heading, *others = scenario.words.title
    parameters = "    ".join(others).split("    ")
    title = Title(heading, parameters, ("grey: range of the contact force",))
    captions = [
        Caption(2.05, "greatest compression", (), ("t = 2.05 R/c", "0.00 v")),
        Caption(5.6, lines=("after t = 5.6 R/c",), result="e = 0.967"),
    ]
    angle = np.linspace(0.0, 2.0 * np.pi, 90)
    disks = [
        np.column_stack([np.sin(angle), height + np.cos(angle)])
        for height in (0.95, 1.33)
    ]
    wall = SimpleNamespace(has_elastic_wall=True)
    letters = Letters(720)
    view = (-0.5 * width, 0.5 * width, -0.5, 2.33)
    camera, (legend,) = arranged(
        [Disk(wall, title, captions, disks)], 720, letters, view
    )
    assert 2.0 * camera.scale > 0.48 * 720 * 3.8 / width
    _, surface = camera.to_pixels([0.0, 0.0])
    _, bottom = camera.to_pixels([0.0, -0.5])
    assert bottom <= 720 - letters.footer
    columns, rows = camera.to_pixels(np.concatenate(disks)).T
    for left, right, high, low in legend.boxes:
        assert low < surface or high > bottom
        is_inside = (left < columns) & (columns < right) & (high < rows) & (rows < low)
        assert not is_inside.any()
