"""Computing the points of a sweep that share a lattice.

A point's numbers follow from its own scene alone, to the last bit: not from the points beside it, nor from how
many processes there are. Lanes share a time step, so automatic steps are rounded down to a rung of a ladder,
which many points of a sweep then have in common.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from taichi_disk.dynamics import ATTEMPTS, Trial, next_trial, unclosed
from taichi_disk.errors import TaichiDiskError
from taichi_disk.lattice import Lattice
from taichi_disk.model.stability import Spectrum, spectrum
from taichi_disk.moduli import Moduli, bulk_moduli
from taichi_disk.quasistatic import press
from taichi_disk.scene import CompressionScene, Scene
from taichi_disk.scenes import body_of, build
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import BlowUp, imbalance
from taichi_disk.study.lanes import Ending, LaneEngine
from taichi_disk.time_step import TimeStep, choose

RUNGS = 4  # of the ladder of time steps, per factor of two


@dataclass(frozen=True)
class PointResult:
    """What became of one point. `numbers`: headline, moduli, error estimate, steps, dt, integrator."""

    status: str  # done or failed
    reason: str | None = None
    numbers: dict[str, Any] = field(default_factory=dict)


def lattice_key(scene: Scene) -> str:
    """Equal for scenes that have their lattice, material stiffness and wall shape in common."""
    return repr((scene.scene, scene.lattice, scene.wall, scene.material.k_a, scene.material.k_b, scene.time))


class Computer:
    """Computes points in one process; starts Taichi when the first of them has to be stepped."""

    def __init__(self) -> None:
        self._engine: LaneEngine | None = None

    def close(self) -> None:
        """Give back what Taichi holds; only then does it keep what it compiled for the next process."""
        if self._engine is not None:
            import taichi as ti

            ti.reset()
            self._engine = None

    def compute(self, scenes: Sequence[Scene]) -> Iterator[tuple[int, PointResult]]:
        """Results of `scenes`, which agree in `lattice_key`, as (index, result) in the order of their ending."""
        try:
            body = body_of(scenes[0])
            first = scenes[0]
            spec = first.lattice
            moduli = bulk_moduli(spec.points, spec.seed, first.material.k_a, spec.min_spacing)
        except TaichiDiskError as error:
            for k in range(len(scenes)):
                yield k, PointResult("failed", str(error))
            return
        still = [k for k, scene in enumerate(scenes) if _is_newton(scene)]
        for k in still:
            yield k, _pressed(scenes[k], body, moduli)
        moving = [k for k in range(len(scenes)) if k not in still]
        if moving:
            yield from self._stepped({k: scenes[k] for k in moving}, body, moduli)

    def _stepped(self, scenes: dict[int, Scene], body: Lattice, moduli: Moduli) -> Iterator[tuple[int, PointResult]]:
        precision = next(iter(scenes.values())).time.precision
        if self._engine is None or self._engine.precision != precision:
            self._engine = LaneEngine(precision)
        modes: dict[bool, Spectrum] = {}
        queue: list[_Job] = []
        for k, scene in scenes.items():
            try:
                setup = build(scene, body)
                damped = setup.physics.dissipates
                # Of the lattice where it was made: a shift would change the last digits.
                modes[damped] = modes.get(damped) or spectrum(body, setup.physics)
                trial = Trial.first(setup, scene.time)
                queue.append(_Job(k, setup, trial, _step(setup, trial, modes[damped]), 1))
            except TaichiDiskError as error:
                yield k, PointResult("failed", str(error))
        while queue:
            again: list[_Job] = []
            for group in _groups(queue, self._engine.lanes):
                step = group[0].step
                for lane, ending in self._engine.run([job.setup for job in group], step, group[0].setup.row_interval):
                    mode = modes[group[lane].setup.physics.dissipates]
                    job, following = _following(group[lane], mode, ending)
                    if following is None or job.attempt == ATTEMPTS:
                        yield job.index, _described(job, step, ending, moduli)
                    else:
                        shorter = _step(job.setup, following, mode)
                        again.append(replace(job, trial=following, step=shorter, attempt=job.attempt + 1))
            queue = again


@dataclass(frozen=True)
class _Job:
    index: int
    setup: Setup
    trial: Trial
    step: TimeStep
    attempt: int


def _is_newton(scene: Scene) -> bool:
    return isinstance(scene, CompressionScene) and scene.compression.method == "newton"


def _pressed(scene: Scene, body: Lattice, moduli: Moduli) -> PointResult:
    try:
        setup = build(scene, body)
        assert isinstance(setup, Compression)
        outcome = press(setup)
    except TaichiDiskError as error:
        return PointResult("failed", str(error))
    numbers = {**setup.headline(outcome.columns).values, "young": moduli.young, "poisson": moduli.poisson}
    residual = outcome.facts["residual"] * scene.lattice.points / setup.physics.load
    return PointResult("done", None, numbers | {"residual": residual, "steps": outcome.facts["steps"]})


def _following(job: _Job, modes: Spectrum, ending: Ending) -> tuple[_Job, Trial | None]:
    """As in a single run: the job, knowing this run, and what to choose a shorter step from if it was too long."""
    blow_up = ending.failure if isinstance(ending.failure, BlowUp) else None
    if ending.failure and not blow_up:
        return job, None
    columns, stubborn = (None, blow_up.stubborn) if blow_up else (ending.columns, False)
    job = replace(job, trial=job.trial.with_run(job.setup, job.step, columns))
    return job, next_trial(job.trial, job.setup, job.step, modes, ending.peak_point_force, columns, stubborn)


def _step(setup: Setup, trial: Trial, modes: Spectrum) -> TimeStep:
    step = choose(trial.time, setup.physics, modes, trial.point_force)
    if trial.time.dt != "auto" or setup.physics.reset_interval:
        return step
    rung = math.floor(RUNGS * math.log2(step.dt))
    return TimeStep(step.integrator, step.limit, 2.0 ** (rung / RUNGS))


def _groups(jobs: list[_Job], lanes: int) -> Iterator[list[_Job]]:
    """Jobs that can be lanes of one world, up to `lanes` of about equal duration together."""
    kinds: dict[Any, list[_Job]] = defaultdict(list)
    for job in jobs:
        physics = job.setup.physics
        shared_eta = physics.eta if job.step.integrator == "trapezoidal" else physics.dissipates
        kinds[job.step.integrator, job.step.dt, shared_eta, job.setup.row_interval].append(job)
    for kind in kinds.values():
        kind.sort(key=lambda job: -job.setup.max_time)
        for first in range(0, len(kind), lanes):
            yield kind[first : first + lanes]


def _described(job: _Job, step: TimeStep, ending: Ending, moduli: Moduli) -> PointResult:
    setup = job.setup
    numbers: dict[str, Any] = {}
    failure = str(ending.failure) if ending.failure else None
    if failure is None and setup.scene.time.dt == "auto":
        failure = unclosed(setup, ending.columns) or job.trial.out_of_tolerance(setup, ending.columns)
    if failure is None:
        lost = imbalance(ending.columns)[-1] / setup.energy_scale(ending.columns)
        numbers = {**setup.headline(ending.columns).values, "energy_imbalance": float(lost)}
        if (error := job.trial.error(setup, ending.columns)) is not None:
            numbers["error_estimate"] = error
    numbers |= {"young": moduli.young, "poisson": moduli.poisson}
    numbers |= {"steps": ending.steps, "dt": step.dt, "integrator": step.integrator}
    return PointResult("failed" if failure else "done", failure, numbers)
