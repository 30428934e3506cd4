"""What the program is meant to reach, and whether a report shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taichi_disk.benchmark import comparison, kernel, size, solution, sweep, window
from taichi_disk.benchmark.stopwatch import Timing
from taichi_disk.study.lanes import LANES

WITHIN = 1e-5  # of e


@dataclass(frozen=True)
class Target:
    """A bound on one number of a part of the report; `value` is None where it was not measured."""

    part: str
    text: str
    bound: float
    value: float | None
    at_least: bool = False

    @property
    def met(self) -> bool | None:
        if self.value is None:
            return None
        return self.value >= self.bound if self.at_least else self.value <= self.bound


def judged(timings: Sequence[Timing], fraction: float | None) -> list[Target]:
    """Every target: of ratios the medians over the turns, of costs the least, which other programs disturb least.

    `fraction` is how long the automatic step without dashpots is, of the stability limit.
    """

    def find(part: str, name: str) -> Timing | None:
        return next((t for t in timings if t.part == part and t.name.startswith(name)), None)

    def ratio(part: str, name: str) -> float | None:
        timing = find(part, name)
        return timing.ratio if timing else None

    def least(part: str, name: str) -> float | None:
        timing = find(part, name)
        return 1e9 * timing.least if timing else None

    def error(part: str, name: str) -> float | None:
        timing = find(part, name)
        return timing.error if timing else None

    def frames(names: Sequence[str]) -> float | None:
        found = [timing for name in names if (timing := find(window.PART, name))]
        return min(1.0 / timing.typical for timing in found) if len(found) == len(names) else None

    wall, both = comparison.CASES
    double, single = (sweep.name_of(LANES[precision], precision, "all cores") for precision in sweep.PRECISIONS)
    large = ratio(size.PART, size.name_of(100_000, 2))
    steps, peers, end = kernel.PART, comparison.PART, solution.PART
    per_lane = "ns per spring, step and lane, all cores, lanes as in a sweep"
    return [
        Target(steps, "ns per spring and step, wall and dashpots, one core", 4.0, least(steps, kernel.SINGLE)),
        Target(
            size.PART, "times as fast on all cores as on one, 100,000 points", 1.6, 1.0 / large if large else None, True
        ),
        Target(sweep.PART, f"{per_lane}, f64", 1.1, least(sweep.PART, double)),
        Target(sweep.PART, f"{per_lane}, f32", 0.55, least(sweep.PART, single)),
        Target(peers, "times Numba's speed, wall", 1.0, ratio(peers, f"{wall}: Numba"), True),
        Target(peers, "times Numba's speed, wall and dashpots", 1.0, ratio(peers, f"{both}: Numba"), True),
        Target(peers, "times LAMMPS's speed, fix addforce", 5.0, ratio(peers, f"{wall}: LAMMPS, fix addforce"), True),
        Target(peers, "times LAMMPS's speed, fix wall/morse", 5.0, ratio(peers, f"{wall}: LAMMPS, fix wall"), True),
        Target(peers, "times LAMMPS's speed, vector dashpots", 25.0, ratio(peers, f"{both}: LAMMPS"), True),
        Target(end, "times the speed of SciPy's DOP853 to the same error", 100.0, ratio(end, solution.SOLVER), True),
        Target(end, "error of e, eta* = 0, automatic step", WITHIN, error(end, "eta* = 0,")),
        Target(end, "that step, of the limit with the wall's force that was met", 0.75, fraction, True),
        Target(end, "error of e, eta* = 100, automatic step", WITHIN, error(end, "eta* = 100,")),
        Target(end, "times the time of eta* = 0 at eta* = 100", 8.0, ratio(end, "eta* = 100,")),
        Target(window.PART, "frames/s in the window, slowest of the three scenes", 30.0, frames(window.SCENES), True),
        Target(window.PART, "frames/s in the window, 20,000 points", 30.0, frames([window.name_of(20_000)]), True),
    ]
