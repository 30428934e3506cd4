"""Words and scales of pictures: large enough, whole, and apart."""

from pathlib import Path

import pytest
from matplotlib import font_manager, get_data_path

from taichi_disk.pictures.render.letters import Letters, lacking
from taichi_disk.pictures.render.words import label, round_below


def test_numbers_are_written_as_in_print():
    assert label(-5.0, signed=True) == "−5"
    assert label(2e-7) == "2·10⁻⁷"
    assert label(0.0) == "0"
    assert label(0.5, signed=True) == "+0.5"


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
