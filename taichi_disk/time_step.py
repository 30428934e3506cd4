"""Choosing the integrator and the step of a run, or refusing the ones that were asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

from taichi_disk.errors import InputError
from taichi_disk.model.chebyshev import BOUND, solver_for
from taichi_disk.model.physics import Integrator, Physics
from taichi_disk.model.stability import Spectrum, step_limit
from taichi_disk.scene import TimeSection


@dataclass(frozen=True)
class TimeStep:
    """How time advances: `limit` is the stability limit of `integrator` [R/c], `dt` the step taken [R/c]."""

    integrator: Integrator
    limit: float
    dt: float


def choose(
    time: TimeSection, physics: Physics, spectrum: Spectrum, point_force: float, force: bool = False
) -> TimeStep:
    """The step for a scene's `time` section.

    `integrator: auto` takes the dashpot implicitly where that reaches the end with less work. A reset boundary
    shortens the step until a whole number of steps fits the interval.
    Raises InputError for a `dt` beyond the limit, unless `force`.
    """

    def limit_of(integrator: Integrator) -> float:
        return step_limit(spectrum, replace(physics, integrator=integrator), point_force)

    integrator: Integrator
    if time.integrator == "auto":
        explicit, implicit = limit_of("velocity_verlet"), limit_of("trapezoidal")
        dt = time.safety * implicit if time.dt == "auto" else time.dt
        cost = implicit_cost(spectrum, physics, dt)
        integrator = "trapezoidal" if cost * explicit < implicit else "velocity_verlet"
    else:
        integrator = time.integrator
    limit = limit_of(integrator)
    if time.dt == "auto":
        dt = time.safety * limit
    else:
        dt = time.dt
        if dt > limit and not force:
            raise InputError(
                f"time.dt: {dt:g} R/c is beyond the stability limit of {integrator}, {limit:.6g} R/c for this scene; "
                f"write a smaller one (or auto: {time.safety * limit:.6g}), or see it blow up with `run --force`"
            )
    return TimeStep(integrator, limit, fitted(dt, physics.reset_interval))


def fitted(dt: float, interval: float) -> float:
    """The longest step up to `dt` of which a whole number fits `interval` [R/c]; `dt` where that is 0."""
    # Less a little, or a whole part of the interval that was rounded down would give the next one.
    return interval / ceil((1.0 - 1e-9) * interval / dt) if interval else dt


def implicit_cost(spectrum: Spectrum, physics: Physics, dt: float) -> float:
    """Of a step `dt` [R/c] with implicit dashpots, in explicit ones."""
    return solver_for(spectrum.points, 1.0 + 0.5 * dt * physics.eta * BOUND * spectrum.damping)[1]
