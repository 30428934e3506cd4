"""Sweeps: compute the points that are not finished, and write the table and its
figure."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from filelock import FileLock, Timeout

from taichi_disk.base.errors import (
    NOTICES,
    InputError,
    by_kind,
    check_flags,
    did_you_mean,
    reason,
    whole_number,
)
from taichi_disk.base.files import (
    Summary,
    prepare_output,
    remove,
    versions,
    write_csv,
    write_summary,
    write_text,
)
from taichi_disk.base.progress import Progress, reported, silent
from taichi_disk.experiments.config.tree import as_path
from taichi_disk.experiments.scenes import Scene
from taichi_disk.experiments.scenes.sweep_axes import Sweep
from taichi_disk.mechanics.lattice import file_digest
from taichi_disk.runs.output.run_folder import refuse_run
from taichi_disk.studies.sweep import executors
from taichi_disk.studies.sweep.work import PointResult, Row, relevant_versions

if TYPE_CHECKING:
    from pandas import DataFrame

    from taichi_disk.pictures.inline import Plot

FILES = (
    "scene.yaml",
    "points.csv",
    "summary.json",
    "figure.png",
    "figure.svg",
    "figure.pdf",
)
MAX_JOBS = 1000
MAX_FAILURES = 10  # number of failed points that are printed
LITERAL = (
    "lattices without a rim scatter irregularly: a law that holds is refuted in 2 to 5"
    " % of their sweeps, and the interval of d1 contains the true value in 89 to 92 %"
)
DIAGNOSTICS = (
    "young",
    "poisson",
    "error_estimate",
    "energy_imbalance",
    "residual",
    "steps",
    "dt",
    "integrator",
)


@dataclass(frozen=True)
class SweepResult:
    """A finished sweep or part of a sweep.

    Attributes:
        rows: rows of points.csv: axes, results, diagnostics, status, key.
        summary: contents of summary.json; for a part, only the counts.
        out: output folder.
        sweep: the computed sweep.
    """

    rows: list[Row]
    summary: Summary
    out: Path
    sweep: Sweep

    def __repr__(self) -> str:
        return (
            f"SweepResult({self.summary['scene']}, {_counted(self)},"
            f" out={str(self.out)!r})"
        )

    def _repr_html_(self) -> str:
        from taichi_disk.pictures.inline import card
        from taichi_disk.studies.figures.texts import curve_rows, explanations

        rows = []
        curves = self.summary.get("curves", ())
        for label, laws in curve_rows(curves):
            for law, parameters in laws:
                rows.append((label, law, parameters))
                label = ""  # stands only beside the first law
        rows += [("", law, meaning) for law, meaning in explanations(curves)]
        return card(
            f"{self.summary['scene']}: {_counted(self)}",
            rows,
            self._figure(),
            self.summary["warnings"],
        )

    def _repr_png_(self) -> bytes | None:
        """Return a picture for documents without HTML, such as those by LaTeX."""
        figure = self._figure()
        return figure._repr_png_() if figure else None

    def _figure(self) -> Plot | None:
        if len(self.failed) == len(self.rows):
            return None
        return self.plot()

    def plot(self, x: str | None = None, y: str | None = None) -> Plot:
        """Return a figure of Matplotlib, which may be changed and saved.

        Args:
            x: an axis of the sweep, by default speed or pressure, or else the first one
                that is not the seed.
            y: a result, or another column of numbers, by default the primary result.
                Points are means over lattices, bars their 95 % intervals. Laws are
                drawn for the primary result over speed or pressure.

        Raises InputError if there is no such axis or column.
        """
        from taichi_disk.pictures.inline import registered
        from taichi_disk.studies.figures.curves import analyse
        from taichi_disk.studies.figures.drawing import figure_to_change

        axes = self.sweep.axes
        if x is not None and x not in axes:
            raise InputError(f"x: {x} is not swept; there are {', '.join(axes)}")
        diagram = analyse(self.sweep.scenes[0], axes, self.rows, x, y)
        if not diagram.curves:
            columns = ", ".join(self.rows[0])
            raise InputError(f"y: no row has a number {diagram.y}; there are {columns}")
        return registered(figure_to_change(diagram))

    def dataframe(self) -> DataFrame:
        """Return the rows as a table of pandas. Raises TaichiDiskError if pandas is not
        installed."""
        from taichi_disk.pictures.inline import dataframe

        return dataframe(self.rows, "rows")

    @property
    def failed(self) -> list[Row]:
        """Rows without a result; each has a `reason`."""
        return [row for row in self.rows if row["status"] != "done"]


@reported
def run_sweep(
    sweep: Sweep,
    out: Path | str,
    *,
    jobs: int | None = None,
    executor: Any = None,
    part: str | None = None,
    estimate: bool = False,
    progress: Progress | None = None,
) -> SweepResult:
    """Compute the points of `sweep` that are missing in `out`, and write points.csv,
    summary.json and the figure.

    An interrupted sweep can be continued. Each row equals the result of `run` for
    points/KEY.yaml, whoever computes it.

    Args:
        sweep: result of `load_sweep`.
        out: output folder.
        jobs: number of processes, by default one per core; 1 computes in this process.
        executor: what computes instead: a `concurrent.futures.Executor`, a client of
            Dask, or the address of a Dask scheduler, tcp://HOST:8786. Its workers need
            the same packages.
        part: "K/N" computes the K-th of N parts and writes no table. Parts may run at
            the same time, in the same folder or in several folders whose `points` are
            merged afterwards.
        estimate: whether to estimate the time step's error of each result, which
            doubles the work.
        progress: called as progress("sweep", done, total) with numbers of scenes.

    Raises:
        InputError: `out` cannot be written or holds something else; a point cannot be
            read; a file of the lattice is changed meanwhile; no scheduler answers; or
            workers have other versions.
        SimulationError: the workers failed. Finished points are kept.
    """
    started = perf_counter()
    out = as_path(out, "out")
    progress = progress or silent
    if not isinstance(sweep, Sweep):
        raise InputError(f"sweep: must be what load_sweep returns, not {sweep!r:.60}")
    if jobs is not None:
        whole_number(jobs, "jobs", MAX_JOBS)
    keys = [point_key(scene) for scene in sweep.scenes]
    scenes = executors.ordered(dict(zip(keys, sweep.scenes, strict=True)))
    counted = f"{len(scenes)} scenes"
    if part is not None:
        scenes = executors.part_of(part, scenes)
        counted = f"{len(scenes)} scenes (part {part} of {len(keys)})"
    _check_folder(out)
    results = _stored(out, scenes, estimate)
    missing = {key: scenes[key] for key in scenes if key not in results}
    stored = len(results)
    NOTICES.info(f"{counted}, {stored} of them computed before")
    _say_note(scenes)
    with ExitStack() as stack:
        if missing:
            executor = executors.executor_for(executor, missing, jobs, stack)
        prepare_output(out / "points")
        if part is None:
            stack.enter_context(_only_writer(out))
            _begin_table(out, sweep)
        progress("sweep", stored, len(scenes))
        computed = executors.computed(missing, estimate, executor)
        with closing(computed):
            for key, result in computed:
                if point_key(missing[key]) != key:
                    raise InputError(
                        "a file of the lattice was changed during the sweep: run it"
                        " again"
                    )
                _write_point(out, key, missing[key], result)
                results[key] = result
                progress("sweep", len(results), len(scenes))
        results = {key: results[key] for key in keys if key in scenes}
        rows = _rows(sweep, scenes, results)
        summary = _summary(sweep, rows, computed_now=len(results) - stored)
        summary["warnings"] = _counted_warnings(results)
        if part is None:
            _write_table(out, sweep, rows, summary, started)
        else:
            summary |= {"part": part, "wall_clock": perf_counter() - started}
        for text in summary["warnings"]:
            NOTICES.warning(text)
        return SweepResult(rows, summary, out, sweep)


def _counted_warnings(results: dict[str, PointResult]) -> list[str]:
    texts: list[str] = []
    for result in results.values():
        texts += result.warnings
    return [
        f"{count} of {len(results)} points have a warning, the first: {text}"
        for text, count in by_kind(texts)
    ]


def _say_note(scenes: executors.Scenes) -> None:
    """Pass on the first note about a scene, such as how viscous its body is."""
    for scene in scenes.values():
        if scene.lattice.file == "none":
            for note in scene.notes(scene.lattice.points):
                NOTICES.info(note)
                return


def _check_folder(out: Path) -> None:
    """Raise InputError if `out` holds a run, or files of somebody else."""
    refuse_run(out)
    if (out / "points").is_dir():
        return
    for name in FILES:
        if (out / name).exists():
            raise InputError(
                f"{out} holds {name}, which is not from a sweep: choose another folder"
                " as `out`"
            )


def _begin_table(out: Path, sweep: Sweep) -> None:
    """Write scene.yaml, and remove the table and figure of another sweep."""
    file = out / "scene.yaml"
    text = sweep.to_yaml()
    if file.exists() and file.read_text(encoding="utf-8", errors="replace") != text:
        NOTICES.info(
            f"{out} held another sweep: its points are kept, its table is replaced"
        )
        for name in FILES:
            remove(out / name)
    write_text(file, text)


def _rows(
    sweep: Sweep, scenes: executors.Scenes, results: dict[str, PointResult]
) -> list[Row]:
    """Return the rows of points.csv, in the order of the results. A number that was
    used and has the name of an axis, such as `dt`, gets a column of its own,
    `dt_taken`."""
    known = set().union(*(result.numbers for result in results.values()))
    base = sweep.scenes[0]
    optional = [name for name in base.optional_results if name in known]
    rows = []
    for key, result in results.items():
        row = sweep.place_of(scenes[key])
        for name in (*base.results, *optional, *DIAGNOSTICS):
            column = name
            if name in sweep.axes:
                column = f"{name}_taken"
            row[column] = result.numbers.get(name)
        row["status"] = result.status
        row["reason"] = result.reason
        row["warnings"] = "; ".join(result.warnings)
        row["key"] = key
        rows.append(row)
    return rows


def _summary(sweep: Sweep, rows: list[Row], computed_now: int) -> Summary:
    failed = []
    for row in rows:
        if row["status"] != "done":
            failed.append({name: row[name] for name in (*sweep.axes, "reason")})
    return {
        "scene": sweep.scenes[0].scene,
        "axes": list(sweep.axes),
        "points": len(rows),
        "computed_now": computed_now,
        "failed": failed,
    }


def _write_table(
    out: Path, sweep: Sweep, rows: list[Row], summary: Summary, started: float
) -> None:
    """Write points.csv, the figure, and summary.json with the fits, which are added to
    `summary`. A failure of the figure becomes its `figure_error`."""
    from taichi_disk.studies.figures.curves import analyse
    from taichi_disk.studies.figures.drawing import draw

    write_csv(out / "points.csv", [_as_yaml(row) for row in rows])
    diagram = analyse(sweep.scenes[0], sweep.axes, rows)
    summary["curves"] = [curve.summary() for curve in diagram.curves]
    is_fitted = any(curve.fits for curve in diagram.curves)
    if is_fitted and not sweep.scenes[0].lattice.rim:
        summary["warnings"].append(LITERAL)
    if diagram.curves:
        try:
            draw(diagram, out)
        except Exception as error:
            summary["figure_error"] = f"no figure: {error}"
    summary["wall_clock"] = perf_counter() - started
    summary["versions"] = versions()
    write_summary(out / "summary.json", summary)


def _as_yaml(row: Row) -> Row:
    """Return the row with true and false as YAML writes them."""
    flags = {name: value for name, value in row.items() if isinstance(value, bool)}
    return row | {name: str(flag).lower() for name, flag in flags.items()}


@contextmanager
def _only_writer(out: Path) -> Iterator[None]:
    """Let no other sweep write a table into `out` while the block runs. Raises
    InputError if one does.

    Parts need no lock, because they write points only: each is written at once, under
    a hash of its scene.
    """
    # The system releases the lock of a killed process.
    lock = FileLock(out / "points" / ".lock", timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise InputError(
            f"{out}: another sweep is writing to this folder: wait until it ends, or"
            " choose another folder"
        ) from None
    except (OSError, NotImplementedError) as error:
        NOTICES.info(
            f"{out}: no lock is possible here ({reason(error)}): let no other sweep"
            " write to this folder at the same time"
        )
    try:
        yield
    finally:
        lock.release()


def _counted(result: SweepResult) -> str:
    summary = result.summary
    return (
        f"{summary['points']} points, {summary['computed_now']} of them computed now,"
        f" {len(result.failed)} failed"
    )


def print_sweep(result: SweepResult) -> None:
    from taichi_disk.studies.figures.texts import curve_rows, explanations

    summary = result.summary
    part = summary.get("part")
    curves = summary.get("curves", ())
    for label, laws in curve_rows(curves):
        print(label)
        for law, parameters in laws:
            print(f"  {law:<24}{parameters}")
    for law, meaning in explanations(curves):
        print(f"{law}: {meaning}")
    _print_failures(result)
    counted = f"{_counted(result)}; {summary['wall_clock']:.1f} s"
    if part is not None:
        counted = f"part {part}: {counted}"
    print(counted)
    print(f"files in {result.out}")
    if part is not None:
        print(
            "when all parts are finished, repeat the command without --part to write"
            " table, fits and figure"
        )


def _print_failures(result: SweepResult) -> None:
    failed = result.failed
    for row in failed[:MAX_FAILURES]:
        axes = ", ".join(f"{name}: {row[name]}" for name in result.summary["axes"])
        print(f"failed at {axes}: {row['reason']}")
    if len(failed) > MAX_FAILURES:
        more = f"... and {len(failed) - MAX_FAILURES} more"
        if "part" not in result.summary:
            more += ", see points.csv"
        print(more)


# ---- the folder `points`: KEY.yaml, the resolved scene of a point, and KEY.json, its
# result


def point_key(scene: Scene) -> str:
    """Return the name of a point: a hash of the versions that compute it, the resolved
    scene without `video`, and the scene's files.

    Raises InputError if such a file cannot be read.
    """
    sections = asdict(scene)
    del sections["video"]
    keys = ("file", "velocities", "outline")
    files = [file_digest(scene.lattice, key) for key in keys]
    contents = [relevant_versions(), sections, files]
    text = json.dumps(contents, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def _stored(
    out: Path, scenes: executors.Scenes, estimate: bool
) -> dict[str, PointResult]:
    """Return the results in the folder `points`, only those with an error estimate if
    `estimate`."""
    results = {}
    for key in scenes:
        path = out / "points" / f"{key}.json"
        if path.is_file() and path.with_suffix(".yaml").is_file():
            result = _read_point(path, scenes[key])
            if result.estimated or not estimate:
                results[key] = result
    return results


def _read_point(path: Path, scene: Scene) -> PointResult:
    try:
        result = PointResult(**json.loads(path.read_bytes()))
        _check_point(result, scene)
        return result
    except Exception as error:  # a damaged file may hold anything
        raise InputError(
            f"{path}: not the result of a point ({reason(error)}): delete the file to"
            " compute it again"
        ) from None


def _check_point(result: PointResult, scene: Scene) -> None:
    """Raise an error unless `result` is what `_write_point` writes for `scene`."""
    if result.status != "done":
        raise InputError(f"status: must be done, not {result.status!r}")
    known = {*scene.results, *scene.optional_results, *DIAGNOSTICS}
    for name in {*scene.results, *result.numbers}:
        value: Any = result.numbers.get(name)
        if name not in known:
            raise InputError(f"{name}: unknown{did_you_mean(name, known)}")
        is_number = type(value) in (int, float) and isfinite(value)
        is_free = name == "integrator" or (name == "error_estimate" and value is None)
        if not (is_number or is_free):
            raise InputError(f"{name}: must be a finite number, not {value!r:.60}")
    check_flags(estimated=result.estimated)


def _write_point(out: Path, key: str, scene: Scene, result: PointResult) -> None:
    write_text(out / "points" / f"{key}.yaml", scene.to_yaml())
    if result.status == "done":  # failed points are tried again
        write_summary(out / "points" / f"{key}.json", asdict(result))
