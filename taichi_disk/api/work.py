"""Compute a run and write its files."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk import runtime
from taichi_disk.api.lattices import compare_lattices, lattice_count
from taichi_disk.computation.diagnostics import BlowUp
from taichi_disk.computation.outcome import Outcome, compute
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import spectrum
from taichi_disk.errors import NoPictures, SimulationError
from taichi_disk.lattice import Lattice, own_start
from taichi_disk.output import files
from taichi_disk.output.artist import Artist, drawing_process
from taichi_disk.output.plot import begin_plot
from taichi_disk.output.report import headline
from taichi_disk.output.run_folder import RunFolder
from taichi_disk.progress import Progress, silent
from taichi_disk.scenes import Scene
from taichi_disk.scenes.setup import setup_of

# default and greatest number of frames of a trajectory
FRAMES, MOST_FRAMES = 200, 100_000


class Work:
    """The computation of one run and its files.

    `lattice`, `velocities`: as for `run`; `started`: time that the process has taken
        before [s]. Raises InputError for a lattice or velocities that cannot be used.

    Attributes:
        scene: the scene, whose throw is that of user-supplied velocities.
        own: user-supplied lattice and velocities.
        clock: wall-clock time of each stage [s].
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
        self.clock = {"start": started} if started else {}
        self.progress = progress or silent
        self.own = own_start(scene.lattice, lattice, velocities)
        self.scene = scene
        if self.own.velocities is not None:
            self.scene = scene.thrown_with(self._body(), self.own.velocities)

    def _body(self) -> Lattice:
        if self.own.disk is not None:
            return self.own.disk
        return setup_of(self.scene).body

    def lap(self, stage: str, **within: float) -> None:
        """Add the time since the last lap to `stage`, minus the times `within` it,
        which belong to other stages."""
        now = perf_counter()
        for name, seconds in (
            within | {stage: now - self._since - sum(within.values())}
        ).items():
            self.clock[name] = self.clock.get(name, 0.0) + seconds
        self._since = now

    def build(self, threads: int | None = None) -> Scenario:
        """Return the scenario of the scene. Raises InputError if it cannot be computed.
        `threads` as for `run`."""
        scene, own = self.scene, self.own
        runtime.start(threads)
        scenario = scene.scenario(self._body(), own.velocities)
        self.lap("build")
        # names the file of a user-supplied lattice
        return replace(scenario, scene=own.repeating(scenario.scene))

    def solve(
        self, scenario: Scenario, lattices: int | None = None, **options: Any
    ) -> Outcome:
        """Compute `scenario` and return the outcome with a complete summary. Options
        and errors as for `compute`."""
        scene, own = self.scene, self.own
        spectrum_of = spectrum if own.disk else setup_of(scene).spectrum
        outcome = compute(scenario, self.progress, spectrum_of=spectrum_of, **options)
        self.lap("simulate", compile=outcome.compile_seconds)
        summary = self._heading("done") | outcome.summary | {"video": None}
        lattice = scenario.lattice
        notes = [*lattice.notes, *scene.notes(lattice.disk_points)]
        count, note = lattice_count(own, outcome, lattices)
        if count > 1:
            summary["lattices"] = compare_lattices(
                scene, outcome, count, self.progress, options["force"]
            )
            self.lap("lattices")
        if notes := [*notes, *note]:
            summary["notes"] = notes
        return replace(outcome, summary=summary)

    def _heading(self, status: str, reason: str | None = None) -> dict[str, Any]:
        scene, own, spec = self.scene.scene, self.own, self.scene.lattice
        summary: dict[str, Any] = {
            "scene": scene,
            "status": status,
            "reason": reason,
            "seed": spec.seed,
        }
        summary |= {
            "versions": files.versions(),
            "wall_clock": self.clock,
            **files.provenance(),
        }
        if own.digest:
            summary["lattice_digest"] = own.digest
        if (own.disk and spec.file == "none") or (
            own.velocities is not None and spec.velocities == "none"
        ):
            summary["own_start"] = (
                "lattice or velocities were given in Python: lattice.npz holds them"
            )
        return summary

    def into(
        self,
        folder: RunFolder,
        video: bool,
        export: str | None,
        threads: int | None,
        **options: Any,
    ) -> Outcome:
        """Compute the scene and write its files, or the reason of a failure. Arguments
        and errors as for `run`."""
        if export:
            from taichi_disk.output.export import check_export, export_run

            check_export(folder.path, export)
        known: dict[str, Any] = {}
        try:
            with drawing_process(video) as artist:
                scenario = self.build(threads)
                self.write_start(folder.path, scenario)
                outcome = self.solve(scenario, **options)
                known = outcome.summary
                if export:
                    times = np.linspace(0.0, outcome.columns["t"][-1], FRAMES)
                    try:
                        moments = outcome.replay(times)
                        export_run(scenario, moments, folder.path, export)
                    except Exception as error:
                        known["export_error"] = str(error) or repr(error)
                    self.lap("export")
                try:
                    self.write(folder, outcome, video, artist)
                except SimulationError as error:  # the disk is full
                    # The computed numbers are returned and printed in any case.
                    known |= {"status": "failed", "reason": str(error)}
                    self._write_reason(folder.path, known)
            return outcome
        except (SimulationError, KeyboardInterrupt) as failure:
            status = (
                "interrupted" if isinstance(failure, KeyboardInterrupt) else "failed"
            )
            self.lap(status)
            known |= self._heading(status, str(failure) or None)
            self._write_reason(folder.path, known)
            if isinstance(failure, BlowUp):
                with suppress(SimulationError):  # the reason is the blow-up
                    files.write_arrays(folder.path / "failure.npz", **failure.last_good)
            raise

    def _write_reason(self, path: Path, summary: dict[str, Any]) -> None:
        """Write the summary of a run without its end, if there is room for it."""
        for unfinished in path.glob(".*.new.*"):  # of the process that draws the plot
            files.remove(unfinished)
        with suppress(SimulationError):
            files.write_summary(path / "summary.json", summary)

    def write_start(self, path: Path, scenario: Scenario) -> None:
        lattice, impedance = scenario.lattice, scenario.model.impedance
        files.write_lattice(
            path / "lattice.npz", lattice, scenario.velocities, impedance, self.own.disk
        )

    def write(
        self, folder: RunFolder, outcome: Outcome, video: bool, artist: Artist
    ) -> None:
        """Write the files of a run: results, then pictures, and summary.json first and
        last, which says why a picture is missing.

        `artist` draws curves.
        """
        path, summary, scenario = folder.path, outcome.summary, outcome.scenario
        # The first file holds the numbers, in case there is no room for the others.
        incomplete = {"status": "failed", "reason": "its files could not be written"}
        files.write_summary(path / "summary.json", summary | incomplete)
        asked = scenario.scene.time.sample_interval
        # Write all rows of a loading, because they are not equally spaced.
        interval = 0.0 if asked == "auto" or scenario.static else asked
        files.write_timeseries(path / "timeseries.csv", outcome.columns, interval)
        end = {
            "positions": outcome.positions,
            "velocities": outcome.velocities,
            "t": outcome.columns["t"][-1],
        }
        files.write_arrays(path / "final.npz", **end)
        self.lap("write")
        make_film = None
        if video:
            make_film = self._begin_film(path, outcome, artist)
        finish_plot = begin_plot(
            artist,
            path / "plot.png",
            scenario,
            outcome.columns,
            headline(summary, scenario.labels),
        )
        if make_film:
            self._film(make_film, path, outcome)
            self.lap("film")
        try:
            finish_plot()
        except Exception as error:
            summary["warnings"] = [
                *summary["warnings"],
                f"there is no plot.png: {error!s}",
            ]
        self.lap("plot")
        summary["video"] = folder.take_over()
        summary["digests"] = files.digests(path, summary)
        files.write_summary(path / "summary.json", summary)

    def _begin_film(
        self, path: Path, outcome: Outcome, artist: Artist
    ) -> Callable[[], None]:
        """Return a function that makes the film; a failure is its failure."""
        from taichi_disk.web.film import film

        section = outcome.scenario.scene.video
        name = "frames" if section.format == "png" else f"video.{section.format}"
        try:
            return film(path / name, [outcome], section, self.progress, artist=artist)
        except Exception as error:
            return partial(_fail, error)

    def _film(self, make: Callable[[], None], path: Path, outcome: Outcome) -> None:
        """Make the film, or a page that plays it where this machine cannot draw
        pictures."""
        from taichi_disk.web.film import film

        summary = outcome.summary
        section = outcome.scenario.scene.video
        try:
            try:
                make()
            except NoPictures as error:
                film(path / "video.html", [outcome], section, self.progress)()
                note = (
                    f"the film is video.html, a page for any browser, because {error}"
                )
                summary["notes"] = [*summary.get("notes", []), note]
        except Exception as error:
            summary["video_error"] = str(error) or repr(error)


def _fail(error: Exception) -> None:
    raise error
