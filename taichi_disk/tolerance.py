"""How far a headline is off for its time step, estimated from runs with other steps, and which step to try next.

With e(h) = e + C h^p, two runs of one integrator give the error of the second: |e_1 - e_2|/((h_1/h_2)^p - 1)
(Richardson's extrapolation). A first run with the integrator of order 4 is held against the extrapolation of two runs
of order 2 instead, whose own error is larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from taichi_disk.model.integrators import SPLITTINGS
from taichi_disk.model.physics import Integrator
from taichi_disk.time_step import TimeStep

RATIO = 1.25  # of the first two steps: large enough to tell errors apart, small enough to be cheap
AIM = 0.7  # of the tolerance, at which a step is aimed


@dataclass(frozen=True)
class Tried:
    """One run: its integrator and step [R/c], and its headline."""

    integrator: Integrator
    dt: float
    headline: float


def error_estimate(tried: Sequence[Tried]) -> float | None:
    """Estimated error of the last headline; None where there is nothing to hold it against."""
    last = tried[-1]
    same = [one for one in tried[:-1] if one.integrator == last.integrator and one.dt != last.dt]
    if same:
        return abs(same[-1].headline - last.headline) / abs(_growth(same[-1], last) - 1.0)
    if len(tried) < 3:
        return None
    first, second = tried[-3:-1]
    extrapolated = second.headline + (second.headline - first.headline) / (_growth(first, second) - 1.0)
    return abs(last.headline - extrapolated)


def _growth(one: Tried, other: Tried) -> float:
    return float((one.dt / other.dt) ** SPLITTINGS[one.integrator].order)


def better_step(tried: Sequence[Tried], tolerance: float, step: TimeStep, order_4: bool) -> TimeStep | None:
    """What to try after `step`; None where the last headline is within `tolerance`.

    `order_4`: whether the integrator of order 4 may be taken once that costs less: not where velocities enter forces.
    """
    error = error_estimate(tried)
    if error is None:
        return replace(step, dt=step.dt / RATIO)
    if error <= tolerance:
        return None
    here, there = SPLITTINGS[step.integrator], SPLITTINGS["vefrl"]
    dt = step.dt * max(0.1, min((AIM * tolerance / error) ** (1.0 / here.order), 1.0 / RATIO))
    limit = step.limit * there.stable / here.stable
    if order_4 and step.integrator == "velocity_verlet" and 0.8 * limit / there.forces > dt:
        return TimeStep("vefrl", limit, 0.8 * limit)
    return replace(step, dt=dt)
