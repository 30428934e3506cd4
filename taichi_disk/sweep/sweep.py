"""Computing a sweep: what is missing is computed, what is there is kept, then the table, and what is drawn from it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from filelock import FileLock, Timeout

from taichi_disk.errors import InputError
from taichi_disk.lattice import file_digest
from taichi_disk.output.files import prepare_output, reason, remove, versions, write_csv, write_summary, write_text
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

FILES = ("scene.yaml", "points.csv", "summary.json", "figure.png", "figure.svg", "figure.pdf")
MOST_FAILURES = 10  # that are printed
MEASURED = ("young", "poisson", "error_estimate", "energy_imbalance", "residual", "steps", "dt", "integrator")

Row = dict[str, Any]
Say = Callable[[str], None]


@dataclass(frozen=True)
class SweepResult:
    """A finished sweep, or a finished part of one.

    Attributes:
        rows: what points.csv holds: axes, results, how they were computed, status, key.
        summary: what summary.json holds; of a part, the counts alone.
        out: the folder.
        sweep: what was computed.
    """

    rows: list[Row]
    summary: dict[str, Any]
    out: Path
    sweep: Sweep

    def __repr__(self) -> str:
        return f"SweepResult({self.summary['scene']}, {_counted(self)}, out={str(self.out)!r})"

    def _repr_html_(self) -> str:
        from taichi_disk.figures.curves import curve_rows
        from taichi_disk.output.inline import card

        figure = self.plot() if self.summary.get("curves") else None
        curves = curve_rows(self.summary.get("curves", ()))
        rows = ((label if not k else "", *line) for label, fits in curves for k, line in enumerate(fits))
        return card(f"{self.summary['scene']}: {_counted(self)}", rows, figure)

    def plot(self, x: str | None = None, y: str | None = None) -> Plot:
        """Return a figure of Matplotlib, which may be changed and saved.

        Args:
            x: an axis of the sweep, by default the first one that is not the seed.
            y: a result, or another column of numbers, by default the primary result. Points are means over lattices,
                bars their standard deviation. Without `x` and `y` it is the figure of a sweep over speed or pressure,
                with its fits.

        Raises InputError if there is no such figure, axis or column.
        """
        from taichi_disk.figures.curves import analyse, curves_figure

        first, axes = self.sweep.scenes[0], self.sweep.axes
        if x or y:
            from taichi_disk.figures.results import result_figure

            free = [name for name in axes if target_of(first, name) != ("lattice", "seed")]
            return result_figure(first, axes, self.rows, x or (free or axes)[0], y or first.results[0])
        if not (curves := analyse(first, axes, self.rows)):
            raise InputError(f"there is no figure of {first.scene} over {', '.join(axes)}; name an axis: plot(x=...)")
        return curves_figure(first, curves)

    def dataframe(self) -> DataFrame:
        """Return the rows as a table of pandas. Raises TaichiDiskError if pandas is not installed."""
        from taichi_disk.output.inline import dataframe

        return dataframe(self.rows, "rows")

    @property
    def failed(self) -> list[Row]:
        """The rows without a result; each has a `reason`."""
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
    """Compute the points of `sweep` that `out` lacks, and write points.csv, summary.json and the figure.

    May be killed at any time and started again. Results do not depend on who computes them: each row is what `run`
    gives for points/KEY.yaml. With several processes, a script needs `if __name__ == "__main__":`.

    Args:
        sweep: as `load_sweep` gives it.
        out: the folder.
        jobs: processes, by default one per core; 1 computes in this process.
        executor: instead of them, any `concurrent.futures.Executor`, whose workers have the same packages installed.
        scheduler: instead of both, the address of a Dask scheduler, tcp://HOST:8786.
        part: "K/N": compute the K-th of N parts only, and write no table. Parts may run at the same time, in one
            folder or in several whose `points` are then copied together.
        estimate: whether to estimate each result's error due to the time step, which doubles the work.
        progress: called as progress("sweep", done, total), with numbers of scenes.
        say: called with what a person should know: how many scenes, which of them are there.

    Raises:
        InputError: `out` cannot be written or holds something else; a point's file was changed; no scheduler answers,
            or its workers have other versions.
        SimulationError: the workers failed. What was done is kept.
    """
    out, progress, began = Path(out), progress or silent, perf_counter()
    keys = [point_key(scene) for scene in sweep.scenes]
    scenes = executors.ordered(dict(zip(keys, sweep.scenes, strict=True)))
    scenes = scenes if part is None else executors.part_of(part, scenes)
    _prepare(out)
    with _claimed(out / "points", sweep):
        if part is None:
            file, text = out / "scene.yaml", sweep.to_yaml()
            if file.exists() and file.read_text(encoding="utf-8", errors="replace") != text:
                say(f"{out} held another sweep: its points stay, its table is replaced")
                for name in FILES:
                    remove(out / name)
            write_text(file, text)
        found = {key: kept for key in scenes if (kept := _read_point(out, key)) and (kept.estimated or not estimate)}
        for key in found:
            _write_scene(out, key, scenes[key])
        missing, before = {key: scene for key, scene in scenes.items() if key not in found}, len(found)
        of_all = f" (part {part} of {len(keys)})" if part else ""
        say(f"{len(scenes)} scenes{of_all}, {before} of them computed before")
        progress("sweep", before, len(scenes))
        with closing(executors.computed(missing, estimate, jobs, executor, scheduler, say)) as results:
            for key, result in results:
                _write_point(out, key, missing[key], result)
                found[key] = result
                progress("sweep", len(found), len(scenes))
        if mixed := _mixed([one.versions for one in found.values() if one.versions]):
            say(f"these rows come from different versions, {mixed}: delete {out / 'points'} to compute all anew")
        base, known = sweep.scenes[0], {name for one in found.values() for name in one.numbers}
        names = (*base.results, *(name for name in base.optional_results if name in known), *MEASURED)
        rows = [_row(sweep, scenes[key], names, key, found[key]) for key in keys if key in scenes]
        failed, told = [row for row in rows if row["status"] != "done"], [*sweep.axes, "reason"]
        summary = {
            "scene": sweep.scenes[0].scene,
            "axes": sweep.axes,
            "points": len(rows),
            "computed_now": len(found) - before,
            "failed": [{name: row[name] for name in told} for row in failed],
        }
        if part:
            return SweepResult(rows, summary | {"part": part, "wall_clock": perf_counter() - began}, out, sweep)
        yaml = {True: "true", False: "false"}
        table = [{k: yaml[v] if isinstance(v, bool) else v for k, v in row.items()} for row in rows]
        write_csv(out / "points.csv", table)

        from taichi_disk.figures.curves import figure_of

        summary |= {"curves": figure_of(sweep, rows, out), "wall_clock": perf_counter() - began, "versions": versions()}
        write_summary(out / "summary.json", summary)
        return SweepResult(rows, summary, out, sweep)


@contextmanager
def _claimed(folder: Path, sweep: Sweep) -> Iterator[None]:
    """Within, `folder` takes points of this sweep only, also from other processes: its parts may run at the same time.

    Each holds the lock of a hidden file of its own, which names the sweep; the system frees that of a killed process.
    Raises InputError where another sweep holds one.
    """
    name = hashlib.sha256(sweep.to_yaml().encode()).hexdigest()[:20]
    mine = FileLock(folder / f".{name}.{uuid4().hex}.lock")
    with FileLock(folder / ".lock"):
        for other in folder.glob(".*.lock"):
            try:
                with FileLock(other, timeout=0):
                    pass
                remove(other)
            except Timeout:
                if not other.name.startswith(f".{name}."):
                    text = f"{folder.parent}: another sweep is being computed into this folder"
                    raise InputError(f"{text}; let it end, or choose another folder") from None
        mine.acquire()
    try:
        yield
    finally:
        mine.release()
        remove(Path(mine.lock_file))


def _mixed(found: list[dict[str, str]]) -> str:
    """What differs between versions, in words; empty if nothing does."""
    known = {name: sorted({one.get(name, "?") for one in found}) for name in found[0]} if found else {}
    return ", ".join(f"{name} {' and '.join(ones)}" for name, ones in known.items() if len(ones) > 1)


def _prepare(out: Path) -> None:
    """Make the folder. Raises InputError where something else would be overwritten."""
    refuse_run(out)
    with suppress(OSError, ValueError):
        if not (out / "points").is_dir() and (taken := [name for name in FILES if (out / name).exists()]):
            raise InputError(f"{out} holds {taken[0]}, which no sweep wrote; choose another folder as `out`")
        (out / "points").mkdir(parents=True, exist_ok=True)  # parts may begin at the same time
    prepare_output(out / "points")


def _row(sweep: Sweep, scene: Scene, names: Sequence[str], key: str, result: PointResult) -> Row:
    row: Row = {name: value_of(scene, name) for name in sweep.axes}
    numbers = {name: result.numbers.get(name) for name in names}
    row |= {f"{name}_taken" if name in row else name: value for name, value in numbers.items()}
    return row | {"status": result.status, "reason": result.reason, "warnings": "; ".join(result.warnings), "key": key}


def _counted(result: SweepResult) -> str:
    summary = result.summary
    return f"{summary['points']} points, {summary['computed_now']} of them computed now, {len(result.failed)} failed"


def print_sweep(result: SweepResult) -> None:
    """Print the fits, what failed, and where the files are."""
    from taichi_disk.figures.curves import print_curves

    summary, failed = result.summary, result.failed
    part = f"part {summary['part']}: " if "part" in summary else ""
    print_curves(summary.get("curves", ()))
    for row in failed[:MOST_FAILURES]:
        print(f"failed at {', '.join(f'{name}: {row[name]}' for name in summary['axes'])}: {row['reason']}")
    if len(failed) > MOST_FAILURES:
        print(f"... and {len(failed) - MOST_FAILURES} more" + ("" if part else ", see points.csv"))
    if warned := sum(bool(row["warnings"]) for row in result.rows):
        print(f"{warned} points with warnings, see points.csv")
    print(f"{part}{_counted(result)}; {summary['wall_clock']:.1f} s")
    print(f"files in {result.out}")
    if part:
        print("the same command without --part, once all parts are there, writes table, fits and figure")


# ---- the folder `points`: KEY.yaml, a point's resolved scene, and KEY.json, its result


def point_key(scene: Scene) -> str:
    """Name of a point: a hash of the version and of its resolved scene, the film's settings apart.

    The points of a lattice of one's own are part of it. Raises InputError if their file cannot be read.
    """
    sections = asdict(scene)
    del sections["video"]
    known = [__version__, sections, file_digest(scene.lattice.file), file_digest(scene.lattice.velocities)]
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()[:20]


def _read_point(out: Path, key: str) -> PointResult | None:
    """The result of a point, if it is there. Raises InputError for a file that holds none."""
    path = out / "points" / f"{key}.json"
    try:
        record = json.loads(path.read_bytes())
        result = PointResult(**{one.name: record[one.name] for one in fields(PointResult)})
        return result if record["key"] == key else None
    except FileNotFoundError:
        return None
    except (ValueError, TypeError, LookupError, RecursionError, OSError) as error:
        text = f"{path}: not the result of a point ({reason(error)}); delete the file to compute it anew"
        raise InputError(text) from None


def _write_point(out: Path, key: str, scene: Scene, result: PointResult) -> None:
    """Write a point, and its result if there is one. Raises SimulationError if it cannot be written."""
    _write_scene(out, key, scene)
    if result.status == "done":  # what failed is tried again
        record = json.dumps(asdict(result) | {"key": key}, indent=1, allow_nan=False)
        write_text(out / "points" / f"{key}.json", record + "\n")


def _write_scene(out: Path, key: str, scene: Scene) -> None:
    """KEY.yaml, unless it is there."""
    path, text = out / "points" / f"{key}.yaml", scene.to_yaml().encode()
    if not (path.is_file() and path.read_bytes() == text):
        write_text(path, text.decode())
