"""A state on Matplotlib axes of any kind; test_looks records what is drawn there."""

import gc
import sys
from weakref import ref

import matplotlib.pyplot as plt
import pytest
from matplotlib.collections import TriMesh
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from taichi_disk import run
from taichi_disk.base.errors import InputError


@pytest.fixture(scope="module")
def result():
    return run("exponential_wall", points=60, velocity=0.1, lattices=1)


def meshes(axes):
    return [artist for artist in axes.collections if isinstance(artist, TriMesh)]


def test_a_script_that_imports_pyplot_finds_and_frees_figures(result, monkeypatch):
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    for make in (result.plot, result.draw):
        figure = make()
        assert plt.gcf() is figure
        figure.show()
    plt.close("all")
    figure = ref(figure)
    gc.collect()
    assert figure() is None
    monkeypatch.setitem(sys.modules, "ipykernel", plt)
    result.plot()
    assert plt.get_fignums() == []


def test_a_state_is_drawn_on_given_axes_at_any_moment(result):
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert result.draw("contact", "fringes", left) is figure
    assert result.draw(0.0, ax=right) is figure
    assert "time = 0 R/c" in right.get_title()
    assert all(len(ax.collections) for ax in (left, right))
    with pytest.raises(InputError, match="no moment"):
        result.draw(-1.0)
    with pytest.raises(InputError, match="did you mean pressure"):
        result.draw(colour="presure")


@pytest.mark.parametrize("is_cleared", [False, True])
def test_states_in_a_loop_share_a_colour_bar_and_replace_each_other(result, is_cleared):
    figure = Figure()
    ax = figure.subfigures(1, 2)[0].subplots()
    widths = []
    for t in (0.0, "greatest"):
        if is_cleared:
            ax.clear()
        result.draw(t, ax=ax)
        widths.append(ax.get_position().width)
    assert widths == pytest.approx(widths[:1] * 2)
    assert len(figure.axes) == 2
    assert len(meshes(ax)) == 1
    figure.clear()
    result.draw(ax=figure.subplots())
    assert len(figure.axes) == 2


def test_letters_beside_dark_axes_have_the_axes_colour(result):
    with plt.style.context("dark_background"):
        figure = Figure()
        ax = figure.subplots()
    result.draw(ax=ax)
    _, bar = figure.axes
    letters = [bar.yaxis.label, *bar.get_yticklabels(), ax.title]
    assert {to_rgb(one.get_color()) for one in letters} == {(1.0, 1.0, 1.0)}
