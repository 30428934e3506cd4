"""Compute a run and write its files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.base import files, runtime
from taichi_disk.base.errors import (
    NOTICES,
    NoPictures,
    SimulationError,
    system_message,
)
from taichi_disk.base.files import Summary
from taichi_disk.base.processes.early import draw_early
from taichi_disk.base.progress import Progress, silent
from taichi_disk.experiments.computation.diagnostics import BlowUp
from taichi_disk.experiments.computation.outcome import Outcome, compute
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.scenes import Scene
from taichi_disk.experiments.scenes.setup import body_of, spectrum_of
from taichi_disk.mechanics.lattice import (
    Lattice,
    file_digest,
    outline_name,
    own_start,
)
from taichi_disk.mechanics.simulation.simulation import shared_kernels
from taichi_disk.pictures.plot import draw_plot, plot_run, plot_scene
from taichi_disk.pictures.render.artist import Artist
from taichi_disk.runs.api.film import film
from taichi_disk.runs.api.lattices import compare_lattices, lattice_count
from taichi_disk.runs.output.arrays import write_lattice, write_timeseries
from taichi_disk.runs.output.report import headline
from taichi_disk.runs.output.run_folder import RunFolder

FRAMES = 200  # default number of frames of a trajectory
MOST_FRAMES = 100_000
# keys of the summary that say why a file is missing, by stage
ERRORS = {"export": "export_error", "film": "video_error", "plot": "plot_error"}


class Work:
    """The computation of one run and its files.

    `lattice`, `velocities`: as for `run`; `started`: time that the process has taken
        before [s]. Raises InputError for a lattice or velocities that cannot be used.

    Attributes:
        scene: the scene, whose throw is that of user-supplied velocities.
        own: user-supplied lattice and velocities.
        digest: of what the user supplied besides the scene; "" if nothing.
        clock: wall-clock time of each stage [s].
        summary: content of summary.json; empty until the scene has been computed.
    """

    def __init__(
        self,
        scene: Scene,
        lattice: Lattice | None = None,
        velocities: Any = None,
        progress: Progress | None = None,
        started: float = 0.0,
    ) -> None:
        self._since = perf_counter()
        self.clock = {}
        if started:
            self.clock["start"] = started
        self.summary: Summary = {}
        self.progress = progress or silent
        self.own = own_start(scene.lattice, lattice, velocities)
        self.digest = self.own.digest + file_digest(scene.lattice, "outline")
        self.scene = scene
        if self.own.velocities is not None:
            self.scene = scene.thrown_with(self._body(), self.own.velocities)

    def _body(self) -> Lattice:
        if self.own.disk is not None:
            return self.own.disk
        return body_of(self.scene)

    def lap(self, stage: str, **within: float) -> None:
        """Add the time since the last lap to `stage`, minus the times `within` it,
        which belong to other stages."""
        now = perf_counter()
        seconds = now - self._since - sum(within.values())
        for name, time in {**within, stage: seconds}.items():
            self.clock[name] = self.clock.get(name, 0.0) + time
        self._since = now

    def build(self, threads: int | None = None) -> Scenario:
        """Return the scenario of the scene. Raises InputError if it cannot be computed.
        `threads` as for `run`."""
        runtime.start(threads)
        scenario = self.scene.scenario(self._body(), self.own)
        self.lap("build")
        return scenario

    def solve(
        self,
        scenario: Scenario,
        artist: Artist | None = None,
        lattices: int | None = None,
        **options: Any,
    ) -> Outcome:
        """Compute `scenario`, pass on notes and warnings, and return the outcome with a
        complete summary. `artist` draws its curves while other lattices are computed.
        Options and errors as for `compute`."""
        scene = self.scene
        if self.own.disk is None:
            options["spectrum_of"] = partial(spectrum_of, scene)
        kernels = shared_kernels()
        compiled_before = kernels.compile_seconds
        outcome = compute(scenario, self.progress, **options)
        compiling = kernels.compile_seconds - compiled_before
        self.lap("simulate", compile=compiling)
        if artist:
            shown = plot_scene(scenario, outcome.series)
            artist.begin(draw_early, draw_plot, shown)
        summary = self._heading("done") | outcome.summary | {"video": None}
        count, notes = lattice_count(outcome, lattices)
        if count > 1:
            summary["lattices"] = compare_lattices(
                outcome, count, self.progress, options["force"], self.digest
            )
            self.lap("lattices")
        lattice = scenario.lattice
        notes = [*lattice.notes, *scene.notes(lattice.disk_points), *notes]
        if notes:
            summary["notes"] = notes
        for text in notes:
            NOTICES.info(text)
        for text in summary["warnings"]:
            NOTICES.warning(text)
        self.summary = summary
        return replace(outcome, summary=summary)

    def _heading(self, status: str, reason: str | None = None) -> Summary:
        spec = self.scene.lattice
        summary: Summary = {
            "scene": self.scene.scene,
            "status": status,
            "reason": reason,
            "seed": spec.seed,
            "versions": files.versions(),
            "wall_clock": self.clock,
            **files.provenance(),
        }
        if self.digest:
            summary["lattice_digest"] = self.digest
        has_disk = self.own.disk is not None and spec.file == "none"
        has_velocities = self.own.velocities is not None and spec.velocities == "none"
        if has_disk or has_velocities:
            summary["own_start"] = (
                "lattice or velocities were given in Python: lattice.npz holds them"
            )
        return summary

    @contextmanager
    def failing_into(self, path: Path) -> Iterator[None]:
        """Write the reason into the folder `path` if the block fails. The failure
        passes on, unless only files of a computed scene cannot be written."""
        try:
            yield
        except (SimulationError, KeyboardInterrupt) as failure:
            status = "failed"
            if isinstance(failure, KeyboardInterrupt):
                status = "interrupted"
            self.lap(status)
            is_computed = bool(self.summary)
            self.summary |= self._heading(status, str(failure) or None)
            with suppress(SimulationError):  # there is no room for it
                files.write_summary(path / "summary.json", self.summary)
            if isinstance(failure, BlowUp):
                with suppress(SimulationError):  # the reason is the blow-up
                    files.write_arrays(path / "failure.npz", **failure.last_good)
            # The computed numbers are returned and printed in any case.
            if status == "interrupted" or not is_computed:
                raise

    def write_start(self, path: Path, scenario: Scenario) -> None:
        lattice = scenario.lattice
        spec = self.scene.lattice
        if spec.outline != "none":
            files.copy(Path(spec.outline), path / outline_name(spec))
        write_lattice(
            path / "lattice.npz",
            lattice,
            scenario.velocities,
            unloaded=self._body().positions[: lattice.disk_points],
            impedance=scenario.model.impedance,
        )

    def write(self, folder: RunFolder, outcome: Outcome) -> None:
        """Write the numbers of a run, and summary.json first and last."""
        path = folder.path
        summary = outcome.summary
        # The first file holds the numbers, in case there is no room for the others.
        incomplete = {"status": "failed", "reason": "its files could not be written"}
        files.write_summary(path / "summary.json", summary | incomplete)
        asked = outcome.scenario.scene.time.sample_interval
        # Write all rows of a loading, because they are not equally spaced.
        interval = 0.0 if asked == "auto" or outcome.scenario.static else asked
        write_timeseries(path / "timeseries.csv", outcome.series, interval)
        files.write_arrays(
            path / "final.npz",
            positions=outcome.positions,
            velocities=outcome.velocities,
            t=outcome.end,
        )
        folder.take_over()
        summary["video"] = folder.film()
        files.write_summary(path / "summary.json", summary)
        self.lap("write")

    def draw(
        self,
        folder: RunFolder,
        outcome: Outcome,
        artist: Artist,
        video: bool,
        export: str | None = None,
    ) -> None:
        """Add trajectory, film and curves, which `artist` draws, to the numbers of a
        run, and tell summary.json what is missing. If one fails, the others are still
        made."""
        path = folder.path
        summary = outcome.summary
        quoted = headline(summary, outcome.scenario.words.labels)
        shown = plot_scene(outcome.scenario, outcome.series)
        finish_plot = artist.begin(plot_run, path / "plot.png", shown, quoted)
        reporters: dict[str, Callable[[], Any]] = {}
        if export:
            reporters["export"] = partial(_export, path, outcome, export)
        if video:
            reporters["film"] = partial(_film, path, outcome, artist, self.progress)
        reporters["plot"] = finish_plot
        for stage, write in reporters.items():
            try:
                write()
            except Exception as error:
                text = system_message(error) or repr(error)
                summary[ERRORS[stage]] = text
                NOTICES.error(f"no {stage}: {text}")
            self.lap(stage)
        summary["video"] = folder.film()
        files.write_summary(path / "summary.json", summary)


def _export(path: Path, outcome: Outcome, format: str) -> None:
    from taichi_disk.runs.output.export import export_run

    times = np.linspace(0.0, outcome.end, FRAMES)
    export_run(outcome.scenario, outcome.replay(times), path, format)


def _film(path: Path, outcome: Outcome, artist: Artist, progress: Progress) -> None:
    """Make the film, or a page that plays it where this machine cannot draw
    pictures."""
    section = outcome.scenario.scene.video
    name = f"video.{section.format}"
    if section.format == "png":
        name = "frames"
    try:
        film(path / name, [outcome], section, progress, artist)
    except NoPictures as error:
        film(path / "video.html", [outcome], section, progress, artist)
        text = f"the film is video.html, a page for any browser, because {error}"
        NOTICES.info(text)
        notes = outcome.summary.get("notes", [])
        outcome.summary["notes"] = [*notes, text]
