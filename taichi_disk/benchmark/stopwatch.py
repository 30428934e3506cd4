"""Taking times: of one world's steps, and of several runs in turn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import median
from time import perf_counter

from taichi_disk.model.storage import State
from taichi_disk.model.world import World


def seconds_to_advance(world: World, start: State, steps: int) -> float:
    """Wall-clock time of `steps` steps from `start`, in one launch of a kernel that is compiled already."""
    world.import_state(start)
    began = perf_counter()
    world.advance(1, steps)
    return perf_counter() - began


def in_turn(runs: Mapping[str, Callable[[], float]], repeats: int) -> dict[str, list[float]]:
    """Seconds of each run, `repeats` times A B C A B C ...: what disturbs the machine meets all of them alike."""
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            seconds[name].append(run())
    return seconds


@dataclass(frozen=True)
class Timing:
    """Repeated measurements of one piece of work.

    Attributes:
        part, name: where it stands in the report.
        work: units of work in one run: springs times steps times lanes; 1 where a whole command is timed.
        seconds: of every run.
        base: of the runs taken in turn with them that this one is compared with, in seconds per unit of work.
        lanes, precision, threads, points: the axes.
        error: of e, against what the part says; None where there is no e.
    """

    part: str
    name: str
    work: int
    seconds: list[float]
    base: list[float]
    lanes: int = 1
    precision: str = "f64"
    threads: int = 1
    points: int = 1099
    error: float | None = None

    @property
    def costs(self) -> list[float]:
        """Seconds per unit of work, of every run."""
        return [seconds / self.work for seconds in self.seconds]

    @property
    def least(self) -> float:
        return min(self.costs)

    @property
    def typical(self) -> float:
        return median(self.costs)

    @property
    def ratio(self) -> float:
        """Cost over that of the base, the median over the pairs."""
        return median(own / other for own, other in zip(self.costs, self.base, strict=True))
