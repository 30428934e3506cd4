"""How far a headline is off for its time step, estimated from runs with other steps, and which step to try next.

With e(h) = e + C h^p, two runs of one integrator give e by Richardson's extrapolation, and with it the error of the
second. Whether e(h) is that power yet two runs cannot tell, so some more is taken for it. Three runs give two
extrapolations: what they differ by is what is wrong with the power, and is added as if it fell with the order p/2 only.
So it is where contacts jump, and a crushed disk that is chaotic does not pass for one that has converged.

One thing the differences do not show. While a step crosses much of the wall's decay length 1/a at the speed of the
impact, the error stands at a plateau that two or three runs take for the answer. There the energy tells: the error is
not taken for less than a part of the worst imbalance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from taichi_disk.model.integrators import SPLITTINGS
from taichi_disk.model.physics import Integrator
from taichi_disk.time_step import TimeStep

RATIO = {2: 1.4, 4: 1.25}  # of the first two steps, by the order: to tell errors apart, and cheap
CAUTION = {2: 1.5, 4: 2.6}  # by which an estimate from two runs is enlarged, by the order: 4 sets in later
LEAST, MOST = 1.15, 3.0  # by which a later step is shortened: a longer leap would trust the power too far,
REGULAR, FAR = 1.1, 8.0  # unless what three runs tell of it enlarges the estimate by no more than this
AIM = 0.75  # of the tolerance, at which a step is aimed
RESOLVED = 0.7  # of the wall's decay length that a step may cross
UNRESOLVED_PART = 0.5  # of the worst imbalance, which the error may be where a step crosses more
# Part of the worst imbalance below which errors of order 2 at the first step are rare: for a tolerance below it the
# integrator of order 4 is taken at once.
HOPELESS = 1e-3
FIRST_OF_ORDER_4 = 0.9  # of its stability limit


@dataclass(frozen=True)
class Tried:
    """One run: its integrator and step [R/c], its headline, its energy's worst imbalance over the kinetic energy."""

    integrator: Integrator
    dt: float
    headline: float
    imbalance: float = 0.0

    @property
    def order(self) -> int:
        return SPLITTINGS[self.integrator].order


def error_estimate(tried: Sequence[Tried], resolving: float = math.inf) -> float | None:
    """Estimated error of the last headline; None where there is nothing to hold it against.

    `resolving`: the longest step that resolves the wall [R/c].
    """
    error = _by_differences(tried)
    return None if error is None else max(error, _unseen(tried[-1], resolving))


def _unseen(run: Tried, resolving: float) -> float:
    """What the error may be without showing in differences."""
    return UNRESOLVED_PART * run.imbalance if run.dt > resolving else 0.0


def _by_differences(tried: Sequence[Tried]) -> float | None:
    same, before = _same(tried)
    last = same[-1]
    if len(same) == 1:
        # The first run of order 4: held against the extrapolation of the runs of order 2, as far off perhaps.
        return 2.0 * abs(last.headline - _extrapolated(*before[-2:])) if len(before) > 1 else None
    answer = _extrapolated(*same[-2:])
    error = abs(last.headline - answer)
    half = (same[-2].dt / last.dt) ** (0.5 * last.order)
    if len(same) > 2:
        return error + abs(answer - _extrapolated(*same[-3:-1])) / half
    if len(before) > 1:
        # Where order 2 was far from its power, so will order 4 be.
        earlier = _extrapolated(*before[-2:])
        off, claimed = abs(answer - earlier), abs(before[-1].headline - earlier)
        error += off * min(1.0, (off / claimed) ** 2) if claimed else off
    return CAUTION[last.order] * error


def _same(tried: Sequence[Tried]) -> tuple[list[Tried], list[Tried]]:
    """The last runs that one integrator made, each with a step of its own, and the runs of the one before it."""
    groups: list[list[Tried]] = [[]]
    for one in tried:
        if groups[-1] and groups[-1][-1].integrator != one.integrator:
            groups.append([])
        if not groups[-1] or groups[-1][-1].dt != one.dt:
            groups[-1].append(one)
    return groups[-1], groups[-2] if len(groups) > 1 else []


def _extrapolated(first: Tried, second: Tried) -> float:
    growth = (first.dt / second.dt) ** second.order
    return second.headline + (second.headline - first.headline) / (growth - 1.0)


def settles(tried: Sequence[Tried]) -> bool:
    """Whether the headline changed less from the last step to the one before than it had changed before."""
    same, _ = _same(tried)
    if len(same) < 3:
        return True
    first, second, last = (one.headline for one in same[-3:])
    return abs(last - second) <= abs(second - first)


def better_step(
    tried: Sequence[Tried],
    tolerance: float,
    step: TimeStep,
    order_4: bool,
    resolving: float = math.inf,
    least: float = LEAST,
) -> TimeStep:
    """What to try after `step`, whose headline is not known to be within `tolerance`.

    Args:
        order_4: whether the integrator of order 4 may be taken once that costs less: not where velocities enter forces.
        resolving: the longest step that resolves the wall [R/c].
        least: by which the step is to be shortened at the least.
    """
    same, _ = _same(tried)
    last = same[-1]
    here, there = SPLITTINGS[step.integrator], SPLITTINGS["vefrl"]
    limit = step.limit * there.stable / here.stable
    higher = order_4 and step.integrator == "velocity_verlet"
    if len(same) == 1:
        if higher and tolerance < HOPELESS * last.imbalance:
            return TimeStep("vefrl", limit, FIRST_OF_ORDER_4 * limit)
        return replace(step, dt=step.dt / max(RATIO[last.order], least))
    error = _by_differences(tried)
    assert error is not None
    if len(same) == 2:
        error /= CAUTION[last.order]
    longest = MOST
    if len(same) > 2 and error <= REGULAR * abs(last.headline - _extrapolated(*same[-2:])):
        longest = FAR
    shorter = (error / (AIM * tolerance)) ** (1.0 / last.order)
    if higher and 0.8 * limit / there.forces * shorter > step.dt:
        return TimeStep("vefrl", limit, FIRST_OF_ORDER_4 * limit)
    if _unseen(last, resolving) > tolerance:
        shorter = max(shorter, min(last.dt / resolving, math.sqrt(_unseen(last, resolving) / (AIM * tolerance))))
    shorter = max(shorter, least)
    leaps = max(1, math.ceil(math.log(shorter) / math.log(longest)))  # of equal length
    return replace(step, dt=step.dt / shorter ** (1.0 / leaps))
