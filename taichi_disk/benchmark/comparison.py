"""The same impact by other programs, step by step; each has to agree before it is timed."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

from taichi_disk.benchmark.engine import EngineProcess, ours
from taichi_disk.benchmark.judge import restitution
from taichi_disk.benchmark.peers import STEPPERS
from taichi_disk.benchmark.stopwatch import Timing, in_turn
from taichi_disk.benchmark.task import Task, impact
from taichi_disk.errors import SimulationError

PART = "peers"
OURS = "taichi_disk"
AGREEMENT = 1e-9  # of e with the judge's: rounding and no more
CASES = {"wall": 0.0, "wall, dashpots": 10.0}  # with eta*


def measure(repeats: int) -> tuple[list[Timing], list[str]]:
    """Timings of every case, this program first in each; and a line for every program that is missing."""
    timings: list[Timing] = []
    absent: dict[str, None] = {}  # in order, each once
    for case, eta_star in CASES.items():
        task = impact("exponential_wall", f"material.eta_star={eta_star}", "time.integrator=velocity_verlet")
        found, without = compare(case, task, repeats)
        timings += found
        absent |= dict.fromkeys(without)
    return timings, list(absent)


def compare(case: str, task: Task, repeats: int) -> tuple[list[Timing], list[str]]:
    """This program and all peers that can carry out `task` and agree on e."""
    absent: list[str] = []
    runs: dict[str, EngineProcess] = {}
    differences: dict[str, float] = {}
    e = {lead: restitution(task, lead) for lead in (0.5, 0.0)}
    with ExitStack() as stack:
        runs[OURS] = stack.enter_context(ours())
        runs[OURS].open(task)
        differences[OURS] = abs(runs[OURS].restitution(0) - e[0.5])
        for peer in STEPPERS:
            if not peer.takes(task.physics):
                continue
            if peer.missing():
                absent.append(f"{peer.name}: not installed: pip install 'taichi-disk[peers]'")
                continue
            process = stack.enter_context(EngineProcess(peer.engine))
            try:
                process.open(task, **peer.options)
                difference = abs(process.restitution(0) - e[peer.lead])
                if not difference <= AGREEMENT:
                    raise SimulationError(f"not timed: its e is off by {difference:.1e}")
            except SimulationError as error:
                absent.append(f"{peer.name}: {error}")
                continue
            runs[peer.name], differences[peer.name] = process, difference
        seconds = in_turn({name: partial(process.run, 0) for name, process in runs.items()}, repeats)
    base = [one / task.work for one in seconds[OURS]]
    return [
        Timing(
            part=PART,
            name=f"{case}: {name}",
            work=task.work,
            seconds=seconds[name],
            base=base,
            points=task.lattice.disk_points,
            error=differences[name],
        )
        for name in runs
    ], absent
