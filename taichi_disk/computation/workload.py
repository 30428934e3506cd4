"""Estimate of the time of a computation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taichi_disk.machine import cores

if TYPE_CHECKING:
    from taichi_disk.computation.driver import Driver

LONG_RUN = 60.0, 1e7  # [s], number of steps; a longer run is announced
FORCE_TIME = 4e-9  # [s] for one spring force on one core
PART_OF_LIMIT = 0.1  # fraction of the default time limit after which scenes usually end


def duration(seconds: float) -> str:
    """Format an estimated time, rounded to its accuracy."""
    if seconds < 90.0:
        return f"{max(10, 10 * round(seconds / 10)):g} s"
    return (
        f"{round(seconds / 60)} min" if seconds < 6000.0 else f"{seconds / 3600:.1f} h"
    )


def announcement(driver: Driver) -> str | None:
    scenario = driver.scenario
    step = driver.step
    points = len(driver.scenario.lattice.positions)
    steps = PART_OF_LIMIT * scenario.max_time / step.dt
    springs = len(scenario.lattice.bonds)
    parallel = cores() if driver.simulation.subdomains > 1 else 1
    seconds = steps * springs * step.integrator.cost(points) * FORCE_TIME / parallel
    if seconds < LONG_RUN[0] and steps < LONG_RUN[1]:
        return None
    work = f"{steps:.0e} steps of {step.dt:.2g} R/c for {springs:,} springs"
    return f"this will take about {duration(seconds)}: some {work}".replace("e+0", "e")
