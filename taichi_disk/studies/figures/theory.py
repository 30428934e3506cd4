"""Laws of the continuum and of the paper, and their fits to the results of many
lattices.

Units: disk mass M = radius R = reference speed c = 1, so the density is rho = 1/pi. E
and nu are the two-dimensional (plane stress) moduli of the lattice. Equation numbers
are those of Kuninaka and Hayakawa's paper, whose E_* = E/(1 - nu^2) holds for plane
strain; for plane stress pass E as `e_star`.

A fit weights each point by its standard error over lattices. The results of one lattice
at several speeds or pressures are not independent, so confidence intervals and the test
of a law come from leaving out one lattice after the other (jackknife; Tukey 1958).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.experiments.scenes.compression import paper_compression
from taichi_disk.mechanics.lattice import Array
from taichi_disk.runs.api.lattices import half_width_95

Prediction = Callable[[Array], Array]  # maps tau0 (k,) to e (k, velocities)
# number of lattices from which their scatter is known well enough to weight points
MIN_LATTICES = 5
# A law is refuted if chance makes it fit as badly less often than this.
SIGNIFICANCE = 0.01
ROUNDING = 1e-18  # squares of rounding errors, over those of the values
MAX_TAU0 = 2.0  # largest tau0 at e_star = 1 [R/c]
START = 0.1  # where the search for it begins
TOLERANCE = 1e-12  # of a search
# relative tolerance of the integration of eq. (4); the error of e is 2e-10
IMPACT_TOLERANCE = 1e-9


def paper_restitution(velocity: ArrayLike, d1: float, d2: float) -> Array:
    """Return e = d1 sqrt(1 - d2/sqrt(ln(4 c/v))), eq. (5), or 0 if the root is not
    real; `velocity` [c]."""
    inner = 1.0 - d2 / np.sqrt(np.log(4.0 / np.asarray(velocity, float)))
    return d1 * np.sqrt(np.maximum(inner, 0.0))


# ---- fits


@dataclass(frozen=True)
class Fit:
    """Result of a least-squares fit."""

    values: dict[str, float]  # parameters by name
    # 95 % confidence intervals over lattices; empty for a single lattice
    intervals: dict[str, list[float]]
    residuals: Array  # (points,) mean over lattices minus the fit
    # how often a law that holds fits so badly by chance; NaN if this cannot be known
    p_value: float

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def is_refuted(self) -> bool:
        return self.p_value < SIGNIFICANCE


def fit_b(pressure: Array, xi: Array, young: float, poisson: float) -> Fit:
    """Fit b of eq. (2) to `xi` (lattices, pressures) [R].

    `young`: E [M c^2/R^2]. The `values` of the fit also contain the smallest, median
    and largest b of fits to single lattices.
    """
    scale = _scale(xi)

    def law(b: float) -> Array:
        return paper_compression(pressure, young, poisson, b)

    def solve(mean: Array, scale: Array = scale) -> list[float]:
        return [least_squares(law, mean, scale, 1.0)]

    fit = _fit(("b",), solve, law, xi)
    of_lattices = [solve(one)[0] for one in xi]
    scatter = {
        "b_min": min(of_lattices),
        "b_median": float(np.median(of_lattices)),
        "b_max": max(of_lattices),
    }
    return replace(fit, values=fit.values | scatter)


def fit_restitution(velocity: Array, e: Array) -> Fit:
    """Fit d1 and d2 of eq. (5) to e (lattices, velocities); `velocity` [c], where c is
    the paper's."""
    s = 1.0 / np.sqrt(np.log(4.0 / velocity))

    # Eq. (5) squared is a line: e^2 = A - B s with A = d1^2 and B = d1^2 d2. If e
    # changes by `scale`, e^2 changes by 2 e `scale`, hence the weights.
    def solve(mean: Array, scale: Array) -> list[float]:
        slope, A = np.polyfit(s, mean**2, 1, w=0.5 / (mean * scale)).tolist()
        if A <= 0.0:
            return [np.nan, -slope / A]
        return [A**0.5, -slope / A]

    def law(d1: float, d2: float) -> Array:
        return paper_restitution(velocity, d1, d2)

    return _fit(("d1", "d2"), solve, law, e)


def fit_tau0(velocity: Array, e: Array, e_star: float) -> Fit:
    """Fit tau0 [R/c] of eq. (4) to e (lattices, velocities); `velocity` [c], `e_star`
    [M c^2/R^2]."""
    predict = quasistatic_curves(tuple(velocity.tolist()), e_star)

    def law(tau0: float) -> Array:
        return predict(np.array([tau0]))[0]

    def solve(mean: Array, scale: Array) -> list[float]:
        return [least_squares(law, mean, scale, START * e_star**-0.5)]

    return _fit(("tau0",), solve, law, e)


@lru_cache(maxsize=4)  # shared by all curves of a figure
def quasistatic_curves(velocity: tuple[float, ...], e_star: float) -> Prediction:
    """Return a function that maps tau0 (k,) [R/c] to e (k, velocities) of eq. (4)."""
    # It is a spline through a table, accurate to 5e-7. Speeds and times are scaled by
    # sqrt(e_star) and its inverse, so that it is computed at e_star = 1.
    from scipy.interpolate import CubicSpline

    unit = e_star**-0.5
    places = np.linspace(0.0, np.log1p(5.0 * MAX_TAU0), 48)
    table = _restitutions(unit * np.array(velocity), np.expm1(places)[:, None] / 5.0)
    spline = CubicSpline(places, table)

    def predict(tau0: Array) -> Array:
        scaled = np.clip(tau0 / unit, 0.0, MAX_TAU0)
        return spline(np.log1p(5.0 * scaled))

    return predict


def _restitutions(velocity: Array, tau0: Array) -> Array:
    """Return e of eq. (4), (k, velocities), at e_star = 1 for speeds (velocities,) [c]
    and tau0 (k, 1) [R/c].

    Eq. (4) is xi'' = -pi E_* (xi + tau0 xi')/ln(4/xi), from xi = 0, xi' = v. The disk
    separates when the force vanishes, xi + tau0 xi' = 0, because a contact cannot pull.
    Integration to xi = 0 would change e by O(tau0^2). The paper takes e at the fixed
    time pi (R/c) sqrt(ln(4 c/v)) instead.
    """
    # With xi' = v r cos(phi) and xi + tau0 xi' = v r sin(phi), the amplitude r is
    # integrated over phi, from r = sqrt(1 + tau0^2) at atan(tau0) to r = e at pi. Steps
    # are short at both ends, where ln xi is steep.
    from scipy.integrate import solve_ivp

    log_4_over_v = np.log(4.0 / velocity)
    first = np.arctan(tau0)
    span = np.pi - first
    start = 0.5 * np.log1p(tau0**2) + 0.0 * log_4_over_v

    def slope(s: float, log_r: Array) -> Array:
        """Return d(log r)/ds at phi = first + span (10 s^3 - 15 s^4 + 6 s^5). The
        parameter s, from 0 to 1, makes the steps of phi short at both ends."""
        phi = first + span * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        phi_rate = span * 30.0 * (s * (1.0 - s)) ** 2
        sin = np.sin(phi)
        cos = np.cos(phi)
        depth = np.maximum(sin - tau0 * cos, 1e-300)  # xi/(v r)
        log_4_over_xi = log_4_over_v - np.log(depth) - log_r.reshape(start.shape)
        stiffness = np.pi / log_4_over_xi
        gain = sin * (cos * (1.0 - stiffness) - tau0 * stiffness * sin)
        turning = cos * cos + stiffness * sin * depth
        return np.ravel(gain / turning * phi_rate)

    tolerances = {"rtol": IMPACT_TOLERANCE, "atol": IMPACT_TOLERANCE}
    motion = solve_ivp(slope, (0.0, 1.0), start.ravel(), "DOP853", **tolerances)
    return np.exp(motion.y[:, -1]).reshape(start.shape)


def fit_curvature(x: Array, y: Array) -> Fit:
    """Fit parabolas to the lower and the upper half of y (lattices, points) over x;
    return their second derivatives, and no residuals."""
    # Negative values are concave, the paper's "convex upwards".
    halves = np.split(np.arange(len(x)), [len(x) // 2])

    def solve(mean: Array, _scale: Array) -> list[float]:
        parabolas = [np.polyfit(x[half], mean[half], 2) for half in halves]
        return [2.0 * float(powers[0]) for powers in parabolas]

    def law(*_curvatures: float) -> Array:
        """Return no values: a curvature says nothing of the height of a curve."""
        return np.full(len(x), np.nan)

    return _fit(("slow_half", "fast_half"), solve, law, y)


def least_squares(
    law: Callable[[float], Array], data: Array, scale: Array, start: float
) -> float:
    """Return the positive parameter of a law for which its differences from `data`,
    divided by `scale`, are smallest; the search, of the parameter's logarithm, begins
    at `start`."""
    from scipy import optimize

    def residuals(logarithm: Array) -> Array:
        return (law(np.exp(logarithm.item())) - data) / scale

    tolerances = dict.fromkeys(("xtol", "ftol", "gtol"), TOLERANCE)
    found = optimize.least_squares(residuals, np.log(start), **tolerances)
    return float(np.exp(found.x.item()))


def _scale(y: Array, least: int = MIN_LATTICES) -> Array:
    """Return the standard deviations (points,) of y (lattices, points), or ones if
    there are fewer lattices than `least`, or if they do not differ."""
    if len(y) >= least and y.std(0).all():
        return y.std(0, ddof=1)
    return np.ones(y.shape[1])


def _fit(
    names: tuple[str, ...],
    solve: Callable[[Array, Array], list[float]],
    law: Callable[..., Array],
    y: Array,
) -> Fit:
    """Return the fit of a law to the mean of y (lattices, points), with intervals of
    the jackknife.

    `solve` maps a mean (points,) and the errors (points,) that weight it to parameters,
    and `law` parameters to values (points,).
    """
    n = len(y)
    scale = _scale(y)
    best = solve(y.mean(0), scale)
    values = law(*best)
    intervals = {}
    p_value = np.nan
    if n > 1:
        without_one = []
        for k in range(n):
            others = np.delete(y, k, axis=0)
            weights = _scale(others, MIN_LATTICES - 1)
            without_one.append(solve(others.mean(0), weights))
        errors = np.sqrt(n - 1) * np.std(without_one, axis=0)
        reach = half_width_95(1.0, n) * errors
        limits = np.transpose([best - reach, best + reach]).tolist()
        intervals = dict(zip(names, limits, strict=True))
        if n >= MIN_LATTICES and len(values) > len(names):
            changes = [law(*(best + step)) - values for step in np.diag(errors)]
            p_value = _p_value((y - values) / scale, np.array(changes) / scale)
    return Fit(
        values=dict(zip(names, best, strict=True)),
        intervals=intervals,
        residuals=y.mean(0) - values,
        p_value=p_value,
    )


def _p_value(deviations: Array, changes: Array) -> float:
    """Return how often a law that holds fits as badly by chance.

    deviations (lattices, points): lattices minus fit, divided by the errors by which
    points are weighted; changes (parameters, points): those of the law with each
    parameter, divided likewise.

    The test compares the squares of the mean deviations with the scatter of lattices,
    where no parameter can change them. Their ratio follows nearly the F distribution of
    the same mean and variance (Box, Ann. Math. Stat. 25, 290, 1954). So points whose
    errors are correlated count as fewer degrees of freedom. NaN if lattices do not
    differ.
    """
    from scipy.special import fdtrc

    directions, _ = np.linalg.qr(changes.T)
    left = deviations - deviations @ directions @ directions.T
    n = len(left)
    covariance = np.cov(left.T)
    scatter = np.trace(covariance)
    if scatter <= ROUNDING * (left**2).sum():
        return np.nan  # all lattices are the same
    freedom = scatter**2 / (covariance**2).sum()
    ratio = n * (left.mean(0) ** 2).sum() / scatter
    return float(fdtrc(freedom, freedom * (n - 1), ratio))
