"""Compute a run and write its files."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk import runtime
from taichi_disk.api.lattices import compare_lattices, lattice_count
from taichi_disk.computation.diagnostics import BlowUp
from taichi_disk.computation.outcome import Outcome, compute
from taichi_disk.computation.scenario import Scenario
from taichi_disk.errors import SimulationError
from taichi_disk.lattice import OwnStart
from taichi_disk.output import files
from taichi_disk.output.plot import Begin, plotting_beside
from taichi_disk.output.run_folder import RunFolder
from taichi_disk.progress import Progress, headline
from taichi_disk.scenes import Scene, check_memory
from taichi_disk.scenes.setup import setup_of
from taichi_disk.simulation.simulation import KernelCache

FRAMES = 200  # default number of frames of a trajectory


class Clock(dict[str, float]):
    """Wall-clock time of each stage [s]."""

    def __init__(self, **seconds: float) -> None:
        super().__init__(seconds)
        self._since = perf_counter()

    def lap(self, stage: str, **within: float) -> None:
        """Add the time since the last lap to `stage`, minus the times `within` it, which belong to other stages."""
        now = perf_counter()
        for name, seconds in (within | {stage: now - self._since - sum(within.values())}).items():
            self[name] = self.get(name, 0.0) + seconds
        self._since = now


def built(scene: Scene, own: OwnStart, clock: Clock, threads: int | None = None) -> Scenario:
    """Return the scenario of `scene`. Raises InputError if it cannot be computed. Arguments as for `run`."""
    check_memory(scene)
    runtime.start(threads)
    scenario = scene.scenario(setup_of(scene).body if own.disk is None else own.disk, own.velocities)
    scenario.scene = own.repeating(scenario.scene)  # names the file of a user-supplied lattice
    clock.lap("build")
    return scenario


def solved(
    scene: Scene,
    scenario: Scenario,
    own: OwnStart,
    clock: Clock,
    progress: Progress,
    lattices: int | None = None,
    **options: Any,
) -> Outcome:
    kernels = shared_kernels()
    known = None if own.disk or scenario.static else setup_of(scene).modes(scenario.model)
    outcome = compute(scenario, scene.time, progress, kernels, modes=known, **options)
    clock.lap("simulate", compile=outcome.compile_seconds)
    summary = _heading(scene, own, clock, "done") | outcome.summary | {"video": None}
    notes = scene.notes(scenario.lattice.disk_points) if scenario.step_dependent else []
    count, note = lattice_count(own, outcome, lattices)
    if count > 1:
        summary["lattices"] = compare_lattices(scene, outcome, count, kernels, progress, options["force"])
        clock.lap("lattices")
    if notes := [*notes, *note]:
        summary["notes"] = notes
    return replace(outcome, summary=summary)


def _heading(scene: Scene, own: OwnStart, clock: Clock, status: str, reason: str | None = None) -> dict[str, Any]:
    summary: dict[str, Any] = {"scene": scene.scene, "status": status, "reason": reason, "seed": scene.lattice.seed}
    summary |= {"versions": files.versions(), "wall_clock": clock, **files.provenance()}
    if own.digest:
        summary["lattice_digest"] = own.digest
    files_of = scene.lattice
    if (own.disk and files_of.file == "none") or (own.velocities is not None and files_of.velocities == "none"):
        summary["own_start"] = "lattice or velocities were given in Python: lattice.npz holds them"
    return summary


def compute_into(
    folder: RunFolder,
    scene: Scene,
    own: OwnStart,
    clock: Clock,
    progress: Progress,
    video: bool = True,
    export: str | None = None,
    threads: int | None = None,
    **options: Any,
) -> Outcome:
    """Compute a scene and write its files, or the reason of a failure. Arguments and errors as for `run`."""
    if export:
        from taichi_disk.output.export import check_export, export_run

        check_export(folder.path, export)
    known: dict[str, Any] = {}
    try:
        with plotting_beside(video) as plot:
            scenario = built(scene, own, clock, threads)
            write_start(folder.path, scenario, own)
            outcome = solved(scene, scenario, own, clock, progress, **options)
            known = outcome.summary
            if export:
                times = np.linspace(0.0, outcome.columns["t"][-1], FRAMES)
                export_run(scenario, outcome.replay(times), folder.path, export)
                clock.lap("export")
            write_run(folder, outcome, own, video, plot, progress, clock)
        return outcome
    except (SimulationError, KeyboardInterrupt) as failure:
        status = "interrupted" if isinstance(failure, KeyboardInterrupt) else "failed"
        clock.lap(status)
        if isinstance(failure, BlowUp):
            files.write_arrays(folder.path / "failure.npz", **failure.last_good)
        known |= _heading(scene, own, clock, status, str(failure) or None)
        files.write_summary(folder.path / "summary.json", known)
        raise


def write_run(
    folder: RunFolder, outcome: Outcome, own: OwnStart, video: bool, plot: Begin, progress: Progress, clock: Clock
) -> None:
    """Write the files of a run: results, then pictures, and summary.json last, which says why a picture is missing.

    `plot` is what `plotting_beside` yields.
    """
    path, summary, scenario = folder.path, outcome.summary, outcome.scenario
    section, asked = scenario.scene.video, scenario.scene.time.sample_interval
    # Write all rows of a loading, because they are not equally spaced.
    interval = 0.0 if asked == "auto" or scenario.static else asked
    files.write_timeseries(path / "timeseries.csv", outcome.columns, interval)
    end = {"positions": outcome.positions, "velocities": outcome.velocities, "t": outcome.columns["t"][-1]}
    files.write_arrays(path / "final.npz", **end)
    clock.lap("write")
    finish_plot = plot(path / "plot.png", scenario, outcome.columns, headline(summary, scenario.labels))
    if video:
        try:
            from taichi_disk.web.film import film

            name = "frames" if section.format == "png" else f"video.{section.format}"
            film(path / name, [outcome], section, progress)
        except Exception as error:
            summary["video_error"] = str(error) or repr(error)
        clock.lap("film")
    try:
        finish_plot()
    except Exception as error:
        summary["warnings"] = [*summary["warnings"], f"there is no plot.png: {error!s}"]
    clock.lap("plot")
    summary["video"] = folder.take_over()
    summary["digests"] = files.digests(path, summary)
    files.write_summary(path / "summary.json", summary)


def write_start(path: Path, scenario: Scenario, own: OwnStart) -> None:
    lattice, impedance = scenario.lattice, scenario.model.impedance
    files.write_lattice(path / "lattice.npz", lattice, scenario.velocities, impedance, own.disk)


@lru_cache(maxsize=1)
def _kernels_of(program: Any) -> KernelCache:
    return KernelCache()


def shared_kernels() -> KernelCache:
    from taichi_disk.engine import ti

    return _kernels_of(ti.lang.impl.get_runtime().prog)
