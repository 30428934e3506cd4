"""Measure times of processes and in turn, and print ratios."""

from __future__ import annotations

import os
import subprocess
import sys
from statistics import median
from time import perf_counter

Costs = dict[str, list[float]]


def by_python(*arguments, **environment):
    """Run Python with these arguments in a process of its own; return what it prints,
    and its wall clock [s]."""
    # DOP853 multiplies 13 long rows by a few numbers: on a busy machine two threads of
    # OpenBLAS wait for each other.
    variables = os.environ | {"OPENBLAS_NUM_THREADS": "1"} | environment
    line = [sys.executable, *arguments]
    began = perf_counter()
    ended = subprocess.run(line, env=variables, capture_output=True, text=True)
    seconds = perf_counter() - began
    if ended.returncode:
        raise RuntimeError(f"{' '.join(line)}: {ended.stderr}")
    return ended.stdout, seconds


def seconds_of_python(*arguments, **environment):
    _printed, seconds = by_python(*arguments, **environment)
    return seconds


def in_turn(runs, repeats):
    """Return the costs of each run, called `repeats` times in turn (A B C A B C ...) to
    share disturbances."""
    costs = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            costs[name].append(run())
    return costs


def table(title, costs, unit="s", remarks=None):
    """Yield a table of ratios to the first row (medians over the turns), and the
    smallest and median cost."""
    base = next(iter(costs.values()))
    yield f"{title:<62}{'ratio':>8}{'min':>9}{'median':>9}  {unit}"
    for name, own in costs.items():
        ratio = median(one / other for one, other in zip(own, base, strict=True))
        line = f"  {name:<60}{ratio:8.2f}{min(own):9.3g}{median(own):9.3g}"
        if remarks:
            line += f"  {remarks.get(name, '')}"
        yield line.rstrip()
