"""A scenario computed to its end: its time series, its states at any time, how it was computed, how far it is off."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taichi_disk.computation import diagnostics
from taichi_disk.computation.contact import greatest_compression
from taichi_disk.computation.driver import Driver, Moment
from taichi_disk.computation.error_estimate import SecondRun, second_run, within_tolerance
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum, spectrum
from taichi_disk.computation.workload import announcement
from taichi_disk.lattice import Array, Lattice
from taichi_disk.lattice.lattice import double_area
from taichi_disk.physics import Load, Model
from taichi_disk.progress import Progress, silent
from taichi_disk.simulation.observables import INDEX, Columns, split
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.statics.equilibrium import depth, roll_angle, solve_equilibrium, turned

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
        largest_push: of the wall on one point, ever [M c^2/R].
        replay: the moments at given ascending times, computed when asked for, bitwise those of the run.
        frames: the same for pictures: of a quasi-static loading, interpolated between its equilibria.
        summary: what summary.json holds of it: results, and how they were computed.
        compile_seconds: wall-clock time spent on compiling.
    """

    scenario: Scenario
    columns: Columns
    positions: Array
    velocities: Array
    largest_push: float
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
        return quasistatic(scenario, loads, progress)
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
    columns, peak = split(driver.columns, scenario.lattice.inertia), driver.largest_force
    _, positions, velocities = driver.final
    limit = driver.control.limit(step.integrator, peak)
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
    inverted = {} if compressed is None else _inverted(scenario, compressed, warnings)
    summary = _results(scenario, columns) | {
        "warnings": warnings,
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
    return Outcome(scenario, columns, positions, velocities, peak, replay, replay, summary | inverted, seconds)


def _results(scenario: Scenario, columns: Columns) -> dict[str, Any]:
    """The numbers of the result, and how each is measured."""
    numbers = scenario.result(columns)
    return {**numbers, "measured": {name: note for name, note in scenario.notes.items() if name in numbers}}


def inverted_triangles(scenario: Scenario, x: Array) -> int:
    """How many triangles of the lattice are turned inside out at the positions `x` (n, 2)."""
    return int((double_area(x[scenario.lattice.triangles]) < 0.0).sum())


def _inverted(scenario: Scenario, x: Array, warnings: list[str]) -> dict[str, int]:
    """For the summary; a warning is added if there are any."""
    if inverted := inverted_triangles(scenario, x):
        warnings.append(
            f"{inverted} triangle{'s' * (inverted > 1)} of the lattice turned inside out: there springs are no elastic "
            "body any more, which is the model's own limit; a lower speed or pressure, or fewer points, keep it whole"
        )
    return {"inverted_triangles": inverted}


@dataclass
class _Loading:
    """Equilibria under growing loads: `states` (n, 2) of a lattice under the `parts` of the load of a model."""

    lattice: Lattice
    model: Model
    parts: Array
    states: list[Array]

    def pressed(self, part: float) -> Model:
        assert self.model.load is not None
        return replace(self.model, load=Load(part * self.model.load.force))

    def under(self, part: float, start: Array) -> Array:
        return solve_equilibrium(self.lattice, self.pressed(part), start, is_close=True).positions

    def frames(self, times: Array) -> Iterator[Moment]:
        parts, states = self.parts, self.states
        for part in np.clip(times, parts[0], 1.0).tolist():
            k = max(int(np.searchsorted(parts, part)), 1)
            share = (part - parts[k - 1]) / (parts[k] - parts[k - 1])
            yield part, (1.0 - share) * states[k - 1] + share * states[k], np.zeros_like(states[0])

    def replay(self, times: Array) -> Iterator[Moment]:
        for part, x, v in self.frames(times):
            yield part, x if part in self.parts else self.under(part, x), v


def quasistatic(scenario: Scenario, loads: int, progress: Progress = silent) -> Outcome:
    """Equilibria under growing loads: `t` is the part of the full load, `xi` the compression under it [R].

    They are solved for from the full load down, each from the one above: the last does not depend on their number.
    """
    lattice, model, rest = scenario.lattice, scenario.model, scenario.rest
    assert rest is not None and model.wall is not None and model.load is not None
    full, still = model.load.force, np.zeros_like(rest.positions)
    parts = (np.arange(1, loads + 1) / loads) ** 1.5  # closer where the disk settles down
    loading = _Loading(lattice, model, parts, [rest.positions])
    states = loading.states
    progress("simulate", 0, loads)
    for part in parts[-2::-1]:
        states.insert(0, loading.under(part, states[0]))
        progress("simulate", len(states), loads)

    columns: Columns = {name: np.zeros(loads) for name in (*INDEX, "xi")} | {"t": parts}
    for k, x in enumerate(states):
        columns["com_x"][k], columns["com_y"][k] = lattice.mean(x)
        columns["lowest_y"][k] = x[:, 1].min()
        # Against the unloaded disk as it lies under this load: it rolls a little as the load grows.
        unloaded = turned(lattice.positions, roll_angle(lattice.positions, x))
        columns["xi"][k] = depth(lattice, unloaded) - depth(lattice, x)
        columns["wall_force"][k] = model.wall.forces(lattice, x)[:, 1].sum()
        columns["residual"][k] = np.hypot(*loading.pressed(parts[k]).forces(lattice, x).T).max()
        columns["elastic"][k], columns["wall"][k] = model.springs.energy(lattice, x), model.wall.energy(lattice, x)
    columns["load"] = parts * full * columns["com_y"]
    columns["total"] = columns["elastic"] + columns["wall"] + columns["load"]
    warnings: list[str] = []
    summary = _results(scenario, columns) | {"warnings": warnings, "steps": rest.iterations, "integrator": "newton"}
    summary |= {"error_estimate": {}, "residual": rest.residual, "roll": rest.roll}
    summary |= _inverted(scenario, rest.positions, warnings)
    largest = float(np.hypot(*model.wall.contact_forces(lattice, rest.positions)[1].T).max(initial=0.0))
    return Outcome(scenario, columns, rest.positions, still, largest, loading.replay, loading.frames, summary)
