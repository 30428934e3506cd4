"""Estimates of the memory and the time of a computation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taichi_disk.machine import cores

if TYPE_CHECKING:
    from taichi_disk.computation.driver import Driver

PROCESS, POINT = 3e8, 2e3  # bytes of a process and of each point; measured with 1,099 to 2,000,000 points
LONG_RUN = 60.0, 1e7  # [s], number of steps; a longer run is announced
EXPLICIT, IMPLICIT = 4e-9, 20e-9  # [s] for one spring force on one core, with explicit and implicit dashpots
PART_OF_LIMIT = 0.1  # fraction of the default time limit after which scenes usually end


def memory(points: int) -> float:
    return PROCESS + POINT * points


def duration(seconds: float) -> str:
    """Format an estimated time, rounded to its accuracy."""
    if seconds < 90.0:
        return f"{max(10, 10 * round(seconds / 10)):g} s"
    return f"{round(seconds / 60)} min" if seconds < 6000.0 else f"{seconds / 3600:.1f} h"


def announcement(driver: Driver) -> str | None:
    scenario, step = driver.scenario, driver.step
    steps, springs = PART_OF_LIMIT * scenario.max_time / step.dt, len(scenario.lattice.bonds)
    implicit = step.integrator.dashpots == "implicit" and scenario.model.springs.damped
    parallel = cores() if driver.simulation.subdomains > 1 else 1
    seconds = steps * springs * step.integrator.forces * (IMPLICIT if implicit else EXPLICIT) / parallel
    if seconds < LONG_RUN[0] and steps < LONG_RUN[1]:
        return None
    size = memory(len(scenario.lattice.positions)) / 1e9
    text = f"this will take about {duration(seconds)} and {size:.1f} GB of memory"
    return f"{text}: some {steps:.0e} steps of {step.dt:.2g} R/c for {springs:,} springs".replace("e+0", "e")
