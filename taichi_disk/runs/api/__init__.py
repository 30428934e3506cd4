"""taichi_disk from Python: run a scene, examine, film and save its result."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from inspect import signature
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from taichi_disk.base import files, runtime
from taichi_disk.base.errors import (
    NOTICES,
    InputError,
    SimulationError,
    check_flags,
    did_you_mean,
    nearest,
    whole_number,
)
from taichi_disk.base.progress import Progress, reported, silent
from taichi_disk.base.signals import raise_if_interrupted
from taichi_disk.experiments.computation.driver import State as State
from taichi_disk.experiments.computation.outcome import Outcome
from taichi_disk.experiments.config.tree import Source, as_path
from taichi_disk.experiments.scenes import Scene, load_scene
from taichi_disk.experiments.scenes.scene import DiskScene
from taichi_disk.mechanics.lattice import Array, Lattice, disk_of
from taichi_disk.mechanics.statics.modes import Modes, modes
from taichi_disk.pictures.render.artist import drawing_process
from taichi_disk.pictures.render.moments import Span, time_of
from taichi_disk.runs.api.film import film
from taichi_disk.runs.api.lattices import MOST_LATTICES
from taichi_disk.runs.api.work import FRAMES, MOST_FRAMES, Work
from taichi_disk.runs.output.report import headline, rows, shown
from taichi_disk.runs.output.run_folder import run_folder

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from taichi_disk.mechanics.fields import Field
    from taichi_disk.pictures.inline import Film, Plot

__all__ = ["Modes", "Result", "State", "run"]
Moments: TypeAlias = "Sequence[float | str] | Array"
MAX_NAMED_TIMES = 5  # number of times in a notice


@dataclass(frozen=True, eq=False)
class Result(Outcome):
    """A finished run. It can be pickled and sent to another process.

    Attributes, besides `lattice`, `scene` and the results:
        series: read-only arrays (rows,), one for each column of timeseries.csv.
        positions, velocities: of all points at the end, (n, 2) [R] and [c].
        summary: the content of summary.json.
        scenario: the scene's laws and start.
        out: folder of the run, or None.
    """

    out: Path | None = None

    def __repr__(self) -> str:
        number = headline(self.summary, self.scenario.words.labels)
        if not number:
            name, value = self.scenario.primary(self.series)
            parts = shown(value, self.error, exact=self.scenario.static)
            number = " ".join((name, *parts)).strip()
        if self.warnings:
            number += ", see .warnings"
        return (
            f"Result({self.scene.scene}, {self.lattice.disk_points} points, {number})"
        )

    def _repr_html_(self) -> str:
        from taichi_disk.pictures.inline import card

        return card(
            "    ".join(self.scenario.words.title).replace("    ", " · "),
            rows(self.summary, self.scenario.words.labels),
            self.plot(),
            self.warnings,
        )

    def _repr_png_(self) -> bytes:
        """Return a picture for documents without HTML, such as those by LaTeX."""
        return self.plot()._repr_png_()

    @property
    def scene(self) -> Scene:
        """The computed scene."""
        return self.scenario.scene

    # ---- numbers

    @property
    def numbers(self) -> dict[str, float]:
        """Results by name, the primary one first: restitution and contact_time [R/c],
        or xi [R] and xi_nominal."""
        return self.scenario.result(self.series)

    @property
    def restitution(self) -> float:
        """Restitution e = -v_cm(after)/v_cm(before). Raises AttributeError for a
        compression."""
        return self._number("restitution")

    @property
    def contact_time(self) -> float:
        """Contact time [R/c]. Raises AttributeError for a compression."""
        return self._number("contact_time")

    @property
    def xi(self) -> float:
        """Compression [R]. Raises AttributeError for an impact."""
        return self._number("xi")

    def _number(self, name: str) -> float:
        if name not in self.numbers:
            raise AttributeError(
                f"scene {self.scene.scene} has no {name}; it has"
                f" {', '.join(self.numbers)}"
            )
        return self.numbers[name]

    @property
    def warnings(self) -> list[str]:
        """What is doubtful about the result; the logger `taichi_disk` has said it."""
        return list(self.summary["warnings"])

    @property
    def error(self) -> float | None:
        """Estimated error of the primary result due to the time step and to where the
        run ends; None if unknown."""
        return next(iter(self.summary["error_estimate"].values()), None)

    @property
    def mean(self) -> float | None:
        """Mean of the primary result over lattices; None if only this one was
        computed."""
        return self._over_lattices("mean")

    @property
    def standard_error(self) -> float | None:
        """Standard error of `mean`; None if only this lattice was computed."""
        return self._over_lattices("standard_error")

    @property
    def interval_95(self) -> list[float] | None:
        """Limits of the 95 % confidence interval of `mean`, by Student's t; None if
        only this lattice was computed."""
        return self._over_lattices("interval_95")

    @property
    def scatter(self) -> float | None:
        """Standard deviation of the primary result from lattice to lattice; None if
        only this one was computed."""
        return self._over_lattices("standard_deviation")

    def _over_lattices(self, statistic: str) -> Any:
        name = next(iter(self.numbers))
        return self.summary.get("lattices", {}).get(name, {}).get(statistic)

    def dataframe(self) -> DataFrame:
        """Return the time series as a table of pandas. Raises TaichiDiskError if pandas
        is not installed."""
        from taichi_disk.pictures.inline import dataframe

        return dataframe(self.series, "series")

    # ---- states

    @property
    def lattice(self) -> Lattice:
        """Points and springs at t = 0, in scene coordinates."""
        return self.scenario.lattice

    @runtime.alone()
    def state(self, t: float | str) -> State:
        """Return the state at the step nearest to the moment `t`, as for `film`, or the
        equilibrium under the fraction `t` of a load.

        Raises InputError for a moment outside the run.
        """
        return next(self.replay(self._times(t)))

    @runtime.alone()
    def trajectory(self, times: Moments) -> tuple[Array, Array, Array]:
        """Return times (T,) [R/c], positions (T, n, 2) [R], velocities (T, n, 2) [c] at
        the steps nearest to the moments `times`, as for `film`.

        Raises InputError unless they ascend and lie within the run.
        """
        t, x, v = zip(*self.replay(self._times(times)), strict=True)
        return np.array(t), np.array(x), np.array(v)

    @property
    def greatest_compression(self) -> State:
        """State of the greatest compression, or the end of a loading; computed again at
        each access."""
        return self.state(self.contact.greatest)

    def field(self, name: str, t: float | str = "greatest", at: str = "own") -> Field:
        """Return the quantity `name` at the moment `t`, as for `film`; see
        `taichi_disk.mechanics.fields.field` for the names.

        at: "own" for values on the triangles, springs or points that the quantity
        belongs to; "points" for values (n,) at the points, as in pictures. Raises
        InputError for an unknown name or place, or a moment outside the run.
        """
        from taichi_disk.mechanics.fields import QUANTITIES, field

        if name not in QUANTITIES:
            raise InputError(f"no quantity {name!r}; there are {', '.join(QUANTITIES)}")
        if at not in ("own", "points"):
            raise InputError(
                'at: must be "own" (values on triangles or springs) or "points", not'
                f" {at!r}"
            )
        _, x, v = self.state(t)
        return field(name, self.lattice, self.scenario.model.springs, x, v, at)

    def modes(self, count: int = 40) -> Modes:
        """Return the lowest normal modes of the free disk and their energies at the end
        of the run.

        The energies, `rest` and `anharmonic` add up to the kinetic and elastic energy
        of the disk's vibration.
        Raises InputError unless `count` is from 1 to 2 N - 3.
        """
        n = self.lattice.disk_points
        return modes(
            disk_of(self.lattice),
            self.scenario.model.springs,
            self.positions[:n],
            self.velocities[:n],
            count,
        )

    @runtime.alone()
    def export(
        self,
        path: Path | str,
        format: str | None = None,
        frames: int = FRAMES,
        times: Moments | None = None,
    ) -> Path:
        """Write a trajectory for another program and return the path of the file.

        Args:
            path: file, whose suffix is the format (see docs/output.md), or folder for a
                file trajectory.SUFFIX.
            format: format in a folder: "xyz", "vtu" or "npz".
            frames: number of moments, evenly spaced in time.
            times: ascending moments to use instead, as for `film`.

        The states are those of the nearest steps, each of them once.

        Raises InputError for times outside the run, an unknown format, or one whose
        package is not installed.
        """
        from taichi_disk.runs.output.export import export_run

        if times is None:
            count = whole_number(frames, "frames", MOST_FRAMES)
            chosen = np.linspace(0.0, self.end, count)
        else:
            chosen = self._times(times)
        exported = []

        def recorded() -> Iterator[State]:
            for state in self.replay(chosen):
                exported.append(state.t)
                yield state

        out = as_path(path, "path")
        file = export_run(self.scenario, recorded(), out, format)
        if times is not None and not np.allclose(exported, chosen, rtol=1e-6):
            at = ", ".join(f"{t:.6g}" for t in exported[:MAX_NAMED_TIMES])
            if len(exported) > MAX_NAMED_TIMES:
                at += ", …"
            NOTICES.info("the states are those of the nearest steps, at t = %s R/c", at)
        return file

    def _times(self, moments: Any) -> Array:
        """Return the times (T,) [R/c] of one or several ascending moments."""
        # objects, because a list may have words beside numbers
        given = np.atleast_1d(np.asarray(moments, object))
        times = np.array([time_of(one, self) for one in given])
        if not len(times) or (np.diff(times) < 0.0).any():
            raise InputError("times: must be ascending")
        return times

    # ---- pictures

    def plot(self) -> Plot:
        """Return the curves of plot.png as a Matplotlib figure, which may be changed
        and saved."""
        from taichi_disk.pictures.inline import registered
        from taichi_disk.pictures.plot import plot_scene, run_figure

        quoted = headline(self.summary, self.scenario.words.labels)
        return registered(run_figure(plot_scene(self.scenario, self.series), quoted))

    @runtime.alone()
    def draw(
        self,
        t: float | str = "greatest",
        colour: str | None = None,
        ax: Axes | None = None,
    ) -> Figure:
        """Draw field, springs, wall and scale of a state on Matplotlib axes, as in
        films, and return the figure.

        Args:
            t: a moment as for `film`.
            colour: a quantity, by default the scene's `video.colour`.
            ax: axes to draw on; by default those of a new figure, which a notebook
                shows.

        Displacements are not magnified. Raises InputError for an unknown quantity or
        moment.
        """
        from taichi_disk.pictures.inline import registered
        from taichi_disk.pictures.render.state_figure import draw_state

        scene = self.scene
        if colour:
            scene = scene.with_({"video.colour": colour})
        figure = draw_state(self, scene.video, t, ax)
        if ax is None:
            registered(figure)
        return figure

    def show(
        self,
        compare: Result | Sequence[Result] | None = None,
        progress: Progress | None = None,
        **video: Any,
    ) -> Film:
        """Return the film for a notebook, which shows it with controls. Arguments and
        errors are those of `film`.

        `format="png"` gives one picture, `format="html"` an interactive film.
        """
        from taichi_disk.pictures.inline import Film

        kind = video.get("format", self.scene.video.format)
        with TemporaryDirectory() as folder:
            return Film(
                self.film(
                    Path(folder, f"film.{kind}"), compare, progress, **video
                ).read_bytes(),
                kind,
            )

    # ---- files

    @reported
    @runtime.alone()
    def film(
        self,
        path: Path | str,
        compare: Result | Sequence[Result] | None = None,
        progress: Progress | None = None,
        *,
        at: float | str = "greatest",
        start: float | str | None = None,
        end: float | str | None = None,
        labels: Sequence[str] = (),
        **video: Any,
    ) -> Path:
        """Film the run into `path` and return the path.

        Args:
            path: .mp4, .webm or .gif; .html for a page that plays the film; .png for
                one picture; a folder for numbered pictures.
            compare: up to three other runs, to be shown at the right.
            progress: called as for `run`.
            at: the moment of a picture: a time [R/c], "greatest" (compression),
                "contact" (the first) or "end".
            start: moment at which a film begins, like `at`; by default the start of the
                run.
            end: moment at which it ends; by default the end of the run.
            labels: titles of this run and the compared ones, in place of the keys that
                differ.
            video: keys of a scene's `video` section in place of the scene's own, as
                `colour="shear"`.

        Raises InputError for a wrong key or moment, TaichiDiskError if no film can be
        drawn or written.
        """
        from taichi_disk.pictures.render.film import check_target

        path = as_path(path, "path")
        compared = [compare] if isinstance(compare, Result) else compare or ()
        if not (
            isinstance(compared, (list, tuple))
            and all(isinstance(result, Result) for result in compared)
        ):
            raise InputError(
                "compare: must be a result of run, or a list of results, not"
                f" {compare!r:.60}"
            )
        section = self.scene.with_(
            {f"video.{key}": value for key, value in video.items()}
        ).video
        check_target(path)
        runs = [self, *compared]
        made = files.prepare_output(path.parent)
        try:
            with drawing_process(path.suffix != ".html") as artist:
                film(
                    path,
                    runs,
                    section,
                    progress or silent,
                    artist,
                    Span(at, start, end),
                    labels,
                )
        finally:
            files.remove_empty(made)  # they are empty if there is no film
        return path

    @runtime.alone()
    def save(
        self, out: Path | str, video: bool = False, overwrite: bool = False
    ) -> Path:
        """Write the files of a run into the folder `out` (see docs/output.md) and
        return its path.

        `video`: whether to make the film; `overwrite`: whether another run in `out` may
            be replaced.
        Raises InputError if `out` holds another run (unless `overwrite`) or files that
        no run wrote.
        """
        check_flags(video=video, overwrite=overwrite)
        out = as_path(out, "out")
        own = self.scenario.own
        text = self.scenario.stored_scene.to_yaml()
        work = Work(self.scene, own.disk, own.velocities)
        if work.digest != self.summary.get("lattice_digest", ""):
            raise InputError(
                "save: the file of the outline has changed since the run, and cannot be"
                " saved with it: run the scene again"
            )
        with run_folder(out, text, False, overwrite, work.digest) as folder:
            copy = replace(self, summary=dict(self.summary))
            work.write_start(folder.path, self.scenario)
            work.write(folder, copy)
            folder.appear()
            with drawing_process(video) as artist:
                work.draw(folder, copy, artist, video)
        if folder.failure:
            raise SimulationError(folder.failure)
        return folder.out

    @classmethod
    @reported
    @runtime.alone()
    def load(
        cls,
        folder: Path | str,
        overrides: str | Sequence[str] = (),
        progress: Progress | None = None,
        estimate: bool = True,
    ) -> Result:
        """Compute a finished run again from its scene.yaml and return the result,
        bitwise the same.

        Args:
            folder: folder of the run.
            overrides: changes of the scene, such as `["video.size=360"]`.
            progress: called as for `run`.
            estimate: whether to estimate the time-step error again, which doubles the
                work.

        Warns if the result is not the one in summary.json. Raises InputError if there
        is no run, or if a lattice of the user's in lattice.npz has been changed.
        """
        folder = as_path(folder, "folder")
        path = folder / "scene.yaml"
        summary = files.read_summary(folder)
        if not path.is_file() or "status" not in summary:
            name = "summary.json that can be read" if path.is_file() else "scene.yaml"
            raise InputError(
                f"{folder}: no run is here (no {name}): compute one with `taichi-disk"
                " run`"
            )
        scene = load_scene(path, overrides)
        work = Work(scene, progress=progress)
        if summary.get("lattice_digest", "") != work.digest:
            raise InputError(
                f"{folder}: the lattice or the velocities in lattice.npz have changed"
                " since the run, or another version of the program wrote them: run"
                f" {path} again"
            )
        # The step of the run is accepted, even if it is beyond the stability limit.
        outcome = work.solve(work.build(), lattices=1, force=True, estimate=estimate)
        name, value = outcome.scenario.primary(outcome.series)
        stored = summary.get(name, value)
        if stored != value:
            NOTICES.warning(
                f"{folder}: {name} is {value!r} now, and {stored!r} in summary.json:"
                " scene.yaml, summary.json or a version has been changed since the run"
            )
        elif "lattices" in summary:
            outcome.summary["lattices"] = summary["lattices"]
        return cls(**vars(outcome))


@reported
@runtime.alone()
def run(  # noqa: PLR0913 (keywords, one for each option of the command)
    scene: Scene | Source,
    out: Path | str | None = None,
    *,
    lattice: Lattice | None = None,
    velocities: Array | None = None,
    video: bool = True,
    export: str | None = None,
    overwrite: bool = False,
    count_on: bool = False,
    force: bool = False,
    threads: int | None = None,
    lattices: int | None = None,
    progress: Progress | None = None,
    computed: Callable[[Result], object] | None = None,
    started: float = 0.0,
    **changes: Any,
) -> Result:
    """Compute a scene, changed as by `with_`: `run("exponential_wall", velocity=0.03)`.

    Args:
        scene: result or argument of `load_scene`.
        out: folder for the files of the run; without it nothing is written.
        lattice: user-supplied unloaded disk, see `Lattice.from_points`.
        velocities: (N, 2) initial velocities of the disk's points [c], in the order of
            the lattice.
        video: whether to make the film, if there is a folder. Without Vulkan it is a
            page, video.html.
        export: format of a trajectory in the folder: "xyz", "vtu" or "npz".
        overwrite: whether another run in `out` may be replaced.
        count_on: whether to use out-2, out-3 … if `out` holds another run.
        force: whether to accept a time step beyond the stability limit.
        threads: number of threads, up to the number of cores; results do not depend on
            it. The first run of a process sets it; the default is the environment
            variable TAICHI_DISK_THREADS.
        lattices: number of random lattices, with this seed and the next ones, for the
            mean of the result and its scatter. By default 8 up to 5,000 points, 3 for a
            relaxation or with a tolerance, else 1.
        progress: called as progress(stage, done, total): "simulate" with the time [R/c]
            or the number of equilibria, "lattices" with the number of lattices,
            "render" with the number of pictures. It must not compute, film or examine a
            result.
        computed: called with the result when its numbers are in the folder, before
            curves, film and trajectory are.
        started: time that the process has taken before [s], for the wall clock of the
            summary.
        changes: keys of the scene and their values.

    Raises InputError, with nothing written, if the arguments are invalid;
    SimulationError if the computation fails. `out` then holds summary.json with the
    reason and, after a blow-up, failure.npz. If only files cannot be written, because
    the disk is full, the result is returned, and `summary["status"]` is "failed".
    """
    raise_if_interrupted()  # during imports
    if not isinstance(scene, DiskScene):
        scene = load_scene(scene)
    if changes:
        _check_arguments(scene, changes)
        scene = scene.with_(changes)
    check_flags(video=video, overwrite=overwrite, count_on=count_on, force=force)
    if lattices is not None:
        whole_number(lattices, "lattices", MOST_LATTICES)
    # reads the files of a lattice and velocities only once, because they may change
    work = Work(scene, lattice, velocities, progress, started)
    options: dict[str, Any] = {"lattices": lattices, "force": force}
    if out is None:
        if export:
            raise InputError("export: needs a folder, `out`")
        outcome = work.solve(work.build(threads), **options)
        return Result(**vars(outcome))
    if isinstance(out, str) and re.match(r"[\w.]+=", out):
        raise InputError(
            f"out: {out} looks like a change of the scene: write it as a key, as in"
            f" run(scene, velocity=0.1), or the folder as ./{out}"
        )
    out = as_path(out, "out")
    text = work.own.repeating(work.scene).to_yaml()
    with run_folder(out, text, count_on, overwrite, work.digest) as folder:
        if export:
            from taichi_disk.runs.output.export import check_export

            check_export(folder.path, export)
        with drawing_process(video) as artist:
            with work.failing_into(folder.path):
                scenario = work.build(threads)
                work.write_start(folder.path, scenario)
                outcome = work.solve(scenario, artist, **options)
                work.write(folder, outcome)
            folder.appear()
            # without room for anything there is no folder
            written = folder.out if folder.out.is_dir() else None
            result = Result(**vars(outcome), out=written)
            if computed is not None:
                computed(result)
            if outcome.summary["status"] == "done":
                work.draw(folder, outcome, artist, video, export)
    if folder.failure:
        outcome.summary.update(status="failed", reason=folder.failure)
    if outcome.summary["status"] != "done":
        NOTICES.error(outcome.summary["reason"])
    return result


def _check_arguments(scene: Scene, changes: dict[str, Any]) -> None:
    """Raise InputError if a name in `changes` is more like an argument of `run` than
    like a key of the scene."""
    arguments = {*signature(run).parameters}
    for name in changes:
        names = [*scene.sections(), *scene.key_names(), *arguments]
        if arguments & {*nearest(name, names)}:
            hint = did_you_mean(name, arguments)
            raise InputError(f"{name}: unknown argument of run{hint}")
