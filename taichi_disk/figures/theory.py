"""Laws of the continuum and of the paper, and their fits to the results of many
lattices.

Units: disk mass M = radius R = reference speed c = 1, so the density is rho = 1/pi. E
and nu are the two-dimensional (plane stress) moduli of the lattice. Equation numbers
are those of Kuninaka and Hayakawa's paper, whose E_* = E/(1 - nu^2) holds for plane
strain; for plane stress pass E as `e_star`.

The results of one lattice at several speeds or pressures are not independent, and the
scatter of lattices is larger than the error of a result. The confidence intervals of a
fit are therefore found by resampling whole lattices (bootstrap; Efron 1979).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.polynomial.chebyshev import chebfit, chebval
from numpy.typing import ArrayLike

from taichi_disk.lattice import Array
from taichi_disk.scenes.compression import paper_compression

# maps parameters (k, p) of k data sets to values (k, points)
Prediction = Callable[[Array], Array]
RESAMPLES = 1000
LEVEL = 0.95
MAX_MISFIT = 3.0  # of a law that holds: residuals divided by the scatter of lattices
MAX_TAU0 = 2.0  # largest tau0 at e_star = 1 [R/c]
# relative tolerance of the integration of eq. (4); the error of e is 2e-10
IMPACT_TOLERANCE = 1e-9


def paper_restitution(velocity: ArrayLike, d1: float, d2: float) -> Array:
    """Return e = d1 sqrt(1 - d2/sqrt(ln(4 c/v))), eq. (5), or 0 if the root is not
    real; `velocity` [c]."""
    inner = 1.0 - d2 / np.sqrt(np.log(4.0 / np.asarray(velocity, float)))
    return np.asarray(d1 * np.sqrt(np.maximum(inner, 0.0)))


# ---- fits


@dataclass(frozen=True)
class Fit:
    """Result of a least-squares fit."""

    values: dict[str, float]  # parameters by name
    # 95 % confidence intervals over lattices; empty for a single lattice
    intervals: dict[str, tuple[float, float]]
    residuals: Array  # (points,) mean over lattices minus the fit
    # standard deviation over lattices, root mean square over points; NaN for a single
    # lattice
    scatter: float

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def misfit(self) -> float:
        """`rms` divided by the scatter of the lattices; NaN if there is no scatter."""
        if self.scatter > 0.0:
            return self.rms / self.scatter
        return np.nan

    @property
    def holds(self) -> bool:
        """Whether the law agrees with the lattices, as far as their scatter tells."""
        return not self.misfit > MAX_MISFIT


def fit_b(pressure: Array, xi: Array, young: float, poisson: float) -> Fit:
    """Fit b of eq. (2) to `xi` (lattices, pressures) [R] by relative least squares.

    `young`: E [M c^2/R^2]. The `values` of the fit also contain the smallest, median
    and largest b of fits to single lattices.
    """

    def law(b: float | Array) -> Array:
        return paper_compression(pressure, young, poisson, b)

    def solve(weights: Array) -> Array:
        """Return b (k, 1) for each of k weighted means; `weights` (k, lattices)."""
        means = weights @ xi

        # Fitting law/mean to 1 makes the residuals relative.
        def relative_law(b: Array) -> Array:
            return law(np.maximum(b, 1e-6)) / means

        start = np.ones((len(means), 1))
        b = least_squares(relative_law, np.ones_like(means), start)
        return np.maximum(b, 0.0)

    fit = _fit(("b",), solve, law, xi)
    of_lattices = solve(np.eye(len(xi)))
    scatter = {
        "b_min": float(of_lattices.min()),
        "b_median": float(np.median(of_lattices)),
        "b_max": float(of_lattices.max()),
    }
    return replace(fit, values=fit.values | scatter)


def fit_restitution(velocity: Array, e: Array, d1_is_1: bool = False) -> Fit:
    """Fit d1 and d2 of eq. (5) to e (lattices, velocities); `velocity` [c], where c is
    the paper's."""
    # Eq. (5) squared is a line: e^2 = A - B s with A = d1^2 and B = d1^2 d2. The line
    # that fits e^2 is the start of the fit to e.
    s = 1.0 / np.sqrt(np.log(4.0 / velocity))

    def root(A: float | Array, B: Array) -> Array:
        return np.asarray(np.sqrt(np.maximum(A - B * s, 0.0)))

    def solve(weights: Array) -> Array:
        means = weights @ e
        slope, level = np.polyfit(s, (means**2).T, 1)
        start = np.stack([level, -slope], axis=1)
        A_and_B = least_squares(lambda p: root(p[:, :1], p[:, 1:]), means, start)
        A, B = A_and_B.T
        d1 = np.sqrt(np.where(A > 0.0, A, np.nan))
        return np.stack([d1, B / A], axis=1)

    def solve_d2(weights: Array) -> Array:
        means = weights @ e
        start = (1.0 - means**2) @ s / (s @ s)
        d2 = least_squares(lambda B: root(1.0, B), means, start[:, None])
        return np.concatenate([np.ones_like(d2), d2], axis=1)

    def law(d1: float, d2: float) -> Array:
        return paper_restitution(velocity, d1, d2)

    if not d1_is_1:
        return _fit(("d1", "d2"), solve, law, e)
    fit = _fit(("d1", "d2"), solve_d2, law, e)
    intervals = {name: fit.intervals[name] for name in fit.intervals if name != "d1"}
    return replace(fit, intervals=intervals)


def fit_tau0(velocity: Array, e: Array, e_star: float) -> Fit:
    """Fit tau0 [R/c] of eq. (4) to e (lattices, velocities); `velocity` [c], `e_star`
    [M c^2/R^2]."""
    predict = quasistatic_curves(tuple(velocity.tolist()), e_star)
    unit = e_star**-0.5
    grid = np.geomspace(1e-3, MAX_TAU0, 48, dtype=np.float64)  # in this unit
    on_grid = predict(unit * grid)

    def in_units(tau0: Array) -> Array:
        return predict(unit * tau0[:, 0])

    def solve(weights: Array) -> Array:
        means = weights @ e
        squares = (on_grid[None] - means[:, None]) ** 2
        nearest = squares.sum(axis=2).argmin(axis=1)
        start = grid[nearest][:, None]
        return unit * least_squares(in_units, means, start)

    def law(tau0: float) -> Array:
        return predict(np.array([tau0]))[0]

    return _fit(("tau0",), solve, law, e)


@lru_cache(maxsize=4)  # shared by all curves of a figure
def quasistatic_curves(velocity: tuple[float, ...], e_star: float) -> Prediction:
    """Return a function that maps tau0 (k,) [R/c] to e (k, velocities) of eq. (4)."""
    # It is a polynomial in ln(1 + 5 tau0) through 11 Chebyshev points, accurate to
    # 5e-7. Speeds and times are scaled by sqrt(e_star) and its inverse, so that it is
    # computed at e_star = 1.
    unit = e_star**-0.5
    top = np.log1p(5.0 * MAX_TAU0)
    nodes = -np.cos(np.linspace(0.0, np.pi, 11))
    tau0_of_nodes = np.expm1(0.5 * top * (1.0 + nodes)) / 5.0
    e_of_nodes = _restitutions(unit * np.array(velocity), tau0_of_nodes[:, None])
    series = chebfit(nodes, e_of_nodes, 10)

    def predict(tau0: Array) -> Array:
        scaled = np.clip(tau0 / unit, 0.0, MAX_TAU0)
        argument = 2.0 * np.log1p(5.0 * scaled) / top - 1.0  # from -1 to 1
        return chebval(argument, series).T

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
    return their second derivatives."""
    # Negative values are concave, the paper's "convex upwards".
    middle = len(x) // 2
    top = x.max()
    halves = (slice(0, middle), slice(middle, None))
    powers = [np.vander(x[half] / top, 3) for half in halves]
    inverses = [np.linalg.pinv(matrix) for matrix in powers]
    mean = y.mean(0)
    parabolas = []
    for half, matrix, inverse in zip(halves, powers, inverses, strict=True):
        parabolas.append(matrix @ (inverse @ mean[half]))

    def solve(weights: Array) -> Array:
        means = weights @ y
        leading = []
        for half, inverse in zip(halves, inverses, strict=True):
            leading.append(means[:, half] @ inverse[0])
        return np.stack(leading, axis=1) * 2.0 / top**2

    def law(*_curvatures: float) -> Array:
        return np.concatenate(parabolas)

    return _fit(("slow_half", "fast_half"), solve, law, y)


def least_squares(model: Prediction, data: Array, start: Array) -> Array:
    """Fit parameters (k, p) to k data sets (k, points) by the Gauss-Newton method, from
    `start` (k, p)."""
    x: Array = np.array(start, float)
    for _ in range(12):
        steps = 1e-6 * np.maximum(np.abs(x), 1e-3)
        slopes = []
        for j, unit in enumerate(np.eye(x.shape[1])):
            change = model(x + steps * unit) - model(x - steps * unit)
            slopes.append(change / (2.0 * steps[:, j, None]))
        J = np.stack(slopes, axis=1)  # (k, p, points)
        residuals = data - model(x)
        gradient = J @ residuals[:, :, None]
        # ten times faster than pinv(J)
        inverse = np.linalg.pinv(J @ J.swapaxes(1, 2), hermitian=True)
        x += (inverse @ gradient)[:, :, 0]
    return x


def _fit(
    names: tuple[str, ...],
    solve: Callable[[Array], Array],
    law: Callable[..., Array],
    y: Array,
) -> Fit:
    """Return the fit of a law to y (lattices, points), with bootstrap intervals from
    reproducible resamples.

    `solve` maps weights (k, lattices) of k means over lattices to parameters (k,
    names), and `law` maps parameters to values (points,).
    """
    lattices = len(y)
    equal = np.full(lattices, 1.0 / lattices)
    best = solve(equal[None])[0].tolist()
    intervals = {}
    scatter = np.nan
    if lattices > 1:
        counts = np.random.default_rng(0).multinomial(lattices, equal, RESAMPLES)
        resampled = solve(counts / lattices)
        tail = 0.5 - LEVEL / 2
        bounds = np.nanquantile(resampled, [tail, 0.5 + LEVEL / 2], axis=0)
        for name, (low, high) in zip(names, bounds.T.tolist(), strict=True):
            intervals[name] = (low, high)
        scatter = float(np.sqrt(np.mean(y.var(0, ddof=1))))
    return Fit(
        values=dict(zip(names, best, strict=True)),
        intervals=intervals,
        residuals=y.mean(0) - law(*best),
        scatter=scatter,
    )
