"""Runs every hard case, and writes the tables of docs/stability.md: what was tried, what the program does.

python -m tests.validation.stability_tables [--scenes 100] [--out docs/data]
"""

from __future__ import annotations

import argparse
import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from taichi_disk import runtime
from taichi_disk.simulation.simulation import KernelCache

from .endurance import ABOVE, BELOW, DRIFTS, LIMITS, STIFFNESSES, Rest, drift
from .hard_cases import CASES, Case
from .random_scenes import ShortOnly, fate

Row = dict[str, Any]

MOST_WORK = 3e8  # of a random scene: some seconds


def hard_case(case: Case, kernels: KernelCache) -> Row:
    verdict = case.judge(kernels)
    facts, energy = verdict.facts, verdict.facts.get("energy", {})
    name = "restitution" if "restitution" in facts else "xi"
    return {
        "case": case.name,
        "scene": case.scene,
        "settings": " ".join(case.settings.split()) + (" --force" if case.force else ""),
        "end": verdict.end,
        "result": facts.get(name, ""),
        "error_estimate": facts.get("error_estimate", {}).get(name, ""),
        "closing_imbalance": energy.get("closing_imbalance", ""),
        "worst_imbalance": energy.get("worst_imbalance", ""),
        "sliding": energy["sliding"] / energy["scale"] if energy.get("sliding") else "",
        "steps": facts.get("steps", ""),
        "attempts": facts.get("attempts", ""),
        "message": re.sub(r"\s+", " ", verdict.text),
        "not_as_it_should_be": "; ".join(case.failings(verdict)),
    }


def limits(kernels: KernelCache) -> Iterator[Row]:
    """For each integrator, free and pressed on the wall, soft and stiff."""
    for integrator, eta_star in LIMITS:
        for pressed in (False, True):
            for k_a in STIFFNESSES:
                rest = Rest(integrator, eta_star, k_a, pressed)
                yield {
                    **{"integrator": integrator.name, "eta_star": eta_star, "pressed": pressed, "k_a": k_a},
                    "limit_over_true_limit": rest.stated / rest.true,
                    f"energy_after_{BELOW}_steps_at_0.98": rest.growth(kernels, 0.98 * rest.stated, BELOW)[0],
                    "steps_to_a_million_times_at_1.05": rest.growth(kernels, 1.05 * rest.true, ABOVE)[1],
                }


def drifts(kernels: KernelCache) -> Iterator[Row]:
    for integrator, bouncing, fraction, steps in DRIFTS:
        energy, modified = drift(kernels, integrator, bouncing, fraction, steps)
        row = {"integrator": integrator.name, "bouncing": bouncing, "fraction_of_limit": fraction, "steps": steps}
        row |= {"swing": energy.swing, "slope": energy.slope, "slope_error": energy.slope_error}
        yield row | ({"modified_swing": modified.swing, "modified_slope": modified.slope} if modified else {})


def random_ends(kernels: KernelCache, count: int) -> Iterator[Row]:
    """How many of `count` random scenes ended in which way."""
    short, ends = ShortOnly(kernels, MOST_WORK), Counter()
    for number in range(count):
        verdict, fault = fate(number, short)
        ends[verdict.end, "" if verdict.end == "done" else _kind(verdict.text), fault] += 1
    return ({"end": e, "message": text, "fault": fault, "scenes": n} for (e, text, fault), n in ends.most_common())


def _kind(text: str) -> str:
    """A message without its numbers, up to its first clause."""
    cause = re.search(r"Likely cause: ([^:;.]*)", text)
    text = cause[1] if cause else re.sub(r"^blow-up by step [^:]*: ", "", text)
    return re.sub(r"\s*[-+]?\d[\d.,e+-]*", " …", text)[:70].rstrip(" (")


def write(path: Path, rows: Iterable[Row]) -> None:
    rows = list(rows)
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(dict.fromkeys(key for row in rows for key in row)), lineterminator="\n")
        table.writeheader()
        for row in rows:
            table.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})


def main() -> None:
    parser = argparse.ArgumentParser(description="Run every hard case and write the tables about them.")
    parser.add_argument("--scenes", type=int, default=100, help="how many random ones (default: 100)")
    parser.add_argument("--out", type=Path, default=Path("docs/data"))
    given = parser.parse_args()
    runtime.start(threads=1)
    kernels = KernelCache(40)
    write(given.out / "hard_cases.csv", (hard_case(case, kernels) for case in CASES))
    write(given.out / "step_limits.csv", limits(kernels))
    write(given.out / "energy_drift.csv", drifts(kernels))
    write(given.out / "random_scenes.csv", random_ends(kernels, given.scenes))


if __name__ == "__main__":
    main()
