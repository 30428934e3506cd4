"""Sweeps: compute the points that are not finished, and write the table and its
figure."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, fields
from numbers import Integral
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from filelock import FileLock, Timeout

from taichi_disk.config.tree import as_path
from taichi_disk.errors import InputError
from taichi_disk.lattice import file_digest
from taichi_disk.output.files import (
    prepare_output,
    reason,
    remove,
    versions,
    write_csv,
    write_summary,
    write_text,
)
from taichi_disk.output.run_folder import refuse_run
from taichi_disk.progress import Progress, reported, silent
from taichi_disk.scenes import Scene
from taichi_disk.scenes.sweep_axes import Sweep, target_of, value_of
from taichi_disk.sweep import executors
from taichi_disk.sweep.work import PointResult
from taichi_disk.version import __version__

if TYPE_CHECKING:
    from pandas import DataFrame

    from taichi_disk.output.inline import Plot

FILES = (
    "scene.yaml",
    "points.csv",
    "summary.json",
    "figure.png",
    "figure.svg",
    "figure.pdf",
)
MAX_FAILURES = 10  # number of failed points that are printed
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

Row = dict[str, Any]
Say = Callable[[str], None]


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
    summary: dict[str, Any]
    out: Path
    sweep: Sweep

    def __repr__(self) -> str:
        return (
            f"SweepResult({self.summary['scene']}, {_counted(self)},"
            f" out={str(self.out)!r})"
        )

    def _repr_html_(self) -> str:
        from taichi_disk.figures.curves import curve_rows
        from taichi_disk.output.inline import card

        figure = self.plot() if self.summary.get("curves") else None
        curves = curve_rows(self.summary.get("curves", ()))
        rows = (
            (label if not k else "", *line)
            for label, fits in curves
            for k, line in enumerate(fits)
        )
        return card(f"{self.summary['scene']}: {_counted(self)}", rows, figure)

    def plot(self, x: str | None = None, y: str | None = None) -> Plot:
        """Return a figure of Matplotlib, which may be changed and saved.

        Args:
            x: an axis of the sweep, by default the first one that is not the seed.
            y: a result, or another column of numbers, by default the primary result.
                Points are means over lattices, bars their standard deviation. Without
                `x` and `y` it is the figure of a sweep over speed or pressure, with its
                fits.

        Raises InputError if there is no such figure, axis or column.
        """
        from taichi_disk.figures.curves import analyse, curves_figure

        first, axes = self.sweep.scenes[0], self.sweep.axes
        if x or y:
            from taichi_disk.figures.results import result_figure

            free = [
                name for name in axes if target_of(first, name) != ("lattice", "seed")
            ]
            return result_figure(
                first, axes, self.rows, x or (free or axes)[0], y or first.results[0]
            )
        if not (curves := analyse(first, axes, self.rows)):
            raise InputError(
                f"there is no figure of {first.scene} over {', '.join(axes)}; name an"
                " axis: plot(x=...)"
            )
        return curves_figure(first, curves)

    def dataframe(self) -> DataFrame:
        """Return the rows as a table of pandas. Raises TaichiDiskError if pandas is not
        installed."""
        from taichi_disk.output.inline import dataframe

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
    executor: Executor | None = None,
    scheduler: str | None = None,
    part: str | None = None,
    estimate: bool = False,
    progress: Progress | None = None,
    say: Say = lambda text: None,
) -> SweepResult:
    """Compute the points of `sweep` that are missing in `out`, and write points.csv,
    summary.json and the figure.

    An interrupted sweep can be continued. Each row equals the result of `run` for
    points/KEY.yaml, whoever computes it. With several processes, a script needs `if
    __name__ == "__main__":`.

    Args:
        sweep: result of `load_sweep`.
        out: output folder.
        jobs: number of processes, by default one per core; 1 computes in this process.
        executor: a `concurrent.futures.Executor` to use instead, with the same packages
            installed on its workers.
        scheduler: address of a Dask scheduler to use instead, tcp://HOST:8786.
        part: "K/N" computes the K-th of N parts and writes no table. Parts may run at
            the same time, in the same folder or in several folders whose `points` are
            merged afterwards.
        estimate: whether to estimate the time step's error of each result, which
            doubles the work.
        progress: called as progress("sweep", done, total) with numbers of scenes.
        say: receives notices for the user, such as the number of scenes.

    Raises:
        InputError: `out` cannot be written or holds something else; a file of a point
            was changed; no scheduler answers; or workers have other versions.
        SimulationError: the workers failed. Finished points are kept.
    """
    out, progress, started = as_path(out, "out"), progress or silent, perf_counter()
    if not isinstance(sweep, Sweep):
        raise InputError(f"sweep: must be what load_sweep returns, not {sweep!r:.60}")
    if jobs is not None and not (isinstance(jobs, Integral) and int(jobs) >= 1):
        raise InputError(f"jobs: must be a whole number from 1 on, not {jobs!r}")
    keys = [point_key(scene) for scene in sweep.scenes]
    scenes = executors.ordered(dict(zip(keys, sweep.scenes, strict=True)))
    scenes = scenes if part is None else executors.part_of(part, scenes)
    _check_folder(out)
    found = {key: _read_point(out, key) for key in scenes}
    results = {
        key: point
        for key, point in found.items()
        if point and (point.estimated or not estimate)
    }
    missing, before = (
        {key: scene for key, scene in scenes.items() if key not in results},
        len(results),
    )
    of_all = f" (part {part} of {len(keys)})" if part else ""
    say(f"{len(scenes)} scenes{of_all}, {before} of them computed before")
    generated = (scene for scene in scenes.values() if scene.lattice.file == "none")
    if note := next(
        (note for scene in generated for note in scene.notes(scene.lattice.points)),
        None,
    ):
        say(note)
    # ask first, because a client waits for ever for a silent server
    if missing and scheduler is not None:
        count = executors.count_workers(scheduler)
        say(
            f"{count} Dask workers"
            if count
            else f"waiting: the scheduler at {scheduler} has no workers yet"
        )
    prepare_output(out / "points")
    with _claimed(out / "points", sweep):
        if part is None:
            file, text = out / "scene.yaml", sweep.to_yaml()
            if (
                file.exists()
                and file.read_text(encoding="utf-8", errors="replace") != text
            ):
                say(
                    f"{out} held another sweep: its points are kept, its table is"
                    " replaced"
                )
                for name in FILES:
                    remove(out / name)
            write_text(file, text)
        for key in results:
            _write_scene(out, key, scenes[key])
        progress("sweep", before, len(scenes))
        with closing(
            executors.computed(missing, estimate, jobs, executor, scheduler)
        ) as computed:
            for key, result in computed:
                _write_point(out, key, missing[key], result)
                results[key] = result
                progress("sweep", len(results), len(scenes))
        if mixed := _mixed_versions(
            [result.versions for result in results.values() if result.versions]
        ):
            say(
                f"rows come from different versions, {mixed}: delete {out / 'points'}"
                " to compute all again"
            )
        base, known = (
            sweep.scenes[0],
            {name for result in results.values() for name in result.numbers},
        )
        names = (
            *base.results,
            *(name for name in base.optional_results if name in known),
            *DIAGNOSTICS,
        )
        rows = [
            _row(sweep, scenes[key], names, key, results[key])
            for key in keys
            if key in scenes
        ]
        failed = [row for row in rows if row["status"] != "done"]
        summary = {
            "scene": base.scene,
            "axes": sweep.axes,
            "points": len(rows),
            "computed_now": len(results) - before,
            "failed": [
                {name: row[name] for name in (*sweep.axes, "reason")} for row in failed
            ],
        }
        if part:
            return SweepResult(
                rows,
                summary | {"part": part, "wall_clock": perf_counter() - started},
                out,
                sweep,
            )
        yaml = {True: "true", False: "false"}
        table = [
            {k: yaml[v] if isinstance(v, bool) else v for k, v in row.items()}
            for row in rows
        ]
        write_csv(out / "points.csv", table)

        from taichi_disk.figures.curves import analyse, draw

        if curves := analyse(base, sweep.axes, rows):
            draw(base, curves, out)
        summary["curves"] = [curve.summary() for curve in curves]
        summary |= {"wall_clock": perf_counter() - started, "versions": versions()}
        write_summary(out / "summary.json", summary)
        return SweepResult(rows, summary, out, sweep)


@contextmanager
def _claimed(folder: Path, sweep: Sweep) -> Iterator[None]:
    """Let only this sweep, or parts of it in other processes, write points to `folder`
    while the block runs."""
    # Each process locks a hidden file whose name contains the hash of the sweep. The
    # system releases the lock of a killed process. Raises InputError if another sweep
    # holds a lock.
    name = hashlib.sha256(sweep.to_yaml().encode()).hexdigest()[:20]
    own_lock = FileLock(folder / f".{name}.{uuid4().hex}.lock")
    with FileLock(folder / ".lock"):
        for other in folder.glob(".*.lock"):
            try:
                with FileLock(other, timeout=0):
                    pass
                remove(other)
            except Timeout:
                if not other.name.startswith(f".{name}."):
                    text = f"{folder.parent}: another sweep is writing to this folder"
                    raise InputError(
                        f"{text}: wait until it ends, or choose another folder"
                    ) from None
        own_lock.acquire()
    try:
        yield
    finally:
        own_lock.release()
        remove(Path(own_lock.lock_file))


def _mixed_versions(points: list[dict[str, str]]) -> str:
    packages = (
        {name: sorted({point.get(name, "?") for point in points}) for name in points[0]}
        if points
        else {}
    )
    return ", ".join(
        f"{name} {' and '.join(used)}"
        for name, used in packages.items()
        if len(used) > 1
    )


def _check_folder(out: Path) -> None:
    refuse_run(out)
    if not (out / "points").is_dir() and (
        files := [name for name in FILES if (out / name).exists()]
    ):
        raise InputError(
            f"{out} holds {files[0]}, which is not from a sweep: choose another folder"
            " as `out`"
        )


def _row(
    sweep: Sweep, scene: Scene, names: Sequence[str], key: str, result: PointResult
) -> Row:
    row: Row = {name: value_of(scene, name) for name in sweep.axes}
    numbers = {name: result.numbers.get(name) for name in names}
    row |= {
        f"{name}_taken" if name in row else name: value
        for name, value in numbers.items()
    }
    return row | {
        "status": result.status,
        "reason": result.reason,
        "warnings": "; ".join(result.warnings),
        "key": key,
    }


def _counted(result: SweepResult) -> str:
    summary = result.summary
    return (
        f"{summary['points']} points, {summary['computed_now']} of them computed now,"
        f" {len(result.failed)} failed"
    )


def print_sweep(result: SweepResult) -> None:
    from taichi_disk.figures.curves import curve_rows

    summary, failed = result.summary, result.failed
    part = f"part {summary['part']}: " if "part" in summary else ""
    for label, fits in curve_rows(summary.get("curves", ())):
        print(label)
        for law, parameters in fits:
            print(f"  {law:<24}{parameters}")
    for row in failed[:MAX_FAILURES]:
        print(
            "failed at"
            f" {', '.join(f'{name}: {row[name]}' for name in summary['axes'])}:"
            f" {row['reason']}"
        )
    if len(failed) > MAX_FAILURES:
        print(
            f"... and {len(failed) - MAX_FAILURES} more"
            + ("" if part else ", see points.csv")
        )
    if count := sum(bool(row["warnings"]) for row in result.rows):
        print(f"{count} points with warnings, see points.csv")
    print(f"{part}{_counted(result)}; {summary['wall_clock']:.1f} s")
    print(f"files in {result.out}")
    if part:
        print(
            "when all parts are finished, repeat the command without --part to write"
            " table, fits and figure"
        )


# ---- the folder `points`: KEY.yaml, the resolved scene of a point, and KEY.json, its
# result


def point_key(scene: Scene) -> str:
    """Return the name of a point: a hash of the version, the resolved scene without
    `video`, and the scene's files.

    Raises InputError if such a file cannot be read.
    """
    sections = asdict(scene)
    del sections["video"]
    hashed = [
        __version__,
        sections,
        file_digest(scene.lattice.file),
        file_digest(scene.lattice.velocities),
    ]
    return hashlib.sha256(json.dumps(hashed, sort_keys=True).encode()).hexdigest()[:20]


def _read_point(out: Path, key: str) -> PointResult | None:
    path = out / "points" / f"{key}.json"
    try:
        record = json.loads(path.read_bytes())
        result = PointResult(
            **{item.name: record[item.name] for item in fields(PointResult)}
        )
        return result if record["key"] == key else None
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (ValueError, TypeError, LookupError, RecursionError, OSError) as error:
        text = (
            f"{path}: not the result of a point ({reason(error)}): delete the file to"
            " compute it again"
        )
        raise InputError(text) from None


def _write_point(out: Path, key: str, scene: Scene, result: PointResult) -> None:
    _write_scene(out, key, scene)
    if result.status == "done":  # failed points are tried again
        record = json.dumps(asdict(result) | {"key": key}, indent=1, allow_nan=False)
        write_text(out / "points" / f"{key}.json", record + "\n")


def _write_scene(out: Path, key: str, scene: Scene) -> None:
    path, text = out / "points" / f"{key}.yaml", scene.to_yaml().encode()
    if not (path.is_file() and path.read_bytes() == text):
        write_text(path, text.decode())
