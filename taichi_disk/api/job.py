"""A computation from a scene to its numbers and files, with a clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk import runtime
from taichi_disk.computation.diagnostics import BlowUp
from taichi_disk.computation.outcome import Outcome, compute
from taichi_disk.computation.scenario import Scenario
from taichi_disk.errors import SimulationError, TaichiDiskError
from taichi_disk.lattice import Array, Lattice, OwnStart, own_start
from taichi_disk.output import files
from taichi_disk.output.plot import Begin, plotting_beside
from taichi_disk.progress import Progress
from taichi_disk.scenes import Scene, check_memory
from taichi_disk.simulation.simulation import KernelCache

FRAMES = 200  # of a trajectory, unless asked otherwise
Computed = tuple[Scenario, dict[str, Any], Outcome]  # with what summary.json holds


@dataclass
class Clock:
    """Wall-clock seconds by stage: one begins where the other ended."""

    seconds: dict[str, float] = field(default_factory=dict)
    since: float = field(default_factory=perf_counter)

    def lap(self, stage: str, **within: float) -> None:
        """Book the seconds since the last lap on `stage`, but for those that went `within` it into others."""
        now = perf_counter()
        for name, seconds in (within | {stage: now - self.since - sum(within.values())}).items():
            self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        self.since = now


@dataclass
class Job:
    """One computation; the arguments as for `run`, `estimate` as for `Result.load`."""

    scene: Scene
    progress: Progress
    lattice: Lattice | None = None
    velocities: Array | None = None
    force: bool = False
    threads: int | None = None
    estimate: bool = True
    clock: Clock = field(default_factory=Clock)
    say: Callable[[str], None] = lambda text: None

    def __post_init__(self) -> None:
        # Read once, before a folder is chosen: files may change while the run is computed.
        self.own = own_start(self.scene.lattice, self.lattice, self.velocities)
        self.scenario: Scenario | None = None

    def compute(self) -> Computed:
        """To the scene's end.

        Raises InputError for what cannot be computed, and what `taichi_disk.computation.outcome.compute` raises.
        """
        check_memory(self.scene)
        runtime.start(self.threads)
        scenario = self.scene.scenario(*self.own)
        scenario.scene = self.own.repeating(scenario.scene)  # which files carry, wherever an own lattice came from
        self.clock.lap("build")
        self.scenario = scenario
        time, kernels = self.scene.time, shared_kernels()
        outcome = compute(
            scenario, time, self.progress, kernels, force=self.force, estimate=self.estimate, say=self.say
        )
        self.clock.lap("simulate", compile=outcome.compile_seconds)
        numbers = scenario.result(outcome.columns)
        measured = {name: note for name, note in scenario.notes.items() if name in numbers}
        results = {**numbers, "measured": measured, **outcome.facts, "video": None}
        if not self.own.digest and (scatter := self.scene.lattice_scatter()):
            results["lattice_scatter"] = scatter
        if scenario.step_dependent and (notes := self.scene.notes(scenario.lattice.disk_points)):
            results["notes"] = notes
        return scenario, self._summary("done") | results, outcome

    def _summary(self, status: str, reason: str | None = None) -> dict[str, Any]:
        """What summary.json says of any run."""
        summary: dict[str, Any] = {"scene": self.scene.scene, "status": status, "reason": reason}
        summary |= {"seed": self.scene.lattice.seed, "versions": files.versions(), "wall_clock": self.clock.seconds}
        summary |= files.provenance()
        if self.own.digest:
            summary["lattice_digest"] = self.own.digest
        if self.lattice is not None or self.velocities is not None:
            summary["own_start"] = "lattice or velocities were given in Python: lattice.npz holds them"
        return summary

    def into(self, path: Path, video: bool, film: str | None, export: str | None) -> Computed:
        """Compute, and write everything into the folder `path`; `film` is one that will be there already."""
        if export:
            from taichi_disk.output.export import check_export, export_run

            check_export(path, export)
        summary: dict[str, Any] = {}
        try:
            with plotting_beside(video) as plot:
                scenario, summary, outcome = computed = self.compute()
                summary["video"] = film
                if export:
                    times = np.linspace(0.0, outcome.columns["t"][-1], FRAMES)
                    export_run(scenario, outcome.replay(times), path, export)
                    self.clock.lap("export")
                write_run(path, computed, self.own, video, plot, self.progress, self.clock)
            return computed
        except (SimulationError, KeyboardInterrupt) as failure:
            status = "interrupted" if isinstance(failure, KeyboardInterrupt) else "failed"
            self.clock.lap(status)
            if self.scenario is not None:
                _write_start(path, self.scenario, self.own)
            if isinstance(failure, BlowUp):
                files.write_arrays(path / "failure.npz", **failure.last_good)
            files.write_summary(path / "summary.json", summary | self._summary(status, str(failure) or None))
            raise


@lru_cache(maxsize=1)
def _kernels_of(program: Any) -> KernelCache:
    return KernelCache()


def shared_kernels() -> KernelCache:
    """The compiled simulations of this process: Taichi, too, exists once in a process."""
    from taichi_disk.engine import ti

    return _kernels_of(ti.lang.impl.get_runtime().prog)


def write_run(
    path: Path, run: Computed, own: OwnStart, video: bool, plot: Begin, progress: Progress, clock: Clock
) -> None:
    """All files of a run; summary.json last. `plot` is what `plotting_beside` yields."""
    scenario, summary, outcome = run
    scene, columns, asked = scenario.scene, outcome.columns, scenario.scene.time.sample_interval
    # Rows of an equilibrium are on the way to rest, not in time.
    interval = 0.0 if asked == "auto" or scenario.static else asked
    _write_start(path, scenario, own)
    files.write_timeseries(path / "timeseries.csv", columns, interval)
    end = {"positions": outcome.positions, "velocities": outcome.velocities, "t": columns["t"][-1]}
    files.write_arrays(path / "final.npz", **end)
    clock.lap("write")
    plotted = plot(path / "plot.png", scenario, columns)
    if video:
        name = "frames" if scene.video.format == "png" else f"video.{scene.video.format}"
        try:
            from taichi_disk.web.film import film

            film(path / name, [(scenario, outcome)], scene.video, progress)
            summary["video"] = name
        except TaichiDiskError as error:
            summary["video_error"] = str(error)
        clock.lap("film")
    plotted()
    clock.lap("plot")
    summary["digests"] = files.digests(path, summary)
    files.write_summary(path / "summary.json", summary)


def _write_start(path: Path, scenario: Scenario, own: OwnStart) -> None:
    impedance = getattr(scenario.model.boundary, "impedance", None)
    files.write_lattice(path / "lattice.npz", scenario.lattice, scenario.velocities, impedance, own.disk)
