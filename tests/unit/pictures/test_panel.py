"""The curves beside a film: where their values are, in their colours, whole words."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_disk.pictures.curves import FORCE, LOOKS, MOTION
from taichi_disk.pictures.panel import PanelScene, draw_panel
from taichi_disk.pictures.plot import TimeCurve
from taichi_disk.pictures.render.finisher import draw_curves
from taichi_disk.pictures.render.palette import THEMES

NAMES = ("flight", "vibration", "elastic", "wall", "dashpots", "boundary", "friction")
LOOK = LOOKS["elastic"]


def scene(energies=1, letter=20.0, size=(560, 720)):
    t = np.linspace(0.0, 1.0, 2 * size[0])
    curves = [TimeCurve(MOTION, 2.0 * t - 1.0), TimeCurve(FORCE, 1.0 - t)]
    for k in range(energies):
        values = t ** (k + 1)
        curves.append(TimeCurve(LOOK, values, NAMES[k]))
    labels = ["velocity of the centre  [v]", "wall force  [Mc²/R]", "energy  [Mc²]"]
    colours = vars(THEMES["light"]) | {"coming": "#B8B8B7"}
    return PanelScene(t, curves, labels, "time  [R/c]", size, letter, 0, colours)


def test_a_curve_is_at_the_row_of_its_value_grey_before_and_coloured_after():
    shown = scene()
    pictures = draw_panel(shown)
    for curve, box in zip(shown.curves, pictures.boxes, strict=True):
        left, right, top, bottom = box
        ink = np.array([*bytes.fromhex(curve.look.colours[0][1:])])
        low = curve.values.min()
        # Matplotlib's margin above and below the values
        margin = 0.07 * np.ptp(curve.values)
        scale = (bottom - top) / (np.ptp(curve.values) + 2.0 * margin)
        for part in (0.2, 0.5, 0.8):
            column = left + round(part * (right - left))
            value = np.interp(
                (column + 0.5 - left) / (right - left), shown.t, curve.values
            )
            row = bottom - (value - low + margin) * scale
            off = np.abs(pictures.past[top:bottom, column, :3].astype(int) - ink)
            found = np.flatnonzero(off.sum(axis=1) < 40) + top
            assert found.mean() + 0.5 == pytest.approx(row, abs=1.0)
            grey = pictures.coming[found, column, :3].astype(int)
            assert np.abs(grey - [184, 184, 183]).max() < 20


@pytest.mark.parametrize(("letter", "height"), [(20.0, 720), (30.0, 720), (11.0, 360)])
def test_no_word_of_a_panel_is_cut(letter, height):
    size = round(height * 7 / 9), height
    shown = scene(len(NAMES), letter, size)
    long = "a label that is much too long for these axes  [R/c]"
    shown = replace(shown, labels=[long, long, "energy"], time_label=long)
    panel = draw_panel(shown).coming[..., :3]
    for edge in (panel[0], panel[-1], panel[:, 0], panel[:, -1]):
        assert (edge == panel[0, 0]).all()


def test_a_line_stands_at_the_time_between_coloured_and_grey_curves():
    shown = scene()
    shown = replace(shown, t=shown.t + 1.0)
    drawn = draw_panel(shown)
    picture = np.zeros((720, 560, 4), dtype=np.uint8)
    draw_curves(picture, drawn, shown, 1.25)
    left, right, top, bottom = drawn.boxes[0]
    column = left + round(0.25 * (right - left - 1))
    faint = np.rint(255.0 * np.array(shown.colours["faint"]))
    assert (picture[top:bottom, column : column + 2, :3] == faint).all()
    assert (picture[:, :column] == drawn.past[:, :column]).all()
    assert (picture[:, column + 2 :] == drawn.coming[:, column + 2 :]).all()
