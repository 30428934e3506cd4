"""How far a result is off for its time step, estimated from runs with other steps, and which step to try next.

With e(h) = e + C h^p, two runs of one integrator give e by Richardson's extrapolation, and with it the error of the
second. Two results cannot tell whether e(h) is that power, so more is taken for the error; little more where the
energy's imbalance falls with its power. Three runs give two extrapolations: their difference tells what is left in the
last, if the next power of the step is to blame.

While a step crosses much of the wall's decay length 1/a at the speed of the impact, the error stands at a plateau that
differences do not show. There it is not taken for less than a part of the worst energy imbalance.

The factors were measured, on scenes whose truth is known: `python -m tests.validation.estimate_trial`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from taichi_disk.integrators import Integrator

RATIO = 1.2  # of the first two steps: to tell errors apart, and cheap
CAUTION, REGULAR_CAUTION = 1.5, 1.1  # by which an estimate from two runs is enlarged
LEAST, MOST = 1.15, 3.0  # by which a later step is shortened: a longer leap would trust the power too far,
FAR = 8.0  # unless the runs were regular: the imbalance of two fell with its power, or of three
REGULAR = 1.1  # the estimate is enlarged by no more than this
AIM = 0.75  # of the tolerance, at which a step is aimed
UNRESOLVED_PART = 0.5  # of the worst imbalance, which the error may be where a step does not resolve the wall


@dataclass(frozen=True)
class TimeStep:
    """How time advances: `limit` is the stability limit of `integrator` [R/c], `dt` the step taken [R/c].

    `cost`: of a step, in force evaluations.
    """

    integrator: Integrator
    limit: float
    dt: float
    cost: float = 1.0


@dataclass(frozen=True)
class RunRecord:
    """One run: integrator and step [R/c], primary result, worst energy imbalance over the energy scale.

    `coarseness`: the step over the longest one that resolves the wall.
    """

    integrator: Integrator
    dt: float
    result: float
    imbalance: float = 0.0
    coarseness: float = 0.0

    @property
    def order(self) -> int:
        return self.integrator.order

    @property
    def moved(self) -> float:
        """What e is off by if all the energy that is amiss is missing from the flight: e^2 is a part of energy."""
        return self.imbalance / (2.0 * self.result)

    @property
    def unresolved(self) -> float:
        """What the error may be without showing in differences."""
        return UNRESOLVED_PART * self.imbalance if self.coarseness > 1.0 else 0.0


def error_estimate(records: Sequence[RunRecord]) -> float | None:
    """Estimated error of the last of the runs so far; None where there is nothing to hold it against."""
    error = _error_by_differences(records) if records else None
    return None if error is None else max(error, records[-1].unresolved)


def two_run_estimate(other: RunRecord, run: RunRecord) -> float:
    """Estimated error of `run`, from another run of the same integrator with a shorter step.

    Enlarged by CAUTION however regular the two are: see `python -m tests.validation.estimate_trial`.
    """
    return max(error_estimate((other, run)) or 0.0, CAUTION * abs(run.result - extrapolated(other, run)))


def extrapolated(first: RunRecord, second: RunRecord) -> float:
    """The result at a step of 0, by Richardson's extrapolation."""
    growth = (first.dt / second.dt) ** second.order
    return second.result + (second.result - first.result) / (growth - 1.0)


def _error_by_differences(records: Sequence[RunRecord]) -> float | None:
    same, before = _same_integrator(records)
    last, resolved = same[-1], same[-1].coarseness <= 1.0
    if len(same) == 1:
        # An integrator's first run, held against the extrapolation of the runs before: as far off perhaps.
        if len(before) < 2:
            return None
        error = 2.0 * abs(last.result - extrapolated(*before[-2:]))
        if last.order == 4 and resolved:
            # There a twentieth of the scenes at most are off by more than three times what the energy tells.
            return min(max(error, last.moved), 3.0 * last.moved)
        return error

    answer = extrapolated(*same[-2:])
    error = abs(last.result - answer)
    if len(same) > 2:
        return error + _remainder(*same[-3:]) * abs(answer - extrapolated(*same[-3:-1]))
    if last.order == 4:  # whose power sets in later, and whose energy is as good a witness
        return max(CAUTION * error, last.moved, 0.0 if resolved else abs(last.result - same[0].result))
    return (REGULAR_CAUTION if _regular(*same) else CAUTION) * error


def _regular(first: RunRecord, second: RunRecord) -> bool:
    """Whether the imbalance of the energy falls with the power of the step that it should fall with."""
    if not (first.imbalance > 0.0 and second.imbalance > 0.0):
        return False
    power = math.log(first.imbalance / second.imbalance) / math.log(first.dt / second.dt)
    return abs(power - first.order) <= 0.1 * first.order


def _same_integrator(records: Sequence[RunRecord]) -> tuple[list[RunRecord], list[RunRecord]]:
    """The last runs that one integrator made, each with a step of its own, and the runs of the one before it."""
    groups: list[list[RunRecord]] = [[], []]
    for one in records:
        if groups[-1] and groups[-1][-1].integrator is not one.integrator:
            groups.append([])
        if not groups[-1] or groups[-1][-1].dt != one.dt:
            groups[-1].append(one)
    return groups[-1], groups[-2]


def _remainder(first: RunRecord, second: RunRecord, last: RunRecord) -> float:
    """What the extrapolation of the last two runs is off by, over its distance from that of the first two.

    If e(h) = e + C h^p + D h^(p+1), that of steps h and k is off by D (h^(p+1) k^p - k^(p+1) h^p)/(h^p - k^p).
    """

    def off(one: RunRecord, other: RunRecord) -> float:
        h, k, p = one.dt, other.dt, one.order
        return h**p * k**p * (h - k) / (h**p - k**p)

    return off(second, last) / (off(first, second) - off(second, last))


def better_step(
    records: Sequence[RunRecord], tolerance: float, step: TimeStep, other: TimeStep | None = None, least: float = LEAST
) -> TimeStep:
    """What to try after `step`, whose result is not known to be within `tolerance`.

    Args:
        other: the first step of another integrator, which may be taken once that costs less.
        least: by which the step is to be shortened at the least.
    """
    same, _ = _same_integrator(records)
    last = same[-1]
    if len(same) == 1:
        shorter = RATIO
        if last.order == 4:  # as its energy tells
            shorter = min(max(shorter, (last.imbalance / (AIM * tolerance)) ** 0.25), MOST)
        return replace(step, dt=step.dt / max(shorter, least))

    plain = abs(last.result - extrapolated(*same[-2:]))
    error = plain if len(same) == 2 else _error_by_differences(records)
    assert error is not None
    shorter = (error / (AIM * tolerance)) ** (1.0 / last.order)
    if other and 0.8 * other.dt / other.cost * shorter > step.dt / step.cost:
        return other
    if last.unresolved > tolerance:
        shorter = max(shorter, min(last.coarseness, math.sqrt(last.unresolved / (AIM * tolerance))))
    shorter = max(shorter, least)
    regular = _regular(*same) if len(same) == 2 else error <= REGULAR * plain
    leaps = max(1, math.ceil(math.log(shorter) / math.log(FAR if regular else MOST)))  # of equal length
    return replace(step, dt=step.dt / shorter ** (1.0 / leaps))
