"""Computing a sweep: what is missing is computed, what is there is kept, then table, fits and figure."""

from __future__ import annotations

import csv
import os
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from taichi_disk import results
from taichi_disk.output import atomic_write, prepare_output
from taichi_disk.progress import Progress, QuietProgress
from taichi_disk.scene import Scene
from taichi_disk.study.pool import compute_all
from taichi_disk.study.store import PointStore, point_key
from taichi_disk.study.work import PointResult, lattice_key
from taichi_disk.sweep_axes import Sweep

HEADLINES = {
    "compression": ("xi", "xi_nominal", "xi_extrapolated"),
    "exponential_wall": ("restitution", "contact_time"),
    "absorbing_wall": ("restitution", "contact_time"),
}
ERRORS = ("error_estimate", "energy_imbalance", "residual")
HOW = ("steps", "dt", "integrator")

Row = dict[str, Any]


@dataclass(frozen=True)
class SweepResult:
    """A finished sweep: `rows` is what points.csv holds, `summary` what summary.json holds."""

    rows: list[Row]
    summary: dict[str, Any]
    out: Path

    @property
    def failed(self) -> list[Row]:
        return [row for row in self.rows if row["status"] != "done"]


def run_sweep(
    sweep: Sweep, out: Path | str, *, jobs: int | None = None, progress: Progress | None = None
) -> SweepResult:
    """Compute the points of `sweep` that `out` lacks, and write points.csv, summary.json, figure.png and figure.svg.

    `jobs`: processes, by default one per core; the results do not depend on it. May be killed at any time and
    started again. Raises InputError when `out` cannot be written, SimulationError when a process dies.
    """
    out, progress, began = Path(out), progress or QuietProgress(), perf_counter()
    prepare_output(out)
    results.write_text(out / "scene.yaml", sweep.to_yaml())
    store = PointStore(out / "points")
    scenes = [point.scene for point in sweep.points]
    keys = [point_key(scene) for scene in scenes]
    found = {key: result for key in keys if (result := store.get(key)) is not None}
    computed = _compute(
        {key: scene for key, scene in zip(keys, scenes, strict=True) if key not in found},
        store,
        jobs or os.cpu_count() or 1,
        progress,
        len(found),
    )
    found |= computed
    progress.stop()
    rows = [_row(sweep, point.scene, key, found[key]) for point, key in zip(sweep.points, keys, strict=True)]
    write_table(out / "points.csv", rows)

    from taichi_disk.study.analysis import analyse
    from taichi_disk.study.figures import draw

    analysis = analyse(sweep.base.scene, sweep.axes, rows)
    summary = {
        "scene": sweep.base.scene,
        "axes": sweep.axes,
        "points": len(rows),
        "failed": [{name: row[name] for name in [*sweep.axes, "reason"]} for row in rows if row["status"] != "done"],
        **analysis.summary(),
        "computed_now": len(computed),
        "wall_clock": perf_counter() - began,
        "jobs": jobs or os.cpu_count() or 1,
        "versions": results.versions(),
    }
    results.write_summary(out / "summary.json", summary)
    draw(analysis, out)
    return SweepResult(rows, summary, out)


def _compute(
    missing: dict[str, Scene], store: PointStore, jobs: int, progress: Progress, done: int
) -> dict[str, PointResult]:
    by_lattice: dict[str, list[str]] = defaultdict(list)
    for key, scene in missing.items():
        by_lattice[lattice_key(scene)].append(key)
    tasks = list(by_lattice.values())
    progress.start("sweep", done + len(missing))
    progress.update(done)
    computed: dict[str, PointResult] = {}
    for number, index, result in compute_all([[missing[key] for key in task] for task in tasks], jobs):
        key = tasks[number][index]
        store.put(key, missing[key], result)
        computed[key] = result
        progress.update(done + len(computed))
    return computed


def _row(sweep: Sweep, scene: Scene, key: str, result: PointResult) -> Row:
    from taichi_disk.sweep_axes import value_of

    names = [*HEADLINES[scene.scene], "young", "poisson", *ERRORS, *HOW]
    row: Row = {name: value_of(scene, name) for name in sweep.axes}
    row |= {name: result.numbers.get(name) for name in names}
    return row | {"status": result.status, "reason": result.reason, "key": key}


def write_table(path: Path, rows: list[Row]) -> None:
    """CSV, one line per point; numbers with all their digits, nothing where there is none."""

    def text(value: Any) -> str:
        if isinstance(value, bool):
            return "true" if value else "false"
        return "" if value is None else repr(value) if isinstance(value, float) else str(value)

    def write(beside: Path) -> None:
        with beside.open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(rows[0])
            table.writerows([text(value) for value in row.values()] for row in rows)

    atomic_write(path, write)
