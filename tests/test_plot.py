"""plot.png: the curves are the run's numbers, named and with units, and the same bytes each time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from taichi_disk import plot

IMPACT = {"restitution": 0.9, "contact_time": 4.0}


def impact_columns() -> dict[str, NDArray[np.float64]]:
    """A bounce made up: v_cm from -0.02 to 0.018, with an energy that is lost and an imbalance of 1e-6."""
    t = np.linspace(0.0, 10.0, 300)
    swing = 0.5 + 0.5 * np.tanh(t - 5.0)
    names = ("com_x", "com_vx", "angular_momentum", "absorbed", "load")
    columns = {name: np.zeros_like(t) for name in names} | {"t": t, "com_y": 1.0 + np.abs(t - 5.0) / 50}
    columns["lowest_y"] = columns["com_y"] - 1.0
    columns["com_vy"] = -0.02 + 0.038 * swing
    columns["wall_force"] = np.gradient(columns["com_vy"], t)
    columns["kinetic"] = 0.5 * columns["com_vy"] ** 2
    columns["dissipated"] = 0.5 * (0.02**2 - 0.018**2) * swing
    columns["wall"] = 1e-5 * np.exp(-((t - 5.0) ** 2))
    columns["elastic"] = 2e-4 - columns["kinetic"] - columns["dissipated"] - columns["wall"]
    columns["total"] = 2e-4 * (1.0 + 1e-6 * swing)
    return columns


def pressed_columns(moving: bool) -> dict[str, NDArray[np.float64]]:
    """A made-up vibration that dies out as exp(-t/5) about xi = 0.015, or a walk to equilibrium."""
    t = np.linspace(0.0, 400.0 if moving else 1.0, 4000)
    xi = 0.015 * (1.0 - np.cos(t) * np.exp(-t / 5.0)) if moving else 0.015 * t
    zero = np.zeros_like(t)
    columns = {name: zero for name in ("com_x", "com_vx", "com_vy", "angular_momentum", "dissipated", "absorbed")}
    columns |= {"t": t, "com_y": 1.02 - xi, "lowest_y": zero + 0.02, "wall_force": 0.6 * xi, "elastic": xi**2}
    columns |= {
        "kinetic": 1e-4 * np.exp(-t / 2.5) if moving else zero,
        "wall": 1e-5 + zero,
        "load": 0.01 * (1.02 - xi),
    }
    columns["total"] = columns["elastic"] + columns["kinetic"] + columns["wall"] + columns["load"]
    return columns | ({"residual": np.exp(-t / 5.0)} if moving else {})


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that plot_run makes."""
    made: list[Figure] = []

    def make(*given: object, **options: object) -> Figure:
        made.append(Figure(*given, **options))  # type: ignore[arg-type]
        return made[-1]

    monkeypatch.setattr(plot, "Figure", make)
    return made


def test_the_same_run_gives_the_same_bytes_and_nothing_else(tmp_path: Path) -> None:
    first, second = tmp_path / "a.png", tmp_path / "b.png"
    for path in (first, second):
        plot.plot_run(path, "exponential_wall", impact_columns(), IMPACT, "v = 0.02 c, η* = 10")
    assert first.read_bytes() == second.read_bytes()
    assert sorted(tmp_path.iterdir()) == [first, second]
    image = np.asarray(Image.open(first).convert("L"))
    assert image.shape == (1104, 912)
    # Nothing is cut off: the outermost pixels are white.
    assert min(edge.min() for edge in (image[0], image[-1], image[:, 0], image[:, -1])) == 255


def test_an_impact_shows_velocity_force_energies_and_imbalance(tmp_path: Path, figures: list[Figure]) -> None:
    columns = impact_columns()
    plot.plot_run(tmp_path / "a.png", "absorbing_wall", columns, IMPACT, "title")
    motion, force, energy, balance = figures[0].axes
    curve, mark = motion.lines
    assert curve.get_ydata()[[0, -1]] == pytest.approx([-1.0, 0.9], abs=1e-3)  # v_cm/v
    assert mark.get_ydata() == [0.9, 0.9]
    assert "e = 0.90000" in [text.get_text() for text in motion.texts]
    assert np.array_equal(force.lines[0].get_ydata(), columns["wall_force"])
    shown = {line.get_label(): line.get_ydata() for line in energy.lines}
    # What this run has not (nothing absorbed, no load) is not shown; the parts add up to the sum shown.
    assert list(shown) == ["kinetic", "elastic", "wall potential", "dissipated by dashpots", "sum of all"]
    assert sum(list(shown.values())[:-1]) == pytest.approx(shown["sum of all"], rel=2e-6)
    assert balance.lines[0].get_ydata()[-1] == pytest.approx(1e-6, rel=1e-3)  # of the initial kinetic energy
    for ax in (force, energy):
        assert "[Mc²" in ax.get_ylabel()
    assert "[R/c]" in balance.get_xlabel()


def test_a_compression_shows_xi_until_the_vibration_has_died_out(tmp_path: Path, figures: list[Figure]) -> None:
    plot.plot_run(tmp_path / "a.png", "compression", pressed_columns(True), {"xi": 0.015}, "title")
    depth, _, energy, rest = figures[0].axes
    assert depth.lines[0].get_ydata()[[0, -1]] == pytest.approx([0.0, 0.015], abs=1e-9)
    assert depth.lines[1].get_ydata() == [0.015, 0.015]
    # exp(-t/2.5) = 1e-8 at t = 46.05
    assert rest.get_xlim() == pytest.approx((0.0, 46.05), abs=0.2)
    assert rest.get_yscale() == "log"
    assert energy.lines[-1].get_ydata()[0] == pytest.approx(1e-4 + 1e-5)  # the load is counted from its start


def test_an_equilibrium_without_time_is_not_drawn_over_time(tmp_path: Path, figures: list[Figure]) -> None:
    plot.plot_run(tmp_path / "a.png", "compression", pressed_columns(False), {"xi": 0.015}, "title")
    assert len(figures[0].axes) == 3
    assert "[R/c]" not in figures[0].axes[-1].get_xlabel()
    assert figures[0].axes[-1].get_xlim() == (0.0, 1.0)
