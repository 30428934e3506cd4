"""Runs every hard case and writes docs/stability.md: what was tried, what the program does, by what margin.

python -m taichi_disk.study.stability_page [--scenes 100] [--out docs/stability.md]
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from taichi_disk.dynamics import OPEN
from taichi_disk.model import runtime
from taichi_disk.model.world import World
from taichi_disk.results import versions, write_text
from taichi_disk.study.endurance import ABOVE, BELOW, DRIFTS, LIMITS, Rest, drift
from taichi_disk.study.hard_cases import CASES, Case, Verdict, judge
from taichi_disk.study.random_scenes import MOST_WORK, Fates

_HEAD = """# Hard cases

What the program does at the edge of what it can, and beyond. Every case ends in one of three ways: **done**, with
an energy ledger that closes to 10⁻³ of the kinetic energy (the automatic step aims at 2·10⁻⁵), or with a warning
that a step by hand left it open; **stopped**, with the reason and a remedy and exit status 1 (a blow-up with step,
time, place, likely cause, and the last good state in `failure.npz`); or **refused** before anything is computed,
exit status 2. Made by

    python -m taichi_disk.study.stability_page

from the definitions that the tests use (`taichi_disk/study/hard_cases.py`, `endurance.py`, `random_scenes.py`).

A closed ledger is needed for a right e, but not enough where the motion is chaotic: a crushed disk whose triangles
turn over, or points that rattle between a disk and a very hard wall, come out differently with every other step or
rounding. The last column, the same scene in single precision, shows how many digits of e the scene itself bears (for
a = 10⁶/R, also how coarsely f32 rounds heights).
"""

_ENERGY = """\
The true limit is that of the whole matrix of a step: with explicit dashpots the step at which its spectral radius
passes 1, else the integrator's own limit over the highest frequency. Implicit dashpots do not lower that: in a mode
that changes sign at every step the velocity at the steps is 0, and no dashpot acts. They do not damp it either, so
that beyond the limit such a mode grows, slowly where damping is strong, without kinetic energy at the steps; and
just below it dies out slowly (the 150 in the table). The ledger sees it, by the elastic energy.

Energies are relative to what the disk has above its rest, slopes over the whole run. Leapfrog conserves not the
energy E but, to the fourth order of the step h, the modified energy E + h² (v·V″v/12 − |f|²/(24 m)) (Hairer, Lubich
& Wanner, Acta Numerica 2003): E + (hω)² E/24 on average for a mode of frequency ω. In bounces, energy goes over from
the slow bounce to fast vibration until it is spread evenly, so E at the steps falls, as h² and no more: with half the
step, in the same time, by about a quarter of that, and the modified energy wanders by a sixteenth.
`tests/test_stability.py`.
"""

_TAIL = """
## How a blow-up is found

After every launch of steps (some 3 million springs, in lattices that several cores step 300 million) the state is
looked at: a number that is none, a disk inside the elastic wall or past its end. In the rows of the time series
between, the energy balance must hold to 10 % of the largest energy so far, and so must what points lost by sliding.
Where it does not, the launch is computed again step by step: the message names the first bad step, and its cause
follows from that step and the one before (`taichi_disk/diagnosis.py`). An automatic step is shortened and tried again
up to seven times, but only once more where the contact with the elastic wall was lost. A step by hand is not:
`warnings` in summary.json, and on the screen, say where it was beyond the limit that the measured force of the wall
leaves, and where the ledger is open by more than 10⁻³.

Sweeps and the window look for the same. A sweep computes a lane that blew up again, alone, and gives the reason
that a run gives, word for word; the window tries a shorter step as a run does, then stops with what it has seen.

A number spoilt in memory between two launches (`tests/test_blow_up.py`) is found at the next one and told as
such.

## What falls short
* The limit of the step is that of small vibrations. A disk that vibrates for very long at strains of per cents
  can blow up below it: `vefrl` at 0.8 of its limit after 46,000 steps, `velocity_verlet` at 0.95 after 42,000.
  An impact takes a thousand; the ledger tells.
* Very strong implicit dashpots (η* > 1000) beside a reset boundary: right after a reset the ledger can be off by
  some per cents for a moment, at any affordable step. It closes at the end, with the square of the step.
* The elastic wall's contact is between a point and the spring below it. Where the surface is steep, passing
  from spring to spring changes the energy by itself (`sliding`), more than a tenth from v ≈ 0.3 c on: there the
  model, not the step, ends.
"""


def page(scenes: int) -> str:
    """The whole page; computes for some minutes."""
    runtime.start("cpu", threads=1)
    lines = [
        _HEAD,
        "## Scenes",
        "",
        "| case | tried | what it does | measured, or told | in f32 |",
        "|---|---|---|---|---|",
    ]
    doubles = [judge(case) for case in CASES]
    runtime.start("cpu", threads=1, precision="f32")
    singles = [judge(case.in_single_precision()) for case in CASES]
    lines += [_row(*one) for one in zip(CASES, doubles, singles, strict=True)]
    lines += [
        "",
        "All of them: `tests/test_hard_cases.py`, in single precision `tests/test_precision.py`.",
        "",
        "## The limit of the step, and energy for 10⁶ steps",
        "",
    ]
    in_single = list(_limits("f32"))
    runtime.start("cpu", threads=1)
    lines += [
        "| case | tried | what it does | measured |",
        "|---|---|---|---|",
        *_limits("f64"),
        *in_single,
        *_drifts(),
    ]
    lines += ["", _ENERGY, "## Random scenes", "", *_random(scenes), _TAIL]
    return "\n".join(lines) + "\n" + ", ".join(f"{name} {version}" for name, version in versions().items()) + ".\n"


def _row(case: Case, double: Verdict, single: Verdict) -> str:
    wrong = case.failings(double) + case.in_single_precision().failings(single)
    settings = " ".join(case.settings) + (" `--force`" if case.force else "")
    end = f"**{double.end}**" + (f" — but {'; '.join(wrong)}" if wrong else "")
    row = f"| {case.name} | {case.scene} {settings} | {end} | {double.measured} | {_in_single(double, single)} |"
    return row.replace("_", "\\_")


def _in_single(double: Verdict, single: Verdict) -> str:
    """What is different in single precision."""
    if single.end != double.end:
        return f"**{single.end}**: {single.measured}"
    return single.measured.split(",")[0] if single.end == "done" else "the same"


def _limits(precision: str) -> Iterator[str]:
    """For each integrator, free and pressed on the wall, soft and stiff, in the precision that Taichi has."""
    for integrator, eta_star in LIMITS:
        for pressed in (False, True):
            grown, shares, lost, factors = [], [], [], []
            world: World | None = None
            for k_a in (1e-3, 1.0, 1e3):
                rest = Rest(integrator, eta_star, k_a, pressed)
                shares.append(rest.limit.stated / rest.limit.true)
                world = rest.world(0.98 * rest.limit.stated, world)
                grown.append(rest.growth(world, BELOW)[0])
                world = rest.world(1.05 * rest.limit.true, world)
                lost.append(rest.growth(world, ABOVE)[1])
                if eta_star:
                    factors.append(rest.factor(1.05 * rest.limit.true))
            below = ", ".join(f"{value:.2g}" for value in grown)
            above = ", ".join(f"{step:,}" if step < ABOVE else f"not in {ABOVE:,}" for step in lost)
            by = f" (amplitude times {', '.join(f'{one:.5g}' for one in factors)} a step)" if factors else ""
            where = "pressed on the wall, P = 0.01 k_a" if pressed else "free"
            yield (
                f"| {integrator}, {precision}, η* = {eta_star:g}, {where} | 60 points, k_a = 10⁻³, 1, 10³: "
                f"{BELOW:,} steps at 0.98 of the limit; {ABOVE:,} at 1.05 of the true one | "
                f"bounded; blows up | energy over its first value {below}; "
                f"10⁶ times it by step {above}{by}; "
                f"the limit is {min(shares):.2f} to {max(shares):.2f} of the true one |"
            )


def _drifts() -> Iterator[str]:
    for integrator, bouncing, fraction, steps in DRIFTS:
        energy, modified = drift(integrator, bouncing, fraction, steps)
        what = "bouncing on the wall under P = 0.01" if bouncing else "vibrating freely"
        slopes = f"slope {energy.slope:+.1e} ± {energy.slope_error:.0e}"
        if modified is not None:
            slopes += f"; modified energy: within {modified.swing:.0e}, slope {modified.slope:+.0e}"
        yield (
            f"| {integrator}, {what}, η* = 0 | 60 points, {steps:,} steps of {fraction:g} of the limit | energy "
            f"stays within {energy.swing:.1g} | {slopes} |"
        )


def _random(count: int) -> Iterator[str]:
    fates = Fates()
    ends: Counter[str] = Counter()
    faults = []
    for number in range(count):
        fate = fates.of(number)
        if fate.fault:
            faults.append(f"scene {number}: {fate.fault}")
        ends[f"{fate.end}: {_kind(fate.text)}" if fate.end in ("stopped", "refused") else fate.end] += 1
    yield (
        f"{count:,} scenes drawn at random (`random_scenes.py`: N from 3 to 50, k_a over six decades, η* over five, a "
        "over five, V₀ over twelve, v from 10⁻³ to 10, all boundaries, all integrators). Each must be done with a "
        f"ledger off by no more than {OPEN:g} and 0 < e ≤ 1, or stopped with the key of the scene that mends it. "
        f"Faults: {'; '.join(faults) or 'none'}. (`tests/test_random_scenes.py`: 1,000.)"
    )
    yield ""
    yield f"(long: not computed, more than {MOST_WORK:.0e} springs times steps.)"
    yield ""
    yield "| end | scenes |"
    yield "|---|---|"
    for end, many in ends.most_common():
        yield f"| {end} | {many} |"


def _kind(text: str) -> str:
    """A message without its numbers, up to its first clause."""
    cause = re.search(r"Likely cause: ([^:;.]*)", text)
    text = cause[1] if cause else re.sub(r"^blow-up by step [^:]*: ", "", text)
    return re.sub(r"\s*[-+]?\d[\d.,e+-]*", " …", text)[:70].rstrip(" (")


def main() -> None:
    parser = argparse.ArgumentParser(description="Run every hard case and write the page about them.")
    parser.add_argument("--scenes", type=int, default=100, help="how many random ones (default: 100)")
    parser.add_argument("--out", type=Path, default=Path("docs/stability.md"))
    given = parser.parse_args()
    write_text(given.out, page(given.scenes))


if __name__ == "__main__":
    main()
