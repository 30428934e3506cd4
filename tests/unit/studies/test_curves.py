"""Fits recover known parameters, and intervals contain them often enough."""

import itertools

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from scipy.special import stdtr

from docs.experiments.quasistatic import quasistatic_impact
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.experiments.scenes.compression import paper_compression
from taichi_disk.pictures.plot import STYLE, matplotlib_style
from taichi_disk.studies.figures import drawing, theory
from taichi_disk.studies.figures.curves import LAWS, SEED, analyse
from taichi_disk.studies.figures.drawing import (
    FONT,
    curve_styles,
    draw,
    figure_to_change,
    log_if_wide,
)
from taichi_disk.studies.figures.texts import curve_rows

V = np.geomspace(3e-3, 5e-2, 12)
P = np.linspace(4e-3, 1e-2, 7)
THROW_AXES = ["eta_star", "seed", "velocity"]
PAPER = "paper: d₁ = 0.973, d₂ = 0.119"


def analysed(kind, axes, rows, setting="", **options):
    scene = load_scene(kind, setting.split())
    homes = {name: scene.homes(name)[0] for name in axes}
    return analyse(scene, homes, rows, **options)


def test_planted_parameters_of_eq_5_come_back():
    for d1, d2 in ((0.973, 0.119), (1.0, 0.6), (1.6, 1.4)):
        fit = theory.fit_restitution(V, theory.paper_restitution(V, d1, d2)[None])
        assert fit.values == pytest.approx({"d1": d1, "d2": d2}, rel=1e-6)
        assert fit.rms < 1e-7
        assert not fit.intervals


def test_a_planted_b_comes_back_and_each_lattice_has_its_own():
    b = np.array([0.9, 1.5, 2.4])
    fit = theory.fit_b(P, paper_compression(P, 1.1, 0.29, b[:, None]), 1.1, 0.29)
    found = [fit.values[f"b_{name}"] for name in ("min", "median", "max")]
    assert found == pytest.approx(list(b), rel=1e-6)
    # Three lattices do not weight the points.
    # (2) is nearly linear in b, so b is the mean of three numbers; t is 4.3027.
    half_width = 4.3027 * b.std(ddof=1) / 3**0.5
    assert fit.values["b"] == pytest.approx(b.mean(), rel=0.02)
    low, high = fit.intervals["b"]
    assert low == pytest.approx(b.mean() - half_width, abs=0.05)
    assert high == pytest.approx(b.mean() + half_width, abs=0.05)


def test_b_is_never_negative_however_little_the_disk_yields():
    law = paper_compression(P, 1.1, 0.29, 0.9)
    soft = theory.fit_b(P, np.stack([0.5 * law, 0.7 * law]), 1.1, 0.29)
    assert 0.3 < soft.values["b_min"] < soft.values["b"] < soft.values["b_max"] < 0.7
    places = np.geomspace(1e-3, 1.0, 30_000)[:, None]
    for part in (0.1, 0.01):
        hard = theory.fit_b(P, part * law[None], 1.1, 0.29).values["b"]
        misses = paper_compression(P, 1.1, 0.29, places) - part * law
        assert hard == pytest.approx(places[(misses**2).sum(axis=1).argmin()], rel=1e-3)
    assert theory.fit_b(P, -law[None], 1.1, 0.29).values["b"] < 1e-6


def test_the_residuals_are_data_minus_fit():
    e = theory.paper_restitution(V, 1.0, 0.6)
    bump = np.where(np.arange(12) == 5, 1e-3, 0.0)
    fit = theory.fit_restitution(V, np.stack([e + bump, e + bump]))
    # Two parameters at twelve points absorb about a sixth of a single outlier.
    assert 0.7e-3 < fit.residuals[5] < 1e-3


def test_curvature_is_the_second_derivative_of_either_half():
    y = np.where(V[6] > V, -3.0 * V**2 + V, 2.0 * V**2)
    fit = theory.fit_curvature(V, np.stack([y, y]))
    assert fit.values == pytest.approx({"slow_half": -6.0, "fast_half": 4.0}, rel=1e-8)


def test_a_fit_is_weighted_by_the_errors_of_the_points():
    # One point is off, and known a hundred times worse than the others.
    true = theory.paper_restitution(V, 1.0, 0.6)
    scatter = np.where(np.arange(12) == 5, 1e-2, 1e-4)
    signs = np.where(np.arange(6) % 2, 1.0, -1.0)[:, None]
    e = true + np.where(np.arange(12) == 5, 5e-3, 0.0) + scatter * signs
    fit = theory.fit_restitution(V, e)
    assert fit.values == pytest.approx({"d1": 1.0, "d2": 0.6}, rel=1e-4)
    assert not fit.is_refuted
    unweighted = theory.fit_restitution(V, e.mean(0)[None])
    assert abs(unweighted.values["d1"] - 1.0) > 1e-3


@pytest.mark.parametrize("e_star", [1.1, 1.1e4])
def test_the_table_of_eq_4_is_as_good_as_its_integral_at_any_stiffness(e_star):
    predict = theory.quasistatic_curves((3e-3, 5e-2), e_star)
    unit = e_star**-0.5
    for tau0 in (0.0, 3e-3 * unit, 0.0412 * unit, 0.33 * unit, 1.7 * unit):
        exact = [quasistatic_impact(v, tau0, e_star).restitution for v in (3e-3, 5e-2)]
        assert predict(np.array([tau0]))[0] == pytest.approx(exact, rel=0, abs=1e-6)
    # A fit to data from the table recovers tau0.
    e = np.array([[quasistatic_impact(v, 0.3 * unit, e_star).restitution for v in V]])
    fit = theory.fit_tau0(V, e, e_star)
    assert fit.values["tau0"] == pytest.approx(0.3 * unit, rel=1e-4)
    assert fit.rms < 1e-6


@pytest.mark.parametrize("shift", [0.0, 2e-4, 1e-3])
def test_the_test_of_a_law_with_one_degree_of_freedom_is_students(shift):
    # At three speeds one combination of e is left that d1 and d2 do not change. Errors
    # of the points are common, equal and of both signs.
    v = V[[0, 6, 11]]
    e = theory.paper_restitution(v, 1.0, 0.6) + [0.0, shift, 0.0]
    errors = np.random.default_rng(3).normal(scale=[2e-4, 2e-4, 3e-4], size=(9, 3))
    y = e + errors + errors[:, :1]
    fit = theory.fit_restitution(v, y)
    # e^2 is linear in s, and differences from the law are small.
    free = np.cross(1.0 / e, 1.0 / (e * np.sqrt(np.log(4.0 / v))))
    left = (y - (y.mean(0) - fit.residuals)) @ free
    student = left.mean() / (left.std(ddof=1) / np.sqrt(9))
    expected = 2.0 * stdtr(8, -abs(student))
    assert fit.p_value == pytest.approx(expected, rel=0.02)
    assert fit.is_refuted == (shift == 1e-3)


def test_a_law_is_refuted_as_seldom_by_points_that_share_their_errors():
    # Box's degrees of freedom: ten for independent points, one for a common error.
    rng = np.random.default_rng(5)
    n = 4000
    noise = rng.normal(size=(n, 10))
    nothing = np.zeros((1, 10))
    nothing[0, 0] = 1.0
    for y in (noise, noise + 3.0 * rng.normal(size=(n, 1)) * np.arange(10)):
        p = [theory._p_value(one, nothing) for one in y.reshape(-1, 20, 10)]
        assert 0.0 < np.mean(np.array(p) < 0.05) < 0.1


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_lattices_that_differ_by_rounding_errors_refute_no_law(unit):
    y = unit * np.random.default_rng(5).normal(size=10)
    same = y + 1e-16 * unit * np.arange(-3, 4)[:, None]
    nothing = np.eye(10)[:1]
    assert np.isnan(theory._p_value(same, nothing))
    apart = y + 1e-6 * unit * np.random.default_rng(6).normal(size=(7, 10))
    assert theory._p_value(apart, nothing) < 1e-9


@pytest.mark.parametrize("lattices", [1, 4])
def test_a_few_lattices_do_not_tell_whether_a_law_holds(lattices):
    scatter = 1e-4 * np.arange(lattices)[:, None]
    fit = theory.fit_restitution(V, np.linspace(1.0, 0.5, 12) + scatter)
    assert fit.rms > 1e-3
    assert np.isnan(fit.p_value)
    assert not fit.is_refuted


def contrast_to_white(colour):
    """Contrast of the Web Content Accessibility Guidelines 2.1."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return 1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05)


@pytest.mark.parametrize("count", [1, 2, 6, 12])
def test_curves_are_seen_on_white_and_grow_lighter_in_their_order(count):
    contrasts = [contrast_to_white(one["color"]) for one in curve_styles(count)]
    assert contrasts == sorted(contrasts, reverse=True)
    assert min(contrasts) >= 3.0
    assert len(set(contrasts)) == count


def pressed(*lattices, **columns):
    """Rows of (seed, pressure, E), all with these `columns`."""
    numbers = {"xi": 0.01, "xi_nominal": 0.02, "xi_extrapolated": 0.0, "status": "done"}
    rows = []
    for seed, pressure, young in lattices:
        moduli = {"young": young, "poisson": 0.3 * young}
        rows.append({"seed": seed, "pressure": pressure} | moduli | numbers | columns)
    return rows


def test_the_moduli_are_the_mean_over_lattices_however_many_rows_each_has():
    first = [(0, p, 1.0) for p in (1e-3, 2e-3, 3e-3)]
    rows = pressed(*first, (1, 1e-3, 1.2), (1, 2e-3, 1.2))
    rows.append(rows[-1] | {"pressure": 3e-3, "status": "failed", "xi": None})
    (curve,) = analysed("compression", ["seed", "pressure"], rows).curves
    assert (curve.young, curve.poisson) == (pytest.approx(1.1), pytest.approx(0.33))
    assert curve.y.shape == (1, 3)  # the lattice of which a point failed is left out


def test_the_moduli_are_those_of_the_lattices_of_the_curve():
    rows = pressed((0, 1e-3, 1.0), method="relaxation", points=300)
    rows += pressed((0, 1e-3, 1.0), (1, 1e-3, 1.2), method="newton", points=300)
    rows += pressed((0, 1e-3, 1.5), method="newton", points=60)
    axes = ["points", "method", "seed", "pressure"]
    curves = analysed("compression", axes, rows).curves
    assert [curve.young for curve in curves] == pytest.approx([1.0, 1.1, 1.5])


def thrown(eta_star, name="eta_star", lattices=2):
    """Rows of throws whose e follows eq. (5), of lattices that differ by 1e-3."""
    same = {"status": "done", "young": 1.1, "poisson": 0.3, "contact_time": 6.0}
    number = eta_star if isinstance(eta_star, float) else 10.0
    e = theory.paper_restitution(V, 1.0, 0.01 * number)
    rows = []
    for seed in range(lattices):
        for velocity, value in zip(V, e * (1.0 + 1e-3 * seed), strict=True):
            numbers = {"velocity": velocity, "seed": seed, "restitution": value}
            rows.append(numbers | same | {name: eta_star})
    return rows


@pytest.mark.validate
@pytest.mark.parametrize(
    ("kind", "setting", "name", "number", "is_fitted"),
    [
        ("exponential_wall", "", "eta_star", 0.0, False),
        ("exponential_wall", "", "eta_star", 30.0, True),
        ("exponential_wall", "", "other", 30.0, True),  # eta* of the scene, not swept
        ("exponential_wall", "material.eta_star=0", "other", 0.0, False),
        ("absorbing_wall", "", "eta_star", 30.0, False),
        # the dashpot constant of a spring also counts as damping, swept or not
        ("exponential_wall", "material.eta_star=0", "viscosity", 0.0, False),
        ("exponential_wall", "material.eta_star=0", "viscosity", 0.03, True),
        ("exponential_wall", "material.viscosity=0", "other", 0.0, False),
    ],
)
def test_eq_4_is_fitted_if_there_are_dashpots(kind, setting, name, number, is_fitted):
    axes = ["seed", "velocity"] if name == "other" else [name, "seed", "velocity"]
    (curve,) = analysed(kind, axes, thrown(number, name), setting).curves
    assert ("eq4" in curve.fits) == is_fitted


@pytest.mark.parametrize("young", [0.25, 1.0, 2.25])
def test_a_law_is_fitted_up_to_the_speed_that_it_has_a_meaning_for(young):
    crushed = 2.2 * young**0.5  # where eq. (4) crushes the disk
    for fastest, left in (
        (0.99 * crushed, {"eq5", "eq4"}),
        (1.01 * crushed, {"eq5"}),
        (3.89, {"eq5"}),
        (3.91, set()),  # the logarithm of eq. (5) changes its sign at 3.9
    ):
        rows = thrown(30.0)
        for row in rows:
            row["velocity"] *= fastest / V.max()
            row["young"] = young
        (curve,) = analysed("exponential_wall", THROW_AXES, rows).curves
        assert curve.fits.keys() - {"curvature"} == left
    rows = [row | {"restitution": 0.0} for row in thrown(30.0)]  # no bounce counts
    assert not analysed("exponential_wall", THROW_AXES, rows).curves[0].fits


@pytest.mark.parametrize("own_first", [False, True])
def test_a_lattice_from_a_file_has_no_moduli_and_leaves_a_random_one_its_own(own_first):
    lattices = [(0, 1e-3, 1.1), (0, 2e-3, 1.1)]
    random = pressed(*lattices, **{"lattice.file": "none"})
    unknown = {"lattice.file": "own.npz", "young": None, "poisson": None}
    own = [row | unknown for row in random]
    rows = own + random if own_first else random + own
    axes = ["lattice.file", "seed", "pressure"]
    curves = analysed("compression", axes, rows).curves
    found = {curve.label["lattice.file"]: curve for curve in curves}
    assert found["none"].summary()["young"] == pytest.approx(1.1)
    assert found["own.npz"].summary()["young"] is None
    assert not found["own.npz"].fits  # none that needs moduli


def test_lattices_of_files_are_named_without_their_common_folder_and_judge_no_law():
    rows = []
    for folder in ("one", "two"):
        file = f"/home/runs/{folder}/lattice.npz"
        unknown = {"young": None, "poisson": None}
        rows += [row | unknown for row in thrown(file, "lattice.file", lattices=1)]
    axes = ["lattice.file", "velocity"]
    curves = analysed("exponential_wall", axes, rows).curves
    names = [curve.label["lattice.file"] for curve in curves]
    assert names == ["one/lattice.npz", "two/lattice.npz"]
    assert not any(curve.fits for curve in curves)
    assert rows[0]["lattice.file"] == "/home/runs/one/lattice.npz"


def test_bodies_on_the_axis_have_names_that_do_not_overlap():
    bodies = ("shapes/star", "shapes/ell", "shapes/ring", "a_measured_pebble")
    rows = [
        {"outline": f"/home/{body}.svg", "seed": seed, "restitution": 0.9 + 0.01 * k}
        | {"young": None, "poisson": None}
        for k, body in enumerate(bodies)
        for seed in (0, 1)
    ]
    axes = {"outline": ("lattice", "outline"), "seed": SEED}
    figure = figure_to_change(analyse(load_scene("exponential_wall"), axes, rows))
    figure.draw_without_rendering()
    (axis,) = figure.axes
    words = axis.get_xticklabels()
    names = {word.get_text() for word in words}
    assert names == {"star", "ell", "ring", "a_measured_pebble"}
    assert {word.get_fontsize() for word in words} == {9.0}
    ends = [word.get_window_extent().x1 for word in words]
    assert min(np.diff(ends)) > 1.5 * 9.0 / 72.0 * figure.dpi  # of parallel lines
    assert axis.get_window_extent().height > 0.3 * figure.bbox.height
    assert not any(line.get_linewidth() for line in axis.containers[0].lines[:1])


def test_the_same_values_draw_the_same_bytes(tmp_path, monkeypatch):
    monkeypatch.delitem(drawing.METADATA, "png")  # whose bytes hold no date or id
    diagram = analysed("absorbing_wall", THROW_AXES, thrown(10.0))
    drawn = []
    for _ in range(2):
        draw(diagram, tmp_path)
        names = ("figure.svg", "figure.pdf")
        drawn.append([(tmp_path / name).read_bytes() for name in names])
    assert drawn[0] == drawn[1]


def test_folded_points_are_left_out_and_lattices_are_complete_elsewhere():
    rows = thrown(30.0, lattices=5)
    whole = analysed("exponential_wall", THROW_AXES, rows).curves[0]
    text = "3 triangles of the lattice turned inside out: springs have crossed"
    for row in rows:
        if row["velocity"] == V[-1] or (row["seed"], row["velocity"]) == (2, V[3]):
            row["warnings"] = text
            row["restitution"] = 0.3
    (curve,) = analysed("exponential_wall", THROW_AXES, rows).curves
    assert curve.folded == 6
    np.testing.assert_array_equal(curve.x, V[:-1])
    np.testing.assert_array_equal(curve.y, whole.y[[0, 1, 3, 4], :-1])
    ((label, _laws),) = curve_rows([curve.summary()])
    assert label == "eta_star: 30, lattices per point: 4, 6 folded points in no fit"
    # a curve that folds everywhere is drawn, and fitted by no law
    crushed = [row | {"warnings": text} for row in rows]
    (curve,) = analysed("exponential_wall", THROW_AXES, crushed).curves
    assert curve.y.shape == (5, 12)
    assert not curve.fits
    # over any other axis all points count
    diagram = analysed("exponential_wall", THROW_AXES, rows, x="eta_star")
    assert sum(np.isfinite(one.y).sum() for one in diagram.curves) == 60


def test_the_line_of_eq_5_ends_where_e_is_1():
    rows = thrown(-3.0)  # e is above 1 at all speeds
    for row in thrown(3.0):
        rows.append(row | {"restitution": row["restitution"] * 1.0065})
    curves = analysed("absorbing_wall", THROW_AXES, rows).curves
    beyond, some = (LAWS["eq5"].line(one, one.fits["eq5"]) for one in curves)
    assert len(beyond[0]) == 0
    assert 0 < len(some[0]) < 80
    assert some[1].max() <= 1.0 < curves[1].mean.max()


@pytest.mark.parametrize("span", [1.03, 2.0, 3.9, 5.0, 17.0, 99.0, 101.0, 1e3, 1e5])
def test_labels_of_an_axis_do_not_touch(span):
    x = np.geomspace(0.045, 0.045 * span, 9)
    with matplotlib_style({**STYLE, **FONT}):
        figure = Figure(figsize=(3.4, 2.9), layout="constrained")
        axes = figure.subplots()
        axes.plot(x, x)
        log_if_wide(axes, x)
        figure.draw_without_rendering()
    low, high = axes.get_xlim()
    seen = [
        label
        for label in axes.get_xticklabels()
        if low <= label.get_position()[0] <= high
    ]
    boxes = [label.get_window_extent() for label in seen]
    assert len(boxes) > 1
    for left, right in itertools.pairwise(boxes):
        assert left.x1 < right.x0
