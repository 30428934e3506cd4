"""Fits recover known parameters, and their intervals contain them as often as they
should."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgb

from docs.experiments.quasistatic import quasistatic_impact
from taichi_disk.figures import theory
from taichi_disk.figures.axes import curve_styles
from taichi_disk.figures.curves import (
    FITS,
    Curve,
    analyse,
    curves_figure,
    draw,
)
from taichi_disk.figures.texts import curve_rows
from taichi_disk.scenes import load_scene
from taichi_disk.scenes.compression import paper_compression

V = np.geomspace(3e-3, 5e-2, 12)
P = np.linspace(4e-3, 1e-2, 7)


def test_planted_parameters_of_eq_5_come_back() -> None:
    for d1, d2 in ((0.973, 0.119), (1.0, 0.6), (1.6, 1.4)):
        fit = theory.fit_restitution(V, theory.paper_restitution(V, d1, d2)[None])
        assert fit.values == pytest.approx({"d1": d1, "d2": d2}, rel=1e-6)
        assert fit.rms < 1e-7
        assert not fit.intervals
    fixed = theory.fit_restitution(
        V, theory.paper_restitution(V, 1.0, 0.6)[None], d1_is_1=True
    )
    assert fixed.values == pytest.approx({"d1": 1.0, "d2": 0.6}, rel=1e-6)


def test_a_planted_b_comes_back_and_each_lattice_has_its_own() -> None:
    b = np.array([0.9, 1.5, 2.4])
    fit = theory.fit_b(P, paper_compression(P, 1.1, 0.29, b[:, None]), 1.1, 0.29)
    assert [
        fit.values[f"b_{name}"] for name in ("min", "median", "max")
    ] == pytest.approx(list(b), rel=1e-6)
    low, high = fit.intervals["b"]
    assert 0.9 <= low < fit.values["b"] < high <= 2.4


def test_b_is_never_negative_and_is_0_only_if_the_disk_yields_hardly_at_all() -> None:
    law = paper_compression(P, 1.1, 0.29, 0.9)
    soft = theory.fit_b(P, np.stack([0.5 * law, 0.7 * law]), 1.1, 0.29)
    assert 0.3 < soft.values["b_min"] < soft.values["b"] < soft.values["b_max"] < 0.7
    with np.errstate(all="ignore"):  # (2) has no value at b = 0
        hard = theory.fit_b(P, np.stack([0.1 * law, 0.12 * law]), 1.1, 0.29)
    assert set(hard.values.values()) == {0.0}
    assert hard.intervals["b"] == (0.0, 0.0)


def test_a_planted_tau0_comes_back() -> None:
    e = np.array([[quasistatic_impact(v, 0.0731, 1.1).restitution for v in V]])
    fit = theory.fit_tau0(V, e, 1.1)
    assert fit.values["tau0"] == pytest.approx(0.0731, rel=1e-4)
    assert fit.rms < 1e-6


def test_the_residuals_are_data_minus_fit() -> None:
    e = theory.paper_restitution(V, 1.0, 0.6)
    bump = np.where(np.arange(12) == 5, 1e-3, 0.0)
    fit = theory.fit_restitution(V, np.stack([e + bump, e + bump]))
    # Two parameters at twelve points absorb about a sixth of a single outlier.
    assert 0.7e-3 < fit.residuals[5] < 1e-3


def test_curvature_is_the_second_derivative_of_either_half() -> None:
    y = np.where(V[6] > V, -3.0 * V**2 + V, 2.0 * V**2)
    fit = theory.fit_curvature(V, np.stack([y, y]))
    assert fit.values == pytest.approx({"slow_half": -6.0, "fast_half": 4.0}, rel=1e-8)
    assert fit.rms < 1e-12


def test_intervals_hold_the_truth_about_as_often_as_their_level(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Each lattice deviates by a common factor, which a bootstrap over single points
    # would miss.
    monkeypatch.setattr(theory, "RESAMPLES", 200)
    rng = np.random.default_rng(1)
    true = theory.paper_restitution(V, 1.0, 0.6)
    held = 0
    widths = []
    for _ in range(30):
        e = true * (1.0 + 0.01 * rng.standard_normal((16, 1)))
        low, high = theory.fit_restitution(V, e).intervals["d1"]
        held += low <= 1.0 <= high
        # d1 is the mean of the factors, whose resampled means are about normal: 1.96
        # deviations to either side.
        widths.append(
            (high - low) / (2.0 * 1.96 * (e / true)[:, 0].std() / np.sqrt(16))
        )
    # Binomial(30, 0.95), and 16 lattices make the percentile interval a little narrow.
    assert held >= 23
    assert np.mean(widths) == pytest.approx(1.0, abs=0.08)


@pytest.mark.parametrize("e_star", [1.1, 1.1e4])
def test_the_table_of_eq_4_is_as_good_as_its_integral_at_any_stiffness(
    e_star: float,
) -> None:
    predict = theory.quasistatic_curves((3e-3, 5e-2), e_star)
    unit = e_star**-0.5
    for tau0 in (0.0, 3e-3 * unit, 0.0412 * unit, 0.33 * unit, 1.7 * unit):
        exact = [quasistatic_impact(v, tau0, e_star).restitution for v in (3e-3, 5e-2)]
        np.testing.assert_allclose(
            predict(np.array([tau0]))[0], exact, rtol=0, atol=1e-6
        )
    again = theory.quasistatic_curves.__wrapped__((3e-3, 5e-2), e_star)
    assert (again(np.array([0.33 * unit])) == predict(np.array([0.33 * unit]))).all()
    # A fit to data from the table recovers tau0.
    e = np.array([[quasistatic_impact(v, 0.3 * unit, e_star).restitution for v in V]])
    assert theory.fit_tau0(V, e, e_star).values["tau0"] == pytest.approx(
        0.3 * unit, rel=1e-4
    )


def curve_up_to(speed: float, young: float) -> Curve:
    x = np.linspace(0.1, 1.0, 12) * speed
    results = {"restitution": np.ones((2, 12))}
    return Curve({}, x, results, young, 0.3, is_damped=True)


@pytest.mark.parametrize("young", [0.25, 1.0, 4.0])
def test_the_limit_of_eq_4_is_a_speed_of_the_material_and_that_of_eq_5_of_the_paper(
    young: float,
) -> None:
    # 2.2 sqrt(E/M) R, where eq. (4) crushes the disk
    limit = 2.2 * young**0.5
    assert FITS["eq4"].applies(curve_up_to(0.99 * limit, young))
    assert not FITS["eq4"].applies(curve_up_to(1.01 * limit, young))
    # 3.9 c, where the logarithm of eq. (5) changes its sign
    assert FITS["eq5"].applies(curve_up_to(3.89, young))
    assert not FITS["eq5"].applies(curve_up_to(3.91, young))


@pytest.mark.parametrize(("misfit", "holds"), [(2.9, True), (3.1, False)])
def test_a_law_does_not_hold_if_its_residuals_are_several_times_the_scatter(
    misfit: float, holds: bool
) -> None:
    # Residuals that no law of two parameters takes up, and as much scatter as asked.
    law = theory.paper_restitution(V, 1.0, 0.6)
    zigzag = 1e-4 * (-1.0) ** np.arange(12)
    rms = theory.fit_restitution(V, (law + zigzag)[None]).rms
    assert 0.9e-4 < rms < 1e-4
    scatter = rms / misfit * np.array([[-1.0], [1.0]]) / np.sqrt(2.0)
    fit = theory.fit_restitution(V, law + zigzag + scatter)
    assert fit.misfit == pytest.approx(misfit, rel=1e-3)
    assert fit.holds is holds


def test_one_lattice_does_not_tell_whether_a_law_holds() -> None:
    fit = theory.fit_restitution(V, np.linspace(1.0, 0.5, 12)[None])
    assert fit.rms > 1e-3
    assert np.isnan(fit.misfit)
    assert fit.holds


@pytest.mark.validate
def test_print_and_figure_say_of_a_law_that_misses_the_points_that_it_does_not_hold(
    tmp_path: Path,
) -> None:
    rows = thrown(0.0) + thrown(30.0)
    for row in rows[len(rows) // 2 :]:
        row["restitution"] += 0.05 * np.cos(300.0 * row["velocity"])
    scene = load_scene("exponential_wall")
    good, bad = analyse(scene, ["eta_star", "seed", "velocity"], rows)
    assert good.fits["eq5"].holds
    assert not bad.fits["eq5"].holds
    text = "times the scatter: the law does not hold here"
    (_, holding), (_, missing) = curve_rows([good.summary(), bad.summary()])
    assert text not in dict(holding)["eq. (5)"]
    assert text in dict(missing)["eq. (5)"]
    ratio = f"{bad.fits['eq5'].misfit:.1f} times"
    assert ratio in dict(missing)["eq. (5)"]
    (axes,) = curves_figure(scene, [good, bad]).axes
    styles = {}
    for line in axes.get_lines():
        if len(line.get_xdata()) == 80:
            styles[to_hex(line.get_color())] = line.is_dashed()
    assert list(styles.values()) == [False, True]
    _, legend = axes.get_legend_handles_labels()
    assert "eq. (5), d₁ and d₂ fitted" in legend
    assert "eq. (5) where it fails" in legend
    # The widest legends: laws that hold and fail, with the paper's values.
    for several in ([good, bad], [good, good, bad]):
        figure = curves_figure(load_scene("absorbing_wall"), several)
        box = figure.get_tightbbox(figure.canvas.get_renderer())
        assert box.x0 >= 0.0
        assert box.x1 <= figure.get_figwidth()


def contrast_to_white(colour: Any) -> float:
    """Contrast of the Web Content Accessibility Guidelines 2.1."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return 1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05)


@pytest.mark.parametrize("count", [1, 2, 6, 12])
def test_curves_are_seen_on_white_and_grow_lighter_in_their_order(count: int) -> None:
    contrasts = [contrast_to_white(one["color"]) for one in curve_styles(count)]
    assert contrasts == sorted(contrasts, reverse=True)
    assert min(contrasts) >= 3.0
    assert len(set(contrasts)) == count


def pressed(lattices: list[tuple[int, float, float]]) -> list[dict[str, Any]]:
    """Rows of (seed, pressure, E)."""
    numbers = {"xi": 0.01, "xi_nominal": 0.02, "xi_extrapolated": 0.0, "status": "done"}
    return [
        {"seed": seed, "pressure": pressure, "young": young, "poisson": 0.3 * young}
        | numbers
        for seed, pressure, young in lattices
    ]


def test_the_moduli_are_the_mean_over_lattices_however_many_rows_each_has() -> None:
    rows = pressed(
        [(0, 1e-3, 1.0), (0, 2e-3, 1.0), (1, 1e-3, 1.2), (1, 2e-3, 1.2), (0, 3e-3, 1.0)]
    )
    rows.append(rows[2] | {"pressure": 3e-3, "status": "failed", "xi": None})
    (curve,) = analyse(load_scene("compression"), ["seed", "pressure"], rows)
    assert (curve.young, curve.poisson) == (pytest.approx(1.1), pytest.approx(0.33))
    assert curve.y.shape == (1, 3)  # the lattice of which a point failed is left out


def test_the_moduli_are_those_of_all_lattices_of_the_material() -> None:
    single = [row | {"method": "relaxation"} for row in pressed([(0, 1e-3, 1.0)])]
    many = [
        row | {"method": "newton"} for row in pressed([(0, 1e-3, 1.0), (1, 1e-3, 1.2)])
    ]
    other = [
        row | {"method": "newton", "points": 60} for row in pressed([(0, 1e-3, 1.5)])
    ]
    axes = ["points", "method", "seed", "pressure"]
    rows = [row | {"points": 300} for row in single + many] + other
    curves = analyse(load_scene("compression"), axes, rows)
    assert [curve.young for curve in curves] == pytest.approx([1.1, 1.1, 1.5])


def thrown(eta_star: float, name: str = "eta_star") -> list[dict[str, Any]]:
    same = {
        "status": "done",
        "young": 1.1,
        "poisson": 0.3,
        "contact_time": 6.0,
        name: eta_star,
    }
    return [
        {"velocity": v, "seed": seed, "restitution": e * (1.0 + 1e-3 * seed)} | same
        for seed in (0, 1)
        for v, e in zip(
            V, theory.paper_restitution(V, 1.0, 0.01 * eta_star), strict=True
        )
    ]


@pytest.mark.validate
def test_eq_4_is_fitted_where_there_are_dashpots_swept_or_not() -> None:
    axes = ["eta_star", "seed", "velocity"]
    soft, stiff = analyse(
        load_scene("exponential_wall"), axes, thrown(0.0) + thrown(30.0)
    )
    assert "eq4" not in soft.fits
    assert "eq4" in stiff.fits
    assert (
        "eq4"
        in analyse(load_scene("exponential_wall"), axes[1:], thrown(30.0, "other"))[
            0
        ].fits
    )
    undamped = load_scene("exponential_wall", ["material.eta_star=0"])
    assert "eq4" not in analyse(undamped, axes[1:], thrown(0.0, "other"))[0].fits
    assert (
        "eq4" not in analyse(load_scene("absorbing_wall"), axes, thrown(30.0))[0].fits
    )
    # The dashpot constant of a spring also counts as damping, swept or not.
    axes = ["viscosity", "seed", "velocity"]
    soft, stiff = analyse(
        undamped, axes, thrown(0.0, "viscosity") + thrown(0.03, "viscosity")
    )
    assert "eq4" not in soft.fits
    assert "eq4" in stiff.fits
    none = load_scene("exponential_wall", ["material.viscosity=0"])
    assert "eq4" not in analyse(none, axes[1:], thrown(0.0, "other"))[0].fits


@pytest.mark.parametrize(
    ("fastest", "left"),
    [
        (2.0, {"eq5", "eq5_d1_is_1", "eq4"}),
        (3.0, {"eq5", "eq5_d1_is_1"}),
        (10.0, set()),
    ],
)
def test_a_law_is_fitted_up_to_the_speed_that_it_has_a_meaning_for(
    fastest: float, left: set[str]
) -> None:
    rows = [
        row | {"velocity": row["velocity"] * fastest / V.max()} for row in thrown(30.0)
    ]
    (curve,) = analyse(
        load_scene("exponential_wall"), ["eta_star", "seed", "velocity"], rows
    )
    assert curve.fits.keys() - {"curvature"} == left


@pytest.mark.parametrize("own_first", [False, True])
def test_a_lattice_from_a_file_beside_a_random_one_leaves_that_its_moduli(
    own_first: bool,
) -> None:
    random = [
        row | {"lattice.file": "none"}
        for row in pressed([(0, 1e-3, 1.1), (0, 2e-3, 1.1)])
    ]
    own = [
        row | {"lattice.file": "own.npz", "young": None, "poisson": None}
        for row in random
    ]
    rows = own + random if own_first else random + own
    curves = analyse(
        load_scene("compression"), ["lattice.file", "seed", "pressure"], rows
    )
    known = {curve.label["lattice.file"]: curve.summary()["young"] for curve in curves}
    assert known == {"none": pytest.approx(1.1), "own.npz": None}


def test_lattices_from_a_file_have_no_moduli_and_no_fit_that_needs_them() -> None:
    rows = [
        row | {"young": None, "poisson": None}
        for row in pressed([(0, 1e-3, 1.0), (0, 2e-3, 1.0)])
    ]
    (curve,) = analyse(load_scene("compression"), ["seed", "pressure"], rows)
    assert not curve.fits
    assert curve.summary()["young"] is None


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(scene, marks=pytest.mark.validate)
        for scene in ("compression", "absorbing_wall")
    ]
    + ["exponential_wall"],
)
def test_the_legend_names_all_that_is_drawn_and_the_same_values_draw_the_same_bytes(
    kind: str, tmp_path: Path
) -> None:
    if kind == "compression":
        rows = pressed([(seed, p, 1.1) for seed in (0, 1) for p in P])
        axes = ["seed", "pressure"]
        legend = [
            "bars: 2 lattices",
            "exact law, rigid wall",
            "eq. (2), b = 1.55 (paper)",
        ]
    else:
        rows = thrown(10.0) + thrown(3.0) + thrown(0.0)
        axes = ["eta_star", "seed", "velocity"]
        legend = [
            "η* = 10",
            "η* = 3",
            "η* = 0",
            "bars: 2 lattices",
            "eq. (5), d₁ and d₂ fitted",
        ]
        paper = "paper: d₁ = 0.973, d₂ = 0.119"
        legend.append("eq. (4), τ₀ fitted" if kind == "exponential_wall" else paper)
    scene = load_scene(kind)
    curves = analyse(scene, axes, rows)
    drawn = []
    for _ in range(2 if kind == "compression" else 1):
        draw(scene, curves, tmp_path)
        drawn.append(
            [
                (tmp_path / f"figure.{suffix}").read_bytes()
                for suffix in ("svg", "png", "pdf")
            ]
        )
    # Text is drawn as outlines; Matplotlib repeats it in a comment.
    assert [
        label for label in legend if f"<!-- {label} -->" not in drawn[0][0].decode()
    ] == []
    assert b"LineCollection" in drawn[0][0]  # the bars
    assert drawn[0] == drawn[-1]


def test_one_lattice_has_no_error_bars(tmp_path: Path) -> None:
    scene = load_scene("exponential_wall")
    rows = [row for row in thrown(10.0) if row["seed"] == 0]
    draw(scene, analyse(scene, ["eta_star", "seed", "velocity"], rows), tmp_path)
    assert "LineCollection" not in (tmp_path / "figure.svg").read_text(encoding="utf-8")
