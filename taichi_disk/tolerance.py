"""How far a headline is off for its time step, estimated from runs with other steps, and which step to try next.

With e(h) = e + C h^p, two runs of one integrator give e by Richardson's extrapolation, and with it the error of the
second. Whether e(h) is that power yet two headlines cannot tell, so more is taken for the error; little more where the
energy's imbalance falls with the power that it should fall with. Three runs give two extrapolations: from what they
differ by follows what is left in the last of them, if the next power of the step is to blame. So a crushed disk that is
chaotic does not pass for one that has converged.

One thing the differences do not show. While a step crosses much of the wall's decay length 1/a at the speed of the
impact, the error stands at a plateau that two or three runs take for the answer. There the energy tells: the error is
not taken for less than a part of the worst imbalance.

The factors here were measured, on scenes whose truth is known: `taichi_disk.study.tolerance_trial`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from taichi_disk.model.integrators import SPLITTINGS
from taichi_disk.model.physics import Integrator
from taichi_disk.time_step import TimeStep

RATIO = 1.2  # of the first two steps: to tell errors apart, and cheap
CAUTION, REGULAR_CAUTION = 1.5, 1.1  # by which an estimate from two runs is enlarged
LEAST, MOST = 1.15, 3.0  # by which a later step is shortened: a longer leap would trust the power too far,
FAR = 8.0  # unless the runs were regular: the imbalance of two fell with its power, or of three
REGULAR = 1.1  # the estimate is enlarged by no more than this
AIM = 0.75  # of the tolerance, at which a step is aimed
RESOLVED = 0.7  # of the wall's decay length that a step may cross
UNRESOLVED_PART = 0.5  # of the worst imbalance, which the error may be where a step crosses more
LONGEST_FIRST = 0.95  # of its stability limit, with which another integrator begins


@dataclass(frozen=True)
class Tried:
    """One run: its integrator and step [R/c], its headline, its energy's worst imbalance over the kinetic energy.

    `fraction`: the step over its stability limit.
    """

    integrator: Integrator
    dt: float
    headline: float
    imbalance: float = 0.0
    fraction: float = 1.0

    @property
    def order(self) -> int:
        return SPLITTINGS[self.integrator].order

    @property
    def moved(self) -> float:
        """What e is off by if all the energy that is amiss is missing from the flight: e^2 is a part of energy."""
        return self.imbalance / (2.0 * self.headline)


@dataclass(frozen=True)
class Other:
    """An integrator to take instead: its stability limit [R/c], the cost of its step in steps of the present one."""

    integrator: Integrator
    limit: float
    cost: float

    def first(self, resolving: float) -> TimeStep:
        """The step that it begins with."""
        return TimeStep(self.integrator, self.limit, min(LONGEST_FIRST * self.limit, 2.0 * resolving))


def error_estimate(tried: Sequence[Tried], resolving: float = math.inf) -> float | None:
    """Estimated error of the last headline; None where there is nothing to hold it against.

    `resolving`: the longest step that resolves the wall [R/c].
    """
    error = _by_differences(tried, resolving)
    return None if error is None else max(error, _unseen(tried[-1], resolving))


def _unseen(run: Tried, resolving: float) -> float:
    """What the error may be without showing in differences."""
    return UNRESOLVED_PART * run.imbalance if run.dt > resolving else 0.0


def _by_differences(tried: Sequence[Tried], resolving: float) -> float | None:
    same, before = _same(tried)
    last = same[-1]
    if len(same) == 1:
        # An integrator's first run, held against the extrapolation of the runs before: as far off perhaps.
        if len(before) < 2:
            return None
        error = 2.0 * abs(last.headline - _extrapolated(*before[-2:]))
        if last.order == 4 and last.dt <= resolving:
            # There a twentieth of the scenes at most are off by more than three times what the energy tells.
            return min(max(error, last.moved), 3.0 * last.moved)
        return error
    answer = _extrapolated(*same[-2:])
    error = abs(last.headline - answer)
    if len(same) > 2:
        return error + _lever(*same[-3:]) * abs(answer - _extrapolated(*same[-3:-1]))
    if last.order == 4:  # whose power sets in later, and whose energy is as good a witness
        unresolved = abs(last.headline - same[0].headline) if last.dt > resolving else 0.0
        return max(CAUTION * error, last.moved, unresolved)
    return (REGULAR_CAUTION if _regular(*same) else CAUTION) * error


def _regular(first: Tried, second: Tried) -> bool:
    """Whether the imbalance of the energy falls with the power of the step that it should fall with."""
    if not (first.imbalance > 0.0 and second.imbalance > 0.0):
        return False
    power = math.log(first.imbalance / second.imbalance) / math.log(first.dt / second.dt)
    return abs(power - first.order) <= 0.1 * first.order


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


def _lever(first: Tried, second: Tried, last: Tried) -> float:
    """What the extrapolation of the last two runs is off by, over its distance from that of the first two.

    If e(h) = e + C h^p + D h^(p+1), that of steps h and k is off by D (h^(p+1) k^p - k^(p+1) h^p)/(h^p - k^p).
    """

    def off(one: Tried, other: Tried) -> float:
        h, k, p = one.dt, other.dt, one.order
        return h**p * k**p * (h - k) / (h**p - k**p)

    return off(second, last) / (off(first, second) - off(second, last))


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
    other: Other | None = None,
    resolving: float = math.inf,
    least: float = LEAST,
) -> TimeStep:
    """What to try after `step`, whose headline is not known to be within `tolerance`.

    Args:
        other: what may be taken instead of the present integrator, once that costs less.
        resolving: the longest step that resolves the wall [R/c].
        least: by which the step is to be shortened at the least.
    """
    same, _ = _same(tried)
    last = same[-1]
    if len(same) == 1:
        if other and SPLITTINGS[other.integrator].order > last.order and tolerance < _hopeless(last, resolving):
            return other.first(resolving)
        shorter = RATIO
        if last.order == 4:  # as its energy tells
            shorter = min(max(shorter, (last.imbalance / (AIM * tolerance)) ** 0.25), MOST)
        return replace(step, dt=step.dt / max(shorter, least))
    plain = abs(last.headline - _extrapolated(*same[-2:]))
    error = plain if len(same) == 2 else _by_differences(tried, resolving)
    assert error is not None
    shorter = (error / (AIM * tolerance)) ** (1.0 / last.order)
    if other and 0.8 * other.first(resolving).dt / other.cost * shorter > step.dt:
        return other.first(resolving)
    if _unseen(last, resolving) > tolerance:
        shorter = max(shorter, min(last.dt / resolving, math.sqrt(_unseen(last, resolving) / (AIM * tolerance))))
    shorter = max(shorter, least)
    regular = _regular(*same) if len(same) == 2 else error <= REGULAR * plain
    leaps = max(1, math.ceil(math.log(shorter) / math.log(FAR if regular else MOST)))  # of equal length
    return replace(step, dt=step.dt / shorter ** (1.0 / leaps))


def _hopeless(first: Tried, resolving: float) -> float:
    """The tolerance below which order 4 costs less, as far as the first run of order 2 tells.

    Errors of e are about c^2 of the worst imbalance, c the part of the wall's decay length that a step crosses; a step
    six times shorter than the limit costs as much as two runs of order 4.
    """
    crossed = RESOLVED * first.dt / resolving
    return first.imbalance * min(max(crossed**2, 0.01), 0.5) / 30.0
