"""`python -m tests.benchmarks`: see `tests.benchmarks`."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from taichi_disk.base import runtime
from taichi_disk.base.files import versions
from taichi_disk.base.machine import processor

from . import kernel, page, precision

PARTS = ("kernel", "page", "precision")


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks")
    parser.add_argument("parts", nargs="+", choices=PARTS)
    parser.add_argument(
        "--repeats",
        type=int,
        default=9,
        help="of `kernel` and `precision` (default: 9)",
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
    parser.add_argument(
        "--speeds",
        nargs="+",
        type=float,
        default=precision.SPEEDS,
        metavar="V",
        help="of `precision` [c] (default: %(default)s)",
    )
    given = parser.parse_args()
    summary = {"processor": processor(), "cores": os.cpu_count(), **versions()}
    if hasattr(os, "getloadavg"):
        summary["load average"] = f"{os.getloadavg()[0]:.1f}"
    print(", ".join(f"{name} {value}" for name, value in summary.items()), "\n")
    runtime.start(threads=1)
    if "kernel" in given.parts:
        for line in kernel.kernel(given.repeats, tuple(given.set)):
            print(line, flush=True)
    if "page" in given.parts:
        for line in page.page(tuple(given.set)):
            print(line, flush=True)
    if "precision" in given.parts:
        options = {name: vars(given)[name] for name in ("figure", "lattices", "speeds")}
        for line in precision.precision(given.repeats, tuple(given.set), **options):
            print(line, flush=True)


if __name__ == "__main__":
    main()
