"""plot.png: the curves are the run's numbers, named and with units, and the same bytes each time."""

from __future__ import annotations

import filecmp
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bodies import computed
from matplotlib import figure
from PIL import Image

from taichi_disk.output.plot import matplotlib_style, plot_run


@pytest.fixture
def figures(monkeypatch):
    """The figures that plot_run makes."""
    made = []

    class Kept(figure.Figure):
        def __init__(self, *given, **options):
            super().__init__(*given, **options)
            made.append(self)

    monkeypatch.setattr(figure, "Figure", Kept)
    return made


def test_an_impact_shows_velocity_force_energies_and_imbalance_with_the_same_bytes_twice(kernels, tmp_path, figures):
    scenario, outcome = computed(kernels, "exponential_wall", "lattice.points=100")
    columns = outcome.columns
    for name in ("a.png", "b.png"):
        plot_run(tmp_path / name, scenario, columns)
    assert filecmp.cmp(tmp_path / "a.png", tmp_path / "b.png", shallow=False) and len(list(tmp_path.iterdir())) == 2
    image = np.asarray(Image.open(tmp_path / "a.png").convert("L"))
    # Nothing is cut off: the outermost pixels are white.
    assert min(edge.min() for edge in (image[0], image[-1], image[:, 0], image[:, -1])) == 255

    motion, force, energy, balance = figures[0].axes
    curve, mark = motion.lines
    e = scenario.result(columns)["restitution"]
    assert curve.get_ydata()[[0, -1]] == pytest.approx([-1.0, e]) and list(mark.get_ydata()) == pytest.approx([e, e])
    assert [text.get_text() for text in motion.texts] == [f"e = {e:.5f}"]
    assert "contact" in force.texts[0].get_text()
    assert np.array_equal(force.lines[0].get_ydata(), columns["wall_force"])
    shown = {line.get_label(): line.get_ydata() for line in energy.lines}
    # What this run has not (nothing absorbed, no load) is not shown; the parts add up to the sum shown.
    assert list(shown) == ["kinetic", "elastic", "wall potential", "lost in dashpots", "sum of all"]
    assert sum(list(shown.values())[:-1]) == pytest.approx(shown["sum of all"], rel=1e-9)
    for ax, unit in ((force, "[Mc²"), (energy, "[Mc²")):
        assert unit in ax.get_ylabel()
    assert "[R/c]" in balance.get_xlabel()


def test_an_equilibrium_without_time_is_not_drawn_over_time_and_its_load_counts_from_its_start(
    kernels, tmp_path, figures
):
    scenario, outcome = computed(kernels, "compression", "lattice.points=100", "compression.method=newton")
    plot_run(tmp_path / "a.png", scenario, outcome.columns)
    depth, energy = figures[0].axes[0], figures[0].axes[2]
    assert len(figures[0].axes) == 3 and depth.get_xlim() == (0.0, 1.0)
    assert "[R/c]" not in figures[0].axes[-1].get_xlabel()
    assert depth.lines[0].get_ydata()[[0, -1]] == pytest.approx([0.0, scenario.result(outcome.columns)["xi"]], abs=1e-9)
    assert depth.texts[0].xy[0] == 0.02  # where the curve is not
    load = next(line.get_ydata() for line in energy.lines if line.get_label() == "load potential")
    assert load[0] == 0.0 and load[-1] < 0.0


def test_plots_drawn_by_threads_beside_other_styles_have_the_same_bytes(kernels, tmp_path):
    scenario, outcome = computed(kernels, "exponential_wall", "lattice.points=100")

    def draw(name: str) -> bytes:
        with matplotlib_style({"font.size": 5.0, "lines.linewidth": 9.0}):
            time.sleep(0.01)
        plot_run(tmp_path / name, scenario, outcome.columns)
        return (tmp_path / name).read_bytes()

    alone = draw("a.png")
    with ThreadPoolExecutor(3) as threads:
        assert set(threads.map(draw, ("b.png", "c.png", "d.png"))) == {alone}


def test_matplotlib_is_not_imported_for_names_and_colours_of_the_curves():
    code = "import sys, taichi_disk.render.palette; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "False"
