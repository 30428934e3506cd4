"""Fits of the paper's laws to many lattices at once, with intervals from resampling the lattices.

Lattices scatter much more than one of them errs, and one lattice's values at two speeds or pressures are not
independent. So whole lattices are drawn, with replacement (bootstrap; Efron 1979), never single points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk import theory

Array = NDArray[np.float64]
Model = Callable[[Array], Array]  # parameters (k, p) to predictions (k, points), k data sets at a time
RESAMPLES = 1000
LEVEL = 0.95


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
            return theory.paper_compression(pressure, young, poisson, np.maximum(b, 1e-6)) / data

        return np.maximum(least_squares(relative, np.ones_like(data), np.ones((len(data), 1))), 0.0)

    best, intervals = _over_lattices(("b",), solve, len(xi))
    each = solve(np.eye(len(xi)))[:, 0]
    left = xi.mean(0) - theory.paper_compression(pressure, young, poisson, best["b"])
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
    return Fit(best, intervals, e.mean(0) - theory.paper_restitution(velocity, best["d1"], best["d2"]))


def fit_tau0(velocity: Array, e: Array, e_star: float) -> Fit:
    """tau0 [R/c] of eq. (4), integrated, from e (lattices, velocities) with e_star [M c^2/R^2] given."""
    curves = _quasistatic_curves(tuple(velocity.tolist()), e_star)
    grid = curves.x

    def solve(weights: Array) -> Array:
        data = weights @ e
        squares = ((np.asarray(curves(grid))[None] - data[:, None]) ** 2).sum(2)
        start = grid[np.argmin(squares, axis=1)][:, None]
        return least_squares(lambda tau: np.asarray(curves(np.clip(tau[:, 0], 0.0, grid[-1]))), data, start)

    best, intervals = _over_lattices(("tau0",), solve, len(e))
    return Fit(best, intervals, e.mean(0) - np.asarray(curves(best["tau0"])))


@lru_cache(maxsize=4)  # the curves of a figure share it
def _quasistatic_curves(velocity: tuple[float, ...], e_star: float) -> Any:
    """e of eq. (4) at each velocity as a spline over tau0: it is smooth, so one serves every fit and resample."""
    from scipy.interpolate import CubicSpline

    grid = np.concatenate([[0.0], np.geomspace(1e-3, 2.0, 24)])
    return CubicSpline(grid, [theory.quasistatic_restitution(velocity, float(tau), e_star) for tau in grid])


def fit_curvature(x: Array, y: Array) -> Fit:
    """Second derivatives of the parabolas through the lower and the upper half of y (lattices, points) over x.

    Negative is concave, the paper's "convex upwards". `residuals` are those of the two parabolas.
    """
    half = len(x) // 2
    parts = slice(0, half), slice(half, None)
    powers = [np.vander(x[part] / x.max(), 3) for part in parts]

    def solve(weights: Array) -> Array:
        leading = [np.linalg.pinv(p)[0] for p in powers]
        return np.stack([(weights @ y[:, part]) @ row for part, row in zip(parts, leading, strict=True)], 1) * 2.0

    best, intervals = _over_lattices(("slow_half", "fast_half"), lambda w: solve(w) / x.max() ** 2, len(y))
    mean = y.mean(0)
    left = [mean[part] - p @ (np.linalg.pinv(p) @ mean[part]) for part, p in zip(parts, powers, strict=True)]
    return Fit(best, intervals, np.concatenate(left))


def least_squares(model: Model, data: Array, start: Array) -> Array:
    """Parameters (k, p) that fit `data` (k, points): Levenberg-Marquardt on all k data sets side by side."""
    x = np.array(start, float)
    damping = np.full(len(x), 1e-6)
    left = data - model(x)
    cost = (left**2).sum(1)
    for _ in range(60):
        slope = np.empty((*left.shape, x.shape[1]))
        for j in range(x.shape[1]):
            step = np.zeros_like(x)
            step[:, j] = 1e-6 * np.maximum(np.abs(x[:, j]), 1e-3)
            slope[:, :, j] = (model(x + step) - model(x - step)) / (2.0 * step[:, j : j + 1])
        normal = np.einsum("kni,knj->kij", slope, slope)
        diagonal = np.einsum("kii->ki", normal) + 1e-300
        normal += damping[:, None, None] * np.eye(x.shape[1]) * diagonal[:, :, None]
        move = np.linalg.solve(normal, np.einsum("kni,kn->ki", slope, left)[:, :, None])[:, :, 0]
        trial = data - model(x + move)
        trial_cost = (trial**2).sum(1)
        better = trial_cost < cost
        x[better] += move[better]
        left[better], cost[better] = trial[better], trial_cost[better]
        damping = np.where(better, 0.1 * damping, 10.0 * damping).clip(1e-12, 1e12)
        if not better.any() and damping.min() > 1.0:
            break
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
