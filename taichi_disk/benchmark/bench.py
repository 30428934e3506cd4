"""The parts of `taichi-disk bench`, one after the other. Tests assert no times; this prints them."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from taichi_disk.benchmark import comparison, film, kernel, report, size, solution, sweep, window
from taichi_disk.benchmark.stopwatch import Timing
from taichi_disk.benchmark.targets import judged
from taichi_disk.model import runtime

PARTS = (kernel.PART, size.PART, sweep.PART, comparison.PART, solution.PART, film.PART, window.PART)
REPEATS = 9


def run_benchmark(parts: Sequence[str] = PARTS, out: Path | None = None) -> None:
    """Measure and print `parts`, then the targets that they show; files into `out` where that is given."""
    runtime.start("cpu", threads=1)  # for the tasks: how many steps an impact takes
    printed: list[str] = []
    timings: list[Timing] = []
    fraction = None

    def tell(lines: Iterable[str]) -> None:
        for line in lines:
            print(line, flush=True)
            printed.append(line)

    facts = report.machine()
    tell([", ".join(f"{name} {value}" for name, value in facts.items()), ""])
    tell([f"Runs take turns, {REPEATS} times; ratio: the median over the turns, to the first row of a part.", ""])
    for part in (part for part in PARTS if part in parts):
        print(f"measuring: {part}", file=sys.stderr, flush=True)  # the first time, compiling takes minutes
        if part == kernel.PART:
            found = kernel.measure(REPEATS)
            tell(report.table("one core, ns per spring, step and lane", "ns", 1e9, found))
        elif part == size.PART:
            found = size.measure(REPEATS)
            title = "by size, ns per spring and step; ratio: to explicit, one core"
            tell(report.table(title, "ns", 1e9, found))
        elif part == sweep.PART:
            found = sweep.measure(REPEATS)
            tell(report.table("lanes, ns per spring, step and lane", "ns", 1e9, found))
        elif part == comparison.PART:
            found, absent = comparison.measure(REPEATS)
            tell(report.table("other programs, one core, ns per spring and step", "ns", 1e9, found, "difference of e"))
            tell(f"  {line}" for line in absent)
        elif part == solution.PART:
            found, fraction = solution.measure(REPEATS)
            tell(report.table("time to e, automatic step, one core", "ms", 1e3, found, "error of e"))
        elif part == film.PART:
            found = film.measure(3)
            tell(report.table("a film", "s", 1.0, found))
        else:
            found, lines = window.measure()
            tell(lines)
        timings += found
        tell([""])
    targets = [target for target in judged(timings, fraction) if target.part in parts]
    if targets:
        tell(report.verdicts(targets))
    if out:
        report.write(out, facts, timings, targets, printed)
        print(f"files in {out}")
