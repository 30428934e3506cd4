"""plot.png: the run's data, with names and units, the same bytes each time."""

import filecmp
import os
import re
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from io import BytesIO

import matplotlib
import numpy as np
import pytest
from bodies import computed
from PIL import Image

from taichi_disk.base import runtime
from taichi_disk.base.processes.early import draw_early
from taichi_disk.mechanics.simulation.simulation import shared_kernels
from taichi_disk.pictures.inline import Plot
from taichi_disk.pictures.plot import (
    draw_plot,
    matplotlib_style,
    plot_run,
    plot_scene,
    run_figure,
)
from taichi_disk.pictures.render.artist import drawing_process


@pytest.fixture(scope="module")
def impact():
    """Return scenario and time series of an impact."""
    runtime.start()
    scenario, outcome = computed(
        shared_kernels(), "exponential_wall", "lattice.points=100", estimate=False
    )
    return scenario, outcome.series


def test_a_plot_is_whole_and_has_the_same_bytes_if_drawn_early(
    impact, tmp_path, monkeypatch
):
    scene = plot_scene(*impact)
    plot_run(tmp_path / "a.png", scene, "e = 0.97")
    draw_early(draw_plot, scene)
    monkeypatch.setattr("taichi_disk.pictures.plot._draw_run", None)
    plot_run(tmp_path / "b.png", scene, "e = 0.97")
    assert filecmp.cmp(tmp_path / "a.png", tmp_path / "b.png", shallow=False)
    assert len(list(tmp_path.iterdir())) == 2
    image = np.asarray(Image.open(tmp_path / "a.png").convert("L"))
    # Nothing is cut off: the outermost pixels are white.
    for edge in (image[0], image[-1], image[:, 0], image[:, -1]):
        assert edge.min() == 255


@pytest.mark.parametrize("parts", [1, 24])
def test_a_title_of_any_length_is_above_axes_and_breaks_between_parts(impact, parts):
    scene = plot_scene(*impact)
    title = (*scene.words.title, "    ".join(["spin = 0.4 c/R"] * parts), "x" * 250)
    scene = replace(scene, words=replace(scene.words, title=title))
    figure = run_figure(scene, 9 * "restitution e ")
    words = figure._suptitle.get_window_extent()
    assert words.y0 > figure.axes[0].get_window_extent().y1
    assert words.y1 < figure.bbox.y1
    assert not re.search(r"=\n|0.4\n", figure.get_suptitle())


@pytest.mark.validate
def test_plots_by_threads_with_other_styles_and_by_another_process_have_the_same_bytes(
    impact, tmp_path, monkeypatch
):
    # This includes a user whose settings need LaTeX, or make a plot of 36 MB.
    monkeypatch.setitem(matplotlib.rcParams, "text.usetex", True)
    monkeypatch.setitem(matplotlib.rcParams, "savefig.dpi", 900)

    def draw(name):
        with matplotlib_style({"font.size": 5.0, "lines.linewidth": 9.0}):
            time.sleep(0.01)
        plot_run(tmp_path / name, plot_scene(*impact))
        return (tmp_path / name).read_bytes()

    with ThreadPoolExecutor(2) as threads:
        first, second = threads.map(draw, ("a.png", "b.png"))
    assert first == second
    assert len(first) < 500_000
    # also if that process fails
    pythons = {sys.executable: True, "/nowhere/python": False, "/bin/false": False}
    for python, is_elsewhere in pythons.items():
        monkeypatch.setattr(sys, "executable", python)
        (tmp_path / "b.png").unlink()
        with drawing_process(film=True) as artist:
            process = artist.begin(os.getpid)
            artist.begin(plot_run, tmp_path / "b.png", plot_scene(*impact))()
            assert (process() != os.getpid()) == is_elsewhere
        assert (tmp_path / "b.png").read_bytes() == first


PS = pytest.param("ps", b"/FontType 3", marks=pytest.mark.validate)


@pytest.mark.parametrize(("form", "name"), [("pdf", b"/Type3"), PS])
def test_the_fonts_of_a_file_are_those_that_publishers_take(form, name):
    figure = Plot()
    figure.text(0.5, 0.5, "η* = 5")
    file = BytesIO()
    figure.savefig(file, format=form)
    assert name not in file.getvalue()  # type 3 draws letters as paths
