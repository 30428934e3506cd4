"""plot.png: the curves are the data of the run, with names and units, and the same
bytes each time."""

import filecmp
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import matplotlib
import numpy as np
import pytest
from bodies import computed, disk
from PIL import Image

from taichi_disk import runtime
from taichi_disk.computation.contact import results_time
from taichi_disk.computation.outcome import compute
from taichi_disk.lattice import Lattice, bulk_moduli
from taichi_disk.output.artist import drawing_process
from taichi_disk.output.plot import matplotlib_style, plot_run, plot_scene, run_figure
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import shared_kernels


@pytest.fixture(scope="module")
def impact():
    """Return scenario and time series of an impact."""
    runtime.start()
    scenario, outcome = computed(
        shared_kernels(), "exponential_wall", "lattice.points=100", estimate=False
    )
    return scenario, outcome.series


def test_an_impact_shows_velocity_force_and_energies_with_the_same_bytes_twice(
    impact, tmp_path
):
    scenario, columns = impact
    for name in ("a.png", "b.png"):
        plot_run(tmp_path / name, plot_scene(scenario, columns))
    assert filecmp.cmp(tmp_path / "a.png", tmp_path / "b.png", shallow=False)
    assert len(list(tmp_path.iterdir())) == 2
    image = np.asarray(Image.open(tmp_path / "a.png").convert("L"))
    # Nothing is cut off: the outermost pixels are white.
    for edge in (image[0], image[-1], image[:, 0], image[:, -1]):
        assert edge.min() == 255

    motion, force, energy, balance = run_figure(plot_scene(scenario, columns)).axes
    curve, mark = motion.lines
    e = scenario.result(columns)["restitution"]
    last = columns["com_vy"][-1] / scenario.velocity
    assert curve.get_ydata()[[0, -1]] == pytest.approx([-1.0, last])
    assert list(mark.get_ydata()) == pytest.approx([last] * 2)
    assert [text.get_text() for text in motion.texts] == [f"e = {e:.3f}"]
    assert "contact" in force.texts[0].get_text()
    assert np.array_equal(force.lines[0].get_ydata(), columns["wall_force"])
    shown = {line.get_label(): line.get_ydata() for line in energy.lines}
    # Energies that this run does not have (absorbed, load, rotation) are not shown; the
    # others add up to the sum.
    *parts, left, total = shown
    assert parts == ["flight", "vibration", "elastic", "wall", "dashpots"]
    assert total == "sum of all"
    assert sum(shown[name] for name in parts) == pytest.approx(shown[total], rel=1e-3)
    stored = columns["vibration"] + columns["elastic"]
    stored = np.interp(results_time(columns), columns["t"], stored)
    assert left.startswith("vibration left ")
    assert shown[left][0] == pytest.approx(stored)
    for ax, unit in ((force, "[Mc²"), (energy, "[Mc²")):
        assert unit in ax.get_ylabel()
    assert "[R/c]" in balance.get_xlabel()


def test_a_loading_shows_load_and_energy_against_the_compression_and_the_law(kernels):
    # This loading ends just before xi = 0.0175 R, the last number of its axis.
    settings = ("lattice.points=200", "compression.method=newton")
    scenario, outcome = computed(kernels, "compression", *settings)
    columns = outcome.series
    figure = run_figure(plot_scene(scenario, columns))
    force, energy = figure.axes
    points, paper, exact = (line.get_xydata().T for line in force.lines[:3])
    assert np.array_equal(points, [columns["xi"], columns["wall_force"]])
    assert points.shape == (2, 24)
    times = scenario.frame_times(columns, 3)
    assert times == pytest.approx([columns["t"][0], 0.5 * (1.0 + times[0]), 1.0])
    _, *laws = (text.get_text() for text in force.get_legend().get_texts())
    assert laws == ["eq. (2), b = 1", "exact law, rigid wall"]
    moduli = bulk_moduli(200, 0, 1.0, 0.7)
    nu = moduli.poisson
    p = 1e-2 / (np.pi * moduli.young)
    assert paper[:, -1] == pytest.approx([p * (np.log(4.0 / p) - 1.0 - nu), 1e-2])
    expected = p * (np.log(1.0 / p) - (1.0 + nu) / 4.0)
    assert exact[:, -1] == pytest.approx([expected, 1e-2])
    (text,) = force.texts
    assert text.get_text() == f"ξ = {columns['xi'][-1]:.3g} R"
    assert energy.get_xlabel().endswith("[R]")
    elastic, wall, stored = (line.get_ydata() for line in energy.lines)
    assert stored == pytest.approx(elastic + wall)
    assert np.array_equal(wall, columns["wall"])
    _, end = energy.get_xlim()
    labels = energy.get_xticklabels()
    labels = [each for each in labels if each.get_position()[0] <= end]
    assert labels[-1].get_text() == "0.0175"
    assert labels[-1].get_window_extent().x1 < figure.bbox.x1  # it is not cut off


def test_the_curve_of_a_compression_rises_from_0_to_the_result(kernels):
    settings = ("lattice.points=60", "compression.pressure=0.01")
    scenario, outcome = computed(kernels, "compression", *settings, estimate=False)
    columns = outcome.series
    motion = run_figure(plot_scene(scenario, columns)).axes[0]
    shown = motion.lines[0].get_ydata()
    xi = scenario.result(columns)["xi"]
    assert shown[[0, -1]] == pytest.approx([0.0, xi], abs=1e-4 * xi)
    last = {name: values[-1] for name, values in columns.items()}
    assert scenario.momentary_motion(last) == pytest.approx(xi, rel=1e-4)


@pytest.mark.validate
def test_no_law_is_drawn_for_points_of_unknown_moduli(kernels):
    scene = load_scene("compression", ["compression.method=newton"])
    scenario = scene.scenario(Lattice.from_points(disk(60).positions))
    columns = compute(scenario).series
    figure = run_figure(plot_scene(scenario, columns))
    (text,) = figure.axes[0].get_legend().get_texts()
    assert text.get_text() == "equilibria"


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


def test_matplotlib_is_not_imported_for_names_and_colours_of_the_curves():
    code = "import sys, taichi_disk.render.palette; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "False"
