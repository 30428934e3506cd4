"""Estimates of the memory and the time of a computation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taichi_disk.machine import cores

if TYPE_CHECKING:
    from taichi_disk.computation.driver import Driver

# bytes of a process and of each point; measured with 1,099 to 2,000,000 points
PROCESS = 3e8
POINT = 2e3
NOTED_MEMORY = 1e9  # [bytes] from which a run is announced
LONG_RUN = 60.0, 1e7  # [s], number of steps; a longer run is announced
FORCE_TIME = 4e-9  # [s] for one spring force on one core
PART_OF_LIMIT = 0.1  # fraction of the default time limit after which scenes usually end


def memory_note(points: int) -> str:
    """Return a sentence about the memory that `points` points will need, or an empty
    string if they need less than NOTED_MEMORY."""
    needed = PROCESS + POINT * points
    if needed < NOTED_MEMORY:
        return ""
    return f"{points:,} points need about {needed / 1e9:.1f} GB of memory"


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
