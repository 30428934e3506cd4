"""A scene in time: simulate it, and take an automatic step back where wall or energy prove it too long."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError
from taichi_disk.model.integrators import SPLITTINGS
from taichi_disk.model.physics import Integrator
from taichi_disk.model.stability import Spectrum, step_limit
from taichi_disk.model.world import World
from taichi_disk.outcome import Outcome, Snapshots
from taichi_disk.progress import Progress
from taichi_disk.scene import TimeSection
from taichi_disk.scenes.setup import Columns, Setup
from taichi_disk.simulate import BlowUp, Simulation, imbalance, make_world, replay, simulate
from taichi_disk.time_step import TimeStep, choose, implicit_cost
from taichi_disk.tolerance import LEAST, RATIO, Other, Tried, better_step, error_estimate, settles

MARGIN = 0.95  # of the limit that the measured wall stiffness leaves; an automatic step above it is redone
CLOSING, WORST = 2e-5, 1e-4  # largest imbalance of the energy, at the end and ever, that an automatic step may leave
OPEN = 1e-3  # imbalance at the end that no result may have: it would show in the third digit of e
ATTEMPTS = 8
LONGEST_HELD_AGAINST = 0.96  # of the stability limit, a step to hold the automatic one against
# Of e in single precision (`taichi-disk accuracy`), which no difference between two runs shows. It grows with the
# number of steps, from this fraction of the stability limit down.
ROUNDING, ROUNDING_GROWS = 4e-7, 0.5


def first_step(setup: Setup, time: TimeSection, modes: Spectrum, force: bool = False) -> TimeStep:
    """The step with which `move` begins. Raises InputError for one by hand beyond the limit, unless `force`."""
    trial = Trial.first(setup, time)
    return choose(trial.time, setup.physics, modes, trial.point_force, force)


def move(
    setup: Setup,
    time: TimeSection,
    modes: Spectrum,
    progress: Progress,
    make: Callable[[Setup, TimeStep, World | None], World] = make_world,
    force: bool = False,
) -> Outcome:
    """Simulate `setup` to its end; an automatic step that proves too long is shortened, and a tolerance kept.

    `make` gives the world at t = 0, if possible with the kernels of the one before; `force` is that of `first_step`.
    Raises InputError as that does, SimulationError when the scene does not end in time or, at an automatic step, its
    ledger stays open, BlowUp when the state becomes meaningless.
    """
    trial, step = Trial.first(setup, time), first_step(setup, time, modes, force)
    world: World | None = None
    compile_seconds = 0.0
    for attempt in range(1, ATTEMPTS + 1):
        progress.start("compile", None)
        began = perf_counter()
        world = make(setup, step, world)
        compile_seconds += perf_counter() - began
        result: Simulation | BlowUp
        try:
            result = simulate(setup, world, step, setup.row_interval, progress)
        except BlowUp as failure:
            result = failure
        columns = None if isinstance(result, BlowUp) else result.columns
        trial = trial.with_run(setup, step, columns)
        stubborn = isinstance(result, BlowUp) and result.stubborn
        following = next_trial(trial, setup, step, modes, result.peak_point_force, columns, stubborn)
        if following is None or attempt == ATTEMPTS:
            break
        trial = following
        step = choose(trial.time, setup.physics, modes, trial.point_force)
    if isinstance(result, BlowUp):
        raise result
    if time.dt == "auto" and (still_open := unclosed(setup, result.columns)):
        raise SimulationError(still_open)
    if out := trial.out_of_tolerance(setup, result.columns):
        raise SimulationError(out)
    limit = step_limit(modes, replace(setup.physics, integrator=step.integrator), result.peak_point_force)
    return _describe(setup, trial, result, limit, attempt, compile_seconds)


@dataclass(frozen=True)
class Trial:
    """What a step is chosen from: the scene's `time` section and the force of the wall on one point [M c^2/R]."""

    time: TimeSection
    point_force: float
    excess: float = float("inf")  # of the energy imbalance over what is allowed, in the trial before
    stubborn: bool = False  # the trial before blew up from what a shorter step seldom mends
    tried: tuple[Tried, ...] = ()  # the runs so far, where an error has to be estimated

    @classmethod
    def first(cls, setup: Setup, time: TimeSection) -> Trial:
        """Where a tolerance is asked for, a longer step than the automatic one, to hold that against."""
        if time.tolerance != "none" and setup.depends_on_step:
            safety = max(time.safety, min(RATIO * time.safety, LONGEST_HELD_AGAINST))
            time = time.model_copy(update={"safety": safety})
        return cls(time, setup.point_force)

    def with_run(self, setup: Setup, step: TimeStep, columns: Columns | None) -> Trial:
        """This trial, knowing what a run with `step` gave; `columns` is None after a blow-up."""
        if self.time.tolerance == "none" or columns is None:
            return self
        worst = float(np.abs(imbalance(columns)).max()) / setup.energy_scale(columns)
        run = Tried(step.integrator, step.dt, setup.main_number(columns)[1], worst, step.dt / step.limit)
        return replace(self, tried=(*self.tried, run))

    def error(self, setup: Setup, columns: Columns) -> float | None:
        """The estimated error of the last headline; None without a tolerance, or while there is too little to tell."""
        if not self.tried:
            return None
        if not setup.depends_on_step:
            return setup.left_over(columns)
        error = error_estimate(self.tried, setup.resolving_step)
        return None if error is None else error + self.lasting(setup, columns)

    def lasting(self, setup: Setup, columns: Columns) -> float:
        """What the last headline is off by that no shorter step mends."""
        return setup.left_over(columns) + self.rounding

    @property
    def rounding(self) -> float:
        """What rounding has left in the last headline."""
        if self.time.precision == "f64":
            return 0.0
        return ROUNDING * max(1.0, ROUNDING_GROWS / self.tried[-1].fraction)

    def errors(self, setup: Setup, columns: Columns) -> dict[str, float]:
        """The estimated error of the headline by the headline's name, where one was asked for."""
        error = self.error(setup, columns)
        return {} if error is None else {setup.main_number(columns)[0]: error}

    def out_of_tolerance(self, setup: Setup, columns: Columns) -> str | None:
        """What to tell where the last run, which gave `columns`, is not known to be within the tolerance asked for."""
        tolerance = self.time.tolerance
        error = self.error(setup, columns)
        if tolerance == "none" or (error is not None and error <= tolerance):
            return None
        found = "cannot be estimated" if error is None else f"is estimated at {error:.2g}"
        text = f"time.tolerance is {tolerance:g}, and the error of the headline after {len(self.tried)} runs {found}"
        left = setup.left_over(columns)
        if left > 0.5 * tolerance:
            return f"{text}: {left:.2g} is left over where a run ends, at any step; {setup.less_left_over}"
        if setup.depends_on_step and self.rounding > 0.5 * tolerance:
            return f"{text}: {self.rounding:.2g} of it is rounding; write time.precision: f64"
        if not settles(self.tried):
            change = abs(self.tried[-1].headline - self.tried[-2].headline)
            text += f": shorter steps do not make it settle (the last changed it by {change:.2g})"
        return f"{text}; write a larger time.tolerance, or none"


def next_trial(
    trial: Trial,
    setup: Setup,
    step: TimeStep,
    modes: Spectrum,
    peak: float,
    columns: Columns | None,
    stubborn: bool = False,
) -> Trial | None:
    """What to choose a shorter step from, after `step` has been tried; None where it may stand.

    Ordinary scenes need none. Hard walls (a from 1,000 on) often do, two or three runs: how a point rattles between
    disk and wall is not foreseen. A force five times larger there, and longer strides to the last step, saved a tenth.

    Args:
        peak: largest force of the wall on one point that was measured [M c^2/R].
        columns: the time series, None after a blow-up.
        stubborn: whether that blew up from what a shorter step seldom mends: one more is tried.
    """
    if trial.time.dt != "auto" or (stubborn and trial.stubborn):
        return None
    trial = replace(trial, stubborn=stubborn)
    if trial.time.tolerance != "none" and columns is not None:
        return _closer(trial, setup, step, modes, peak, columns)
    limit = step_limit(modes, replace(setup.physics, integrator=step.integrator), peak)
    if step.dt > max(MARGIN, trial.time.safety) * limit:
        return replace(trial, point_force=1.5 * peak)
    factor = 0.5
    if columns is not None:
        lost = np.abs(imbalance(columns)) / setup.energy_scale(columns)
        excess = max(lost[-1] / CLOSING, lost.max() / WORST)
        # Where a shorter step does not help, it is not the step that is at fault.
        if excess <= 1.0 or excess > 0.5 * trial.excess:
            return None
        trial = replace(trial, excess=float(excess))
        factor = max(0.25, 0.9 / float(np.sqrt(excess)))  # order 2: the error falls with the square of the step
    # Of the step taken, which a reset boundary may have made shorter than the one that was asked for.
    return replace(trial, time=trial.time.model_copy(update={"safety": factor * step.dt / step.limit}))


def unclosed(setup: Setup, columns: Columns) -> str | None:
    """What to tell of a run whose energy ledger is so far off at the end that its result is none."""
    lost = float(imbalance(columns)[-1]) / setup.energy_scale(columns)
    allowed = OPEN if setup.scene.time.tolerance == "none" else max(OPEN, setup.scene.time.tolerance)
    if abs(lost) <= allowed:
        return None
    why = "the step is too long for what happens here: set time.dt: auto, or a shorter one"
    if setup.scene.time.dt == "auto":
        helps = "time.safety: 0.1" if setup.scene.time.precision == "f64" else "time.precision: f64"
        why = f"a shorter step did not help; {helps} may, and a step written as time.dt is kept, with a warning"
    return f"the energy ledger is off by {lost:+.2g} at the end, where {allowed:g} is allowed; {why}"


def _closer(trial: Trial, setup: Setup, step: TimeStep, modes: Spectrum, peak: float, columns: Columns) -> Trial | None:
    """What brings the headline within the scene's tolerance; None where it is.

    A first run beyond the measured stability limit still serves to compare with, the last must be within it.
    """

    def limit(integrator: Integrator, force: float = peak) -> float:
        return step_limit(modes, replace(setup.physics, integrator=integrator), force)

    time, measured = trial.time, limit(step.integrator)
    assert time.tolerance != "none"
    off = setup.depends_on_step and trial.out_of_tolerance(setup, columns)
    if not off and step.dt <= max(MARGIN, time.safety) * measured and not unclosed(setup, columns):
        return None
    room = time.tolerance - (trial.lasting(setup, columns) if setup.depends_on_step else 0.0)
    if room <= 0.0:
        return None
    other = None
    if time.integrator == "auto" and step.integrator == "trapezoidal" and setup.physics.boundary != "reset":
        cost = 1.0 / implicit_cost(modes, setup.physics, step.dt)
        other = Other("velocity_verlet", limit("velocity_verlet"), cost)
    elif time.integrator == "auto" and not setup.physics.damped:
        other = Other("vefrl", limit("vefrl"), SPLITTINGS["vefrl"].forces)
    excess = abs(float(imbalance(columns)[-1])) / setup.energy_scale(columns) / max(OPEN, time.tolerance)
    least = max(LEAST, float(np.sqrt(excess)), step.dt / (MARGIN * measured))
    better = better_step(trial.tried, room, step, other, setup.resolving_step, least)
    integrator = better.integrator if better.integrator != step.integrator else time.integrator
    safety = better.dt / limit(better.integrator, trial.point_force)
    return replace(trial, time=time.model_copy(update={"safety": safety, "integrator": integrator}))


def _describe(
    setup: Setup, trial: Trial, simulation: Simulation, limit: float, attempts: int, compile_seconds: float
) -> Outcome:
    world, columns = simulation.world, simulation.columns
    world.import_state(simulation.end)
    lost = imbalance(columns) / setup.energy_scale(columns)
    kinds = ("kinetic", "elastic", "wall", "dissipated", "absorbed", "sliding")
    energy = {name: float(columns[name][-1]) for name in kinds}
    warnings = [
        text
        for text in (
            _too_long(simulation.step, limit),
            unclosed(setup, columns) or _loose(setup, columns),
            slid(setup, columns),
        )
        if text
    ]
    facts: dict[str, Any] = {
        "warnings": warnings,
        "steps": simulation.end.step,
        "dt": simulation.step.dt,
        "dt_limit": limit,
        "attempts": attempts,
        "integrator": simulation.step.integrator,
        "error_estimate": trial.errors(setup, columns),
        "energy": energy
        | {
            "scale": setup.energy_scale(columns),
            "closing_imbalance": float(lost[-1]),
            "worst_imbalance": float(np.abs(lost).max()),
        },
    }

    def snapshots(times: NDArray[np.float64]) -> Snapshots:
        return replay(simulation, times)

    return Outcome(columns, world.positions()[0], world.velocities()[0], snapshots, facts, compile_seconds)


def _loose(setup: Setup, columns: Columns) -> str | None:
    """What to tell of a ledger that is open farther than any result's may be without a tolerance."""
    lost = float(imbalance(columns)[-1]) / setup.energy_scale(columns)
    if abs(lost) <= OPEN:
        return None
    return (
        f"the energy ledger is off by {lost:+.2g} at the end, which time.tolerance = {setup.scene.time.tolerance:g} "
        f"allows; without it no more than {OPEN:g} would be"
    )


def slid(setup: Setup, columns: Columns) -> str | None:
    """What to tell of a run in which sliding over the elastic wall's springs changed the energy visibly."""
    part = float(np.abs(columns["sliding"]).max()) / setup.energy_scale(columns)
    if part <= OPEN:
        return None
    return (
        f"points of the disk slid from spring to spring of the dented wall, which changed the energy by {part:.2g} of "
        "the kinetic energy: that is the contact law's own doing, at any step, and e is as uncertain; a lower "
        "impact.velocity or a higher material.k_a dents the wall less"
    )


def _too_long(step: TimeStep, limit: float) -> str | None:
    """What to tell of a step by hand that was stable by the estimate of the wall's force, but not by its measure."""
    if step.dt <= limit:
        return None
    return (
        f"the step {step.dt:.6g} R/c is beyond the stability limit that the measured force of the wall leaves, "
        f"{limit:.6g} R/c: set time.dt: auto, or a shorter one"
    )
