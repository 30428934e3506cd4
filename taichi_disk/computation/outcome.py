"""A scenario computed to its end: its time series, its states at any time, how it was computed, how far it is off."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_disk.computation import diagnostics
from taichi_disk.computation.contact import greatest_compression
from taichi_disk.computation.driver import Driver, Moment
from taichi_disk.computation.error_estimate import SecondRun, second_run, within_tolerance
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum, spectrum
from taichi_disk.computation.workload import announcement
from taichi_disk.lattice import Array
from taichi_disk.lattice.lattice import double_area
from taichi_disk.progress import Progress, silent
from taichi_disk.simulation.observables import Columns, split
from taichi_disk.simulation.simulation import KernelCache

ESTIMATE_UP_TO = 1.3e9  # spring evaluations of a run, some 5 s, up to which a second run for the error is made unasked
REST_CAUTION = 1.1  # by which the distance from Newton's rest is enlarged
ROUNDING = 1e-11  # of xi [R], about, and of where the solver stops
LOADS = 24  # of a quasi-static loading: from one to the next a film hardly changes


@dataclass(frozen=True)
class Outcome:
    """A scenario computed to its end.

    Attributes:
        scenario: what was computed.
        columns: the time series.
        positions, velocities: (n, 2) at the end.
        largest_force: of the wall on one point, ever [M c^2/R].
        replay: the moments at given ascending times, computed when asked for, bitwise those of the run.
        frames: the same for pictures: of a quasi-static loading, interpolated between its equilibria.
        summary: what summary.json holds of it: results, and how they were computed.
        compile_seconds: wall-clock time spent on compiling.
    """

    scenario: Scenario
    columns: Columns
    positions: Array
    velocities: Array
    largest_force: float
    replay: Callable[[Array], Iterator[Moment]]
    frames: Callable[[Array], Iterator[Moment]]
    summary: dict[str, Any]
    compile_seconds: float = 0.0


def compute(
    scenario: Scenario,
    time: Any,
    progress: Progress = silent,
    kernels: KernelCache | None = None,
    *,
    modes: Spectrum | None = None,
    force: bool = False,
    estimate: bool = True,
    loads: int = LOADS,
    say: Callable[[str], None] = lambda text: None,
) -> Outcome:
    """Compute `scenario` to its end.

    Args:
        time: the scene's section `time`.
        modes: the spectrum of its lattice and model, if known.
        force: take a hand-written step even beyond the stability limit.
        estimate: whether to estimate the error and to count triangles turned inside out, by running again, unless that
            would take long.
        loads: how many equilibria a quasi-static loading goes through; 1: the last alone, bitwise the same.
        say: told what a long run will cost, before it begins.

    Raises InputError for a step by hand that is too long, SimulationError when the scene does not end in time or its
    energy balance is lost, BlowUp when the state becomes meaningless.
    """
    if scenario.static:
        return scenario.quasistatic(loads, progress)
    kernels = kernels or KernelCache()
    modes = modes or spectrum(scenario.lattice, scenario.model)

    def finished(time: Any) -> Driver:
        driver = Driver(scenario, time, kernels, modes, force=force)
        if text := announcement(driver):
            say(text)
        progress("simulate", 0.0, scenario.max_time)
        while driver.advance(seconds=0.1) in ("running", "restarted"):
            progress("simulate", driver.simulation.time, scenario.max_time)
        if driver.failure:
            raise driver.failure
        return driver

    driver, second = finished(time), None
    if time.tolerance != "none" and scenario.step_dependent:
        driver, second = within_tolerance(driver, finished)
    return _described(driver, second, estimate)


def _described(driver: Driver, second: SecondRun | None, estimate: bool) -> Outcome:
    scenario, step, end = driver.scenario, driver.step, driver.end
    assert end is not None
    columns, largest = split(driver.columns, scenario.lattice.inertia), driver.largest_force
    _, positions, velocities = driver.final
    limit = driver.control.limit(step.integrator, largest)
    warnings = diagnostics.warnings(scenario, columns)
    if step.dt > limit:
        beyond = "is beyond the stability limit that the measured force of the wall leaves"
        remedy = "set time.dt: auto, or a shorter one"
        warnings.insert(0, f"the step {step.dt:.6g} R/c {beyond}, {limit:.6g} R/c: {remedy}")
    small = estimate and end.step * step.integrator.forces * len(scenario.lattice.bonds) <= ESTIMATE_UP_TO
    errors, compressed = dict[str, float](), None
    if not scenario.step_dependent:
        errors[scenario.primary(columns)[0]] = REST_CAUTION * scenario.end_truncation_error(columns) + ROUNDING
        if small:
            _, compressed, _ = next(driver.replay(np.array([greatest_compression(columns)])))
    elif second or small:
        errors, compressed = second or second_run(driver)
    summary = summary_of(scenario, columns, warnings, compressed) | {
        "steps": end.step,
        "dt": step.dt,
        "dt_limit": limit,
        "attempts": driver.attempt,
        "integrator": step.integrator.name,
        "error_estimate": errors,
        "error_source": "time step" if scenario.step_dependent else "end of the run",
        "energy": diagnostics.summary(scenario, columns),
    }
    replay, seconds = driver.replay, driver.compile_seconds
    return Outcome(scenario, columns, positions, velocities, largest, replay, replay, summary, seconds)


def inverted_triangles(scenario: Scenario, x: Array) -> int:
    """How many triangles of the lattice are turned inside out at the positions `x` (n, 2)."""
    return int((double_area(x[scenario.lattice.triangles]) < 0.0).sum())


def summary_of(scenario: Scenario, columns: Columns, warnings: list[str], compressed: Array | None) -> dict[str, Any]:
    """Return the results, how each is measured, and `warnings`, for summary.json.

    `compressed`, (n, 2) the most compressed state if it is known: its triangles turned inside out are counted.
    """
    numbers = scenario.result(columns)
    measured = {name: note for name, note in scenario.notes.items() if name in numbers}
    summary: dict[str, Any] = {**numbers, "measured": measured, "warnings": warnings}
    if compressed is None:
        return summary
    if inverted := inverted_triangles(scenario, compressed):
        warnings.append(
            f"{inverted} triangle{'s' * (inverted > 1)} of the lattice turned inside out: springs have crossed there, "
            "and the result is meaningless; lower the speed or the pressure, or take fewer points"
        )
    return summary | {"inverted_triangles": inverted}
