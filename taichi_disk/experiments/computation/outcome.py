"""Computation of a scenario to its end: time series, states at any time, errors and
warnings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from taichi_disk.base.progress import Progress, silent
from taichi_disk.experiments.computation import diagnostics
from taichi_disk.experiments.computation.contact import Contact
from taichi_disk.experiments.computation.driver import Driver, State
from taichi_disk.experiments.computation.error_estimate import (
    SUSPICIOUS_ERROR,
    second_run,
    within_tolerance,
)
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.computation.stability import Spectrum, TimeStep, spectrum
from taichi_disk.experiments.computation.step_control import StepControl
from taichi_disk.experiments.computation.words import Numbers
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics import Model
from taichi_disk.mechanics.simulation.observables import Columns, split

# a run with more spring evaluations (some 5 s) gets no second run for an error estimate
ESTIMATE_UP_TO = 1.3e9
# ratio of the stated error to the distance from Newton's equilibrium
REST_CAUTION = 1.1
# approximate error of xi by rounding and by the solver's tolerance [R]
ROUNDING = 1e-11
# number of equilibria of a quasi-static loading; a film hardly changes from one to the
# next
LOADS = 24


@dataclass(frozen=True, eq=False)
class Outcome:
    """A scenario computed to its end."""

    scenario: Scenario
    series: Columns  # time series, an array (rows,) for each column of timeseries.csv
    positions: Array  # (n, 2) at the end [R]
    velocities: Array  # (n, 2) at the end [c]
    largest_force: float  # largest force of the wall on one point [M c^2/R]
    # computes the run again: states at ascending times, bitwise equal
    replay: Callable[[Array], Iterator[State]]
    # the same for pictures, which interpolate a quasi-static loading
    frames: Callable[[Array], Iterator[State]]
    summary: dict[str, Any]  # results and how they were computed, for summary.json

    def __post_init__(self) -> None:
        # `t = series["t"]; t -= t[k]` would change every later result and file
        for array in (*self.series.values(), self.positions, self.velocities):
            array.flags.writeable = False

    @property
    def end(self) -> float:
        """Time of the last row [R/c]."""
        return float(self.series["t"][-1])

    @cached_property
    def contact(self) -> Contact:
        """The contact of wall and disk: when it begins, ends and is closest."""
        return Contact(self.series)


def compute(
    scenario: Scenario,
    progress: Progress = silent,
    *,
    spectrum_of: Callable[[Lattice, Model], Spectrum] = spectrum,
    force: bool = False,
    estimate: bool = True,
    loads: int = LOADS,
) -> Outcome:
    """Compute `scenario` to its end.

    Args:
        spectrum_of: returns the spectrum of the lattice and the model.
        force: whether to accept a user's step beyond the stability limit.
        estimate: whether a second run estimates the error, unless that takes long.
        loads: number of equilibria of a quasi-static loading; 1: only the full load,
            with bitwise the same result.

    Raises InputError if the user's step is beyond the stability limit, SimulationError
    if the scene does not end in time or its energy balance is lost, BlowUp if the state
    becomes meaningless.
    """
    if scenario.static:
        return scenario.quasistatic(loads, progress)
    control = StepControl(
        scenario, spectrum_of(scenario.lattice, scenario.model), force
    )
    runs = Runs(scenario, progress, "simulate", scenario.max_time)
    driver = runs.run(control.step)
    while control.shortens(driver):
        driver = runs.run(control.step)
    if driver.failure:
        raise driver.failure
    errors = None
    if scenario.scene.time.tolerance != "none" and scenario.step_dependent:
        driver, errors = within_tolerance(driver, runs.run)
    return _described(driver, errors, estimate, runs)


@dataclass
class Runs:
    """The runs of one scenario with several steps. `stage`, `last`: what `progress`
    gets, besides the time; `attempts`: their number so far."""

    scenario: Scenario
    progress: Progress
    stage: str
    last: float
    attempts: int = 0

    def run(self, step: TimeStep) -> Driver:
        """Return the driver of a run that has finished or failed."""
        self.attempts += 1
        driver = Driver(self.scenario, step)
        self.progress(self.stage, 0.0, self.last)
        while driver.advance(seconds=0.1) == "running":
            self.progress(self.stage, driver.simulation.time, self.last)
        driver.let_go()
        return driver


def _described(
    driver: Driver, errors: Numbers | None, estimate: bool, runs: Runs
) -> Outcome:
    scenario = driver.scenario
    step = driver.step
    end = driver.end
    assert end is not None
    columns = split(driver.columns, scenario.lattice.inertia)
    largest = driver.largest_force
    _, positions, velocities = driver.final
    limit = step.limit_under(largest)
    warnings = diagnostics.warnings(scenario, columns)
    if step.dt > limit:
        beyond = "is beyond the stability limit with the measured force of the wall"
        remedy = "set time.dt: auto, or a shorter step"
        warnings.insert(
            0, f"the step {step.dt:.6g} R/c {beyond}, {limit:.6g} R/c: {remedy}"
        )
    small = (
        estimate
        and end.step * step.integrator.forces * len(scenario.lattice.bonds)
        <= ESTIMATE_UP_TO
    )
    primary, value = scenario.primary(columns)
    if not scenario.step_dependent:
        left = scenario.end_truncation_error(columns)
        errors = {primary: REST_CAUTION * left + ROUNDING}
    elif errors is None and small:
        others = Runs(scenario, runs.progress, "estimate", driver.final.t)
        errors = second_run(driver, others.run)
    errors = errors or {}
    gained = diagnostics.energy_gained(scenario, columns, errors.get(primary))
    if gained:
        warnings.append(diagnostics.faster_than_before(gained))
    is_uncertain = errors.get(primary, 0.0) > SUSPICIOUS_ERROR * abs(value)
    if is_uncertain and value and scenario.step_dependent:
        warnings.append(uncertain(primary, value, errors[primary]))
    summary = summary_of(scenario, columns, warnings) | {
        "steps": end.step,
        "dt": step.dt,
        "dt_limit": limit,
        "attempts": runs.attempts,
        "integrator": step.integrator.name,
        "error_estimate": errors,
        "error_source": "time step" if scenario.step_dependent else "end of the run",
        "energy": diagnostics.summary(scenario, columns),
    }
    if gained:
        summary["gained_from"] = diagnostics.parts_text(gained)
    return Outcome(
        scenario=scenario,
        series=columns,
        positions=positions,
        velocities=velocities,
        largest_force=largest,
        replay=driver.replay,
        frames=driver.replay,
        summary=summary,
    )


def uncertain(name: str, value: float, error: float) -> str:
    """Return a warning about a result that is hardly known."""
    return (
        f"the estimated error of {name} is {error:.2g}, {error / abs(value):.1%} of it:"
        " the motion may be so irregular that the time step decides it; time.tolerance"
        " finds out whether a shorter step helps"
    )


def summary_of(
    scenario: Scenario, columns: Columns, warnings: list[str]
) -> dict[str, Any]:
    """Return results, their definitions, `warnings`, and the number of inverted
    triangles."""
    numbers = scenario.result(columns)
    known = {*numbers, "vibration_left"}
    measured = {
        name: note for name, note in scenario.words.measured.items() if name in known
    }
    return {
        **numbers,
        "measured": measured,
        "warnings": warnings,
        "inverted_triangles": int(columns["inverted"].max()),
    }
