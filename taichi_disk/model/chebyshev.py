"""Chebyshev iteration for the implicit dashpots of large lattices: its bounds, its number of sweeps, their weights.

The matrix A = 1 + c L + Z (c = h/2 eta/m; Z >= 0 the dashpots of a matched boundary, times h/2m) has its eigenvalues
in 1..kappa, and kappa is known. K sweeps

    u_{k+1} = u_{k-1} + w_k (u_k + (b - A u_k)/theta - u_{k-1}),      w_0 = 1

(Golub & Varga, Numer. Math. 3, 147, 1961) leave a polynomial p of A of the first error, |p| <= `residue`. There
are no sums over the lattice in it, so that sweeps run on several cores and leave the same bytes on one. The interval
begins a little below 1, where p = 0: what all points have in common, the momentum, is solved exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_disk.model import ordering

# Largest residue times kappa, the part of the dashpots' force that one solve may leave wrong. The first guess is the
# prediction of `velocity_verlet`, whose error is O(h^2); the energy ledger counts the force that acts, and closes at
# any tolerance. Measured: with 0.03 and three sweeps at least, the order is 2 as with a factor, and all eigenvalues of
# a step stay within the unit circle up to 0.98 of the undamped limit whatever eta is. With 0.1 and two, up to 0.9.
TOLERANCE, LEAST = 0.03, 3

FACTOR_UP_TO = 5_000  # points; below, sweeps gain nothing that matters
SMALL_FACTOR_COST = 2.8  # of a step with a factor in lattices of about a thousand points, in explicit ones
BOUND = 1.2  # times the largest eigenvalue of L is what `largest_rate` finds for random lattices


def interval(kappa: float, sweeps: int) -> tuple[float, float]:
    """Centre and half-width of the interval whose Chebyshev polynomial of degree `sweeps` has its first root at 1."""
    first = np.cos(0.5 * np.pi / sweeps)
    low = (2.0 - kappa * (1.0 - first)) / (1.0 + first)
    return 0.5 * (kappa + low), 0.5 * (kappa - low)


def residue(kappa: float, sweeps: int) -> float:
    """Largest |p| in 1..kappa; infinite where so few sweeps cannot leave the momentum alone."""
    centre, half = interval(kappa, sweeps)
    if half >= centre:
        return float("inf")
    return float(1.0 / np.cosh(sweeps * np.arccosh(centre / half))) if half > 0.0 else 0.0


def sweeps_for(kappa: float) -> int:
    """The least number of sweeps within TOLERANCE."""
    sweeps = LEAST
    while kappa * residue(kappa, sweeps) > TOLERANCE:
        sweeps += 1
    return sweeps


def solver_for(points: int, kappa: float) -> tuple[int, float]:
    """The number of sweeps that solve best, 0 where a factor does; and the cost of a step, in explicit ones.

    Costs are measured (one core, f64). A factor has 2.5 n^(1/4) entries for each point, and from some size on fits no
    cache: its step costs 2.8 at n = 1,099, 4.0 at 10,000, 6.3 at 40,000. One with K sweeps costs 0.9 + 0.4 K at any
    size.
    """
    large = points >= ordering.PARALLEL_FROM  # a factor is one core's work
    if points < FACTOR_UP_TO and not large:
        return 0, SMALL_FACTOR_COST
    sweeps = sweeps_for(kappa)
    by_sweeps, by_factor = 0.94 + 0.42 * sweeps, 0.9 + 1.9 * (points / 1000.0) ** 0.25
    if not large and by_factor < by_sweeps:
        return 0, by_factor
    return sweeps, by_sweeps


def weights(kappa: float, sweeps: int) -> NDArray[np.float64]:
    """(1 + sweeps,) 1/theta, w_0, w_1, ..."""
    centre, half = interval(kappa, sweeps)
    found = [1.0 / centre, 1.0]
    ratio = 0.5 * (half / centre) ** 2
    for k in range(1, sweeps):
        found.append(1.0 / (1.0 - (ratio if k == 1 else 0.5 * ratio * found[-1])))
    return np.array(found)


def largest_rate(bonds: NDArray[np.int32], n: int) -> float:
    """A bound above the largest eigenvalue of the graph Laplacian of `bonds`, in random lattices 1.2 times it.

    The eigenvalue of L = D - B (D degrees, B neighbours) is at most that of D + B, and that, for any x > 0, at most
    max((D + B) x / x) (Collatz).
    """
    i, j = bonds.T
    degree = np.bincount(bonds.ravel(), minlength=n).astype(float)
    x, image = np.ones(n), 2.0 * degree
    for _ in range(4):
        x = np.maximum(image, 1.0)  # a lone point has no neighbours
        image = degree * x + np.bincount(i, x[j], n) + np.bincount(j, x[i], n)
    return float((image / x).max())


@dataclass(frozen=True)
class Iteration:
    """What the sweeps of one world read.

    neighbours: (n, width) int32, filled up with the point itself; a point held still has no others. Rows of equal
        length cost a fifth more sums, and half the time: no processor foresees how many neighbours comes next.
    numbers: (2 + sweeps,) c, 1/theta, w_0, w_1 ...
    outer: (n, c) the diagonal Z for the x and y components, c = 1 or 2.
    """

    neighbours: NDArray[np.int32]
    numbers: NDArray[np.float64]
    outer: NDArray[np.float64]


def iteration(
    bonds: NDArray[np.int32], coupling: float, kappa: float, free: NDArray[np.int32], outer: NDArray[np.float64]
) -> Iteration:
    """Sweeps for 1 + coupling L + diag(outer[:, c]) over the points `free`; see `factor.factorise`."""
    n = len(outer)
    moves = np.zeros(n, bool)
    moves[free] = True
    tail, head = np.concatenate([bonds, bonds[:, ::-1]]).T
    tail, head = tail[moves[tail]], head[moves[tail]]
    order = np.lexsort((head, tail))
    tail, head = tail[order], head[order]
    degree = np.bincount(tail, minlength=n)
    neighbours = np.repeat(np.arange(n, dtype=np.int32)[:, None], np.bincount(bonds.ravel()).max(), axis=1)
    neighbours[tail, np.arange(len(tail)) - np.repeat(np.cumsum(degree) - degree, degree)] = head
    numbers = np.concatenate([[coupling], weights(kappa, sweeps_for(kappa))])
    return Iteration(neighbours, numbers, outer)
