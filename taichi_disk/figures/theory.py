"""Theory: the laws of the continuum and of the paper, and fits of them to many lattices at once.

Units: disk mass M = radius R = reference speed c = 1, so the density is rho = 1/pi. E and nu are the lattice's own
two-dimensional (plane stress) moduli. Equation numbers are those of Kuninaka and Hayakawa's paper. The paper's
E_* = E/(1 - nu^2) is that of plane strain; for a sheet that is free to thin it is E, and that belongs in `e_star`.

Lattices scatter much more than one of them errs, and one lattice's values at two speeds or pressures are not
independent. So for the intervals of a fit whole lattices are drawn, with replacement (bootstrap; Efron 1979), never
single points.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebfit, chebval
from numpy.typing import ArrayLike

from taichi_disk.lattice import Array
from taichi_disk.scenes.compression import exact_compression as exact_compression
from taichi_disk.scenes.compression import paper_compression as paper_compression

Prediction = Callable[[Array], Array]  # parameters (k, p) to values (k, points), k data sets at a time
RESAMPLES = 1000
LEVEL = 0.95
LARGEST_TAU0 = 2.0  # [R/c], at e_star = 1
STEPS = 100  # of an impact after eq. (4): e is off by 2e-8


def paper_restitution(velocity: ArrayLike, d1: float, d2: float) -> Array:
    """Eq. (5): e = d1 sqrt(1 - d2/sqrt(ln(4 c/v))), 0 where the root has no real value; with c = 1 in the logarithm."""
    inner = 1.0 - d2 / np.sqrt(np.log(4.0 / np.asarray(velocity, float)))
    return np.asarray(d1 * np.sqrt(np.maximum(inner, 0.0)))


class QuasistaticImpact(NamedTuple):
    """An impact after eq. (4): e, the time of contact [R/c], the largest compression [R]."""

    restitution: float
    contact_time: float
    compression: float


def quasistatic_impact(velocity: float, tau0: float, e_star: float, rtol: float = 1e-9) -> QuasistaticImpact:
    """Integrate eq. (4), xi'' = -pi E_* (xi + tau0 xi')/ln(4/xi), from xi = 0, xi' = v [c] until separation.

    Disk and wall separate where the force has fallen to zero, xi + tau0 xi' = 0: contact does not pull. Integrating
    on to xi = 0 would change e by O(tau0^2). The paper takes e at the fixed time pi (R/c) sqrt(ln(4 c/v)) instead.

    Args:
        velocity: v [c].
        tau0: the time scale of dissipation [R/c].
        e_star: E_* [M c^2/R^2].
        rtol: relative tolerance of the integration.

    Raises:
        ValueError: the disk would be crushed, xi = 4 R/e; beyond that the law's stiffness has no meaning.
    """
    from scipy.integrate import solve_ivp

    stiffness = math.pi * e_star
    deepest = 4.0 / math.e / velocity

    def rate(_t: float, y: Array) -> list[float]:
        z, w = y  # xi/v and xi'/v: of order one at any speed
        if z <= 0.0:
            return [w, 0.0]
        return [w, -stiffness * (z + tau0 * w) / (math.log(4.0 / velocity) - math.log(min(z, deepest)))]

    def force(_t: float, y: Array) -> float:
        return float(y[0] + tau0 * y[1])

    force.terminal, force.direction = True, -1.0  # type: ignore[attr-defined]
    end = 100.0 * math.sqrt(math.log(4.0 / min(velocity, 1.0)) / stiffness) * (1.0 + tau0 * math.sqrt(stiffness))
    steps = {"rtol": rtol, "atol": 1e-3 * rtol, "max_step": 0.02 * end}
    motion = solve_ivp(rate, (0.0, end), [0.0, 1.0], "DOP853", events=(force, lambda _t, y: y[1]), **steps)
    if not motion.t_events[0].size or motion.y_events[1][0][0] >= deepest:
        raise ValueError(f"eq. (4) has no impact at v = {velocity:g} c, tau0 = {tau0:g} R/c, E_* = {e_star:g}")
    (_, last), (top, _) = motion.y_events[0][0], motion.y_events[1][0]
    return QuasistaticImpact(float(-last), float(motion.t_events[0][0]), float(velocity * top))


# ---- fits


@dataclass(frozen=True)
class Fit:
    """Least-squares parameters by name, their confidence intervals, and what the fit leaves.

    `intervals` are (low, high) at the level 0.95, over lattices; empty where there is one lattice only.
    `residuals` (points,): the lattices' mean minus the fit, at each speed or pressure.
    """

    values: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    residuals: Array

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.residuals**2)))


def fit_b(pressure: Array, xi: Array, young: float, poisson: float) -> Fit:
    """b of eq. (2), from xi (lattices, pressures) [R] and the material's E and nu; relative squares.

    `values` also has b_min, b_median and b_max of the lattices one by one: a single lattice is one such draw.
    """

    def solve(weights: Array) -> Array:
        data = weights @ xi

        def relative(b: Array) -> Array:
            return paper_compression(pressure, young, poisson, np.maximum(b, 1e-6)) / data

        return np.maximum(least_squares(relative, np.ones_like(data), np.ones((len(data), 1))), 0.0)

    best, intervals = _over_lattices(("b",), solve, len(xi))
    each = solve(np.eye(len(xi)))[:, 0]
    left = xi.mean(0) - paper_compression(pressure, young, poisson, best["b"])
    extremes = {"b_min": float(each.min()), "b_median": float(np.median(each)), "b_max": float(each.max())}
    return Fit(best | extremes, intervals, left)


def fit_restitution(velocity: Array, e: Array, d1_is_1: bool = False) -> Fit:
    """d1 and d2 of eq. (5), from e (lattices, velocities); with c = 1 in its logarithm, as on the paper's axis."""
    s = 1.0 / np.sqrt(np.log(4.0 / velocity))

    def solve(weights: Array) -> Array:
        data = weights @ e
        # Eq. (5) is linear in e^2 = A - B s, which gives the start; the squares are those of e itself.
        if d1_is_1:
            start = ((1.0 - data**2) @ s / (s @ s))[:, None]
            d2 = least_squares(lambda p: np.sqrt(np.maximum(1.0 - p * s, 0.0)), data, start)
            return np.concatenate([np.ones_like(d2), d2], axis=1)
        slope, level = np.polyfit(s, (data**2).T, 1)
        start = np.stack([level, -slope], axis=1)
        A, B = least_squares(lambda p: np.sqrt(np.maximum(p[:, :1] - p[:, 1:] * s, 0.0)), data, start).T
        return np.stack([np.sqrt(np.where(A > 0.0, A, np.nan)), B / A], axis=1)

    best, intervals = _over_lattices(("d1", "d2"), solve, len(e))
    if d1_is_1:
        intervals.pop("d1", None)
    return Fit(best, intervals, e.mean(0) - paper_restitution(velocity, best["d1"], best["d2"]))


def fit_tau0(velocity: Array, e: Array, e_star: float) -> Fit:
    """tau0 [R/c] of eq. (4), integrated, from e (lattices, velocities) with e_star [M c^2/R^2] given."""
    predict, unit = quasistatic_curves(tuple(velocity.tolist()), e_star), e_star**-0.5
    grid = np.geomspace(1e-3, LARGEST_TAU0, 48, dtype=np.float64)

    def solve(weights: Array) -> Array:
        data = weights @ e
        squares = ((predict(unit * grid)[None] - data[:, None]) ** 2).sum(2)
        start = grid[np.argmin(squares, axis=1)][:, None]
        return unit * least_squares(lambda tau: predict(unit * tau[:, 0]), data, start)

    best, intervals = _over_lattices(("tau0",), solve, len(e))
    return Fit(best, intervals, e.mean(0) - predict(np.array([best["tau0"]]))[0])


@lru_cache(maxsize=4)  # the curves of a figure share it
def quasistatic_curves(velocity: tuple[float, ...], e_star: float) -> Prediction:
    """e of eq. (4) at each velocity [c] as a function of tau0 (k,): (k, velocities).

    A polynomial in ln(1 + 5 tau0) through 11 Chebyshev points, good to 5e-7: one serves every fit and resample. It is
    one at e_star = 1, where all speeds and times are those in units of sqrt(e_star) and its inverse.
    """
    top, at, unit = np.log1p(5.0 * LARGEST_TAU0), -np.cos(np.linspace(0.0, np.pi, 11)), e_star**-0.5
    table = _restitutions(unit * np.array(velocity), np.expm1(0.5 * top * (1.0 + at))[:, None] / 5.0)
    series = chebfit(at, table, 10)
    return lambda tau0: chebval(2.0 * np.log1p(5.0 * np.clip(tau0 / unit, 0.0, LARGEST_TAU0)) / top - 1.0, series).T


def _restitutions(velocity: Array, tau0: Array) -> Array:
    """e of `quasistatic_impact` at e_star = 1, of all at once; no speed may crush the disk.

    Of xi' = v r cos(phi) and xi + tau0 xi' = v r sin(phi), r is a function of phi: from atan(tau0), r = sqrt(1 +
    tau0^2), to pi, where contact ends and r = e. By the Runge-Kutta method of order 4, with short steps at both ends,
    where ln xi is steep.
    """
    steep, first = np.log(4.0 / velocity), np.arctan(tau0)

    def slope(part: float, log_r: Array) -> Array:
        """d(log r) over d(part), phi being first + (pi - first) (10 part^3 - 15 part^4 + 6 part^5)."""
        phi = first + (np.pi - first) * part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        s, c = np.sin(phi), np.cos(phi)
        depth = np.maximum(s - tau0 * c, 1e-300)
        g = np.pi / (steep - np.log(depth) - log_r)
        change = s * (c * (1.0 - g) - tau0 * g * s) / (c * c + g * s * depth)
        return np.asarray(change * (np.pi - first) * 30.0 * (part * (1.0 - part)) ** 2)

    log_r, h = 0.5 * np.log1p(tau0**2) + 0.0 * steep, 1.0 / STEPS
    for k in range(STEPS):
        k1 = slope(k * h, log_r)
        k2 = slope((k + 0.5) * h, log_r + 0.5 * h * k1)
        k3 = slope((k + 0.5) * h, log_r + 0.5 * h * k2)
        k4 = slope((k + 1) * h, log_r + h * k3)
        log_r = log_r + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return np.exp(log_r)


def fit_curvature(x: Array, y: Array) -> Fit:
    """Second derivatives of the parabolas through the lower and the upper half of y (lattices, points) over x.

    Negative is concave, the paper's "convex upwards". `residuals` are those of the two parabolas.
    """
    halves = slice(0, len(x) // 2), slice(len(x) // 2, None)
    powers = [np.vander(x[half] / x.max(), 3) for half in halves]
    inverse = [np.linalg.pinv(one) for one in powers]

    def solve(weights: Array) -> Array:
        leading = [(weights @ y[:, half]) @ one[0] for half, one in zip(halves, inverse, strict=True)]
        return np.stack(leading, axis=1) * 2.0 / x.max() ** 2

    best, intervals = _over_lattices(("slow_half", "fast_half"), solve, len(y))
    means = [y.mean(0)[half] for half in halves]
    left = [mean - p @ (one @ mean) for mean, p, one in zip(means, powers, inverse, strict=True)]
    return Fit(best, intervals, np.concatenate(left))


def least_squares(model: Prediction, data: Array, start: Array) -> Array:
    """Parameters (k, p) that fit `data` (k, points): Gauss-Newton on all k data sets side by side."""
    x: Array = np.array(start, float)
    for _ in range(12):
        steps = 1e-6 * np.maximum(np.abs(x), 1e-3)
        columns = [
            (model(x + steps * one) - model(x - steps * one)) / (2.0 * steps[:, j, None])
            for j, one in enumerate(np.eye(x.shape[1]))
        ]
        J = np.stack(columns, axis=1)
        square = np.linalg.pinv(J @ J.swapaxes(1, 2), hermitian=True)  # a tenth of the time that pinv(J) takes
        x += (square @ (J @ (data - model(x))[:, :, None]))[:, :, 0]
    return x


def _over_lattices(
    names: tuple[str, ...], solve: Callable[[Array], Array], lattices: int
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Parameters for the mean over all lattices, and their intervals; always the same resamples.

    `solve` takes weights (k, lattices) that form k means, and returns parameters (k, names).
    """
    best = solve(np.full((1, lattices), 1.0 / lattices))[0]
    values = {name: float(best[j]) for j, name in enumerate(names)}
    if lattices < 2:
        return values, {}
    drawn = np.random.default_rng(0).multinomial(lattices, np.full(lattices, 1.0 / lattices), RESAMPLES)
    edges = np.nanquantile(solve(drawn / lattices), [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0)
    return values, {name: (float(edges[0, j]), float(edges[1, j])) for j, name in enumerate(names)}
