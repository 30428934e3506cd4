"""`python -m tests.benchmarks`: see `tests.benchmarks`."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from taichi_disk import runtime
from taichi_disk.machine import processor
from taichi_disk.output.files import versions

from . import commands, kernel, page, precision

Part = Callable[..., Iterator[str]]  # arguments: number of turns, settings
PARTS = {
    "kernel": (kernel.kernel, "ns per spring and step, by what the scene models"),
    "run": (kernel.run, "a run's simulation beside the bare kernel"),
    "start-up": (commands.start_up, "commands that compute nothing"),
    "film": (commands.film, "`run` to its film, caches empty and warm"),
    "page": (
        page.page,
        "1, 10 and 30 pages at once; a state's processor time, the page in Chromium",
    ),
    "precision": (
        precision.precision,
        "error and wall clock of `run`, SciPy, LAMMPS and Numba",
    ),
    "sweep": (
        commands.sweep,
        "sweeps beside the bare stepping of their impacts, one process and two (long)",
    ),
}


def main():
    listed = "\n".join(f"  {name:<10}{what}" for name, (_, what) in PARTS.items())
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks",
        description=f"What a step, a run and a command cost here.\n\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help="default: all but the long one"
    )
    parser.add_argument(
        "--repeats", type=int, default=9, help="how often runs take turns (default: 9)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="of every scene, as in `run`",
    )
    parser.add_argument(
        "--figure", type=Path, metavar="PNG", help="where `precision` draws its diagram"
    )
    parser.add_argument(
        "--lattices",
        type=int,
        default=precision.LATTICES,
        help="of `precision` (default: %(default)s)",
    )
    given = parser.parse_args()
    unknown = set(given.parts) - set(PARTS)
    if unknown:
        parser.error(
            f"no part {', '.join(sorted(unknown))}: choose from {', '.join(PARTS)}"
        )
    summary = {"processor": processor(), "cores": os.cpu_count(), **versions()}
    if hasattr(os, "getloadavg"):
        summary["load average"] = f"{os.getloadavg()[0]:.1f}"
    print(", ".join(f"{name} {value}" for name, value in summary.items()))
    print(
        f"Runs take turns, {given.repeats} times; ratio: median over the turns, to the"
        " first row of a table.\n"
    )
    runtime.start(threads=1)
    parts = given.parts or [name for name in PARTS if name != "sweep"]
    for name in parts:
        part, _ = PARTS[name]
        options = {}
        if name == "precision":
            options = {"figure": given.figure, "lattices": given.lattices}
        for line in part(given.repeats, tuple(given.set), **options):
            print(line, flush=True)
        print()


if __name__ == "__main__":
    main()
