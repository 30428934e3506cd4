"""A computation from a scene to its numbers and files, with a clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk import runtime
from taichi_disk.errors import SimulationError, TaichiDiskError
from taichi_disk.lattice import Array, Lattice, disk_of, file_digest, numbers
from taichi_disk.output import files
from taichi_disk.output.plot import plot_beside, plot_run
from taichi_disk.progress import Progress
from taichi_disk.scenes import Scene, check_memory
from taichi_disk.signals import heard
from taichi_disk.simulation.diagnostics import BlowUp
from taichi_disk.simulation.outcome import Outcome, compute
from taichi_disk.simulation.scenario import Scenario
from taichi_disk.simulation.simulation import KernelCache

FRAMES = 200  # of a trajectory, unless asked otherwise


@dataclass(frozen=True)
class Computed:
    """A scene computed to its end.

    Attributes:
        scene: what was computed.
        scenario: the same with its lattice, laws and start.
        summary: what summary.json holds.
        outcome: the time series, the states, how they were computed.
    """

    scene: Scene
    scenario: Scenario
    summary: dict[str, Any]
    outcome: Outcome = field(repr=False)


class Clock:
    """Wall-clock seconds by stage: one begins where the other ended."""

    def __init__(self, started: float = 0.0) -> None:
        self.seconds: dict[str, float] = {"start": started} if started else {}
        self._since = perf_counter()

    def lap(self, stage: str, **within: float) -> None:
        """Book the seconds since the last lap on `stage`, but for those that went `within` it into others."""
        now = perf_counter()
        for name, seconds in (within | {stage: now - self._since - sum(within.values())}).items():
            self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        self._since = now


@dataclass
class Job:
    """One computation, with a clock."""

    scene: Scene
    lattice: Lattice | None
    velocities: Array | None
    force: bool
    threads: int | None
    progress: Progress
    clock: Clock
    estimate: bool = True
    digest: str = field(init=False)  # of the file that the lattice is taken from, before that is read

    def __post_init__(self) -> None:
        self.digest = file_digest(self.scene.lattice.file) if self.lattice is None else ""

    def scenario(self) -> Scenario:
        """Lattice, laws and start; Taichi runs afterwards. Raises InputError for what cannot be computed."""
        check_memory(self.scene)
        runtime.start(self.threads)
        scenario = self.scene.scenario(None if self.lattice is None else disk_of(self.lattice))
        if self.velocities is not None:
            scenario.start_with(numbers(self.velocities, "velocities"))
        self.clock.lap("build")
        return scenario

    def compute(self, scenario: Scenario) -> Computed:
        """To the scene's end; raises as `taichi_disk.simulation.outcome.compute`."""
        time, kernels = self.scene.time, shared_kernels()
        outcome = compute(scenario, time, self.progress, kernels, force=self.force, estimate=self.estimate)
        self.clock.lap("simulate", compile=outcome.compile_seconds)
        results = {**scenario.result(outcome.columns), "measured": scenario.notes, **outcome.facts, "video": None}
        return Computed(self.scene, scenario, self.summary("done") | results, outcome)

    def summary(self, status: str, reason: str | None = None) -> dict[str, Any]:
        """What summary.json says of any run."""
        told: dict[str, Any] = {"scene": self.scene.scene, "status": status, "reason": reason}
        told |= {"seed": self.scene.lattice.seed, "versions": files.versions(), "wall_clock": self.clock.seconds}
        if self.digest:
            told["lattice_digest"] = self.digest
        if self.lattice is not None or self.velocities is not None:
            told["own_start"] = "lattice or velocities were given in Python: lattice.npz holds them"
        return told

    def into(self, path: Path, video: bool, film: str | None, export: str | None) -> Computed:
        """Compute, and write everything into the folder `path`; `film` is one that is there already."""
        if export:
            from taichi_disk.output.export import check_export, export_run

            check_export(path, export)
        computed: Computed | None = None
        scenario: Scenario | None = None
        try:
            scenario = self.scenario()
            computed = self.compute(scenario)
            computed.summary["video"] = film
            if export:
                times = np.linspace(0.0, computed.outcome.columns["t"][-1], FRAMES)
                export_run(scenario, computed.outcome.replay(times), path, export)
                self.clock.lap("export")
            write_run(path, computed, video, self.progress, self.clock)
            return computed
        except (SimulationError, KeyboardInterrupt) as failure:
            status = "failed"
            if isinstance(failure, KeyboardInterrupt):
                heard()
                status = "interrupted"
            self.clock.lap(status)
            told = self.summary(status, str(failure) or None)
            if scenario is not None:
                _write_start(path, scenario)
            if isinstance(failure, BlowUp):
                files.write_arrays(path / "failure.npz", **failure.last_good)
            files.write_summary(path / "summary.json", (computed.summary if computed else {}) | told)
            raise


@lru_cache(maxsize=1)
def _kernels_of(program: Any) -> KernelCache:
    return KernelCache()


def shared_kernels() -> KernelCache:
    """The compiled simulations of this process: Taichi, too, exists once in a process."""
    import taichi as ti

    return _kernels_of(ti.lang.impl.get_runtime().prog)


def write_run(path: Path, run: Computed, video: bool, progress: Progress, clock: Clock) -> None:
    """All files of a run; summary.json last."""
    scene, scenario, outcome, columns = run.scene, run.scenario, run.outcome, run.outcome.columns
    asked = scene.time.sample_interval
    # Rows of an equilibrium are on the way to rest, not in time.
    interval = 0.0 if asked == "auto" or scenario.static else asked
    _write_start(path, scenario)
    files.write_timeseries(path / "timeseries.csv", columns, interval)
    end = {"positions": outcome.positions, "velocities": outcome.velocities, "t": columns["t"][-1]}
    files.write_arrays(path / "final.npz", **end)
    clock.lap("write")
    if video:
        name = "frames" if scene.video.format == "png" else f"video.{scene.video.format}"
        with plot_beside(path / "plot.png", scenario, columns):
            try:
                from taichi_disk.render.film import film

                film(path / name, [(scenario, outcome)], scene.video, progress)
                run.summary["video"] = name
            except TaichiDiskError as error:
                run.summary["video_error"] = str(error)
            clock.lap("film")
    else:
        plot_run(path / "plot.png", scenario, columns)
    clock.lap("plot")
    files.write_summary(path / "summary.json", run.summary)
    progress.stop()


def _write_start(path: Path, scenario: Scenario) -> None:
    impedance = getattr(scenario.model.boundary, "impedance", None)
    files.write_lattice(path / "lattice.npz", scenario.lattice, scenario.velocities, impedance)
