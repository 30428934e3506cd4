"""How far a result is off for its time step, estimated from two runs of one integrator.

With e(h) = e + C h^p two runs give e by Richardson's extrapolation, and with it the error of each. Two results cannot
tell whether e(h) is that power, so more is taken for the error.

While a step crosses much of the wall's decay length 1/a at the speed of the impact, the error stands at a plateau that
differences do not show. There it is not taken for less than a part of the worst energy imbalance.

The factors were measured, on scenes whose truth is known: `python -m tests.validation.estimate_trial`.
"""

from __future__ import annotations

from dataclasses import dataclass

from taichi_disk.integrators import Integrator

COMPARED = 1.5  # by which the step of a second run is shorter
CAUTION = 1.5  # by which the difference is enlarged
UNRESOLVED_PART = 0.5  # of the worst imbalance, which the error may be where a step does not resolve the wall


@dataclass(frozen=True)
class TimeStep:
    """How time advances: `limit` is the stability limit of `integrator` [R/c], `dt` the step taken [R/c]."""

    integrator: Integrator
    limit: float
    dt: float


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


def error_estimate(other: RunRecord, run: RunRecord) -> float:
    """Estimated error of `run`, from another run of the same integrator with a longer or shorter step."""
    growth = (other.dt / run.dt) ** run.integrator.order
    extrapolated = run.result + (run.result - other.result) / (growth - 1.0)
    unresolved = UNRESOLVED_PART * run.imbalance if run.coarseness > 1.0 else 0.0
    return max(CAUTION * abs(run.result - extrapolated), unresolved)
