"""Several bounces under gravity: their results, and conflicts of their keys."""

from __future__ import annotations

from taichi_disk.experiments.config.sections import ImpactSection
from taichi_disk.experiments.scenes.conflicts import Conflicts

# name and unit of the results of later bounces, up to the most `impact.bounces`
LATER = {
    f"restitution_{number}": (f"restitution e of bounce {number}", "")
    for number in range(2, 101)
}
NAMES = ("restitution", *LATER)
# longest flights in all [R/c]: some minutes, and some 300 MB of rows
LONGEST_FLIGHTS = 3e4


def bounce_conflicts(impact: ImpactSection, reach: float) -> Conflicts:
    """Return the conflicts of gravity. `reach`: height up to which the disk feels the
    wall [R]."""
    g = impact.gravity
    v = impact.velocity
    if not g:
        text = (
            "nothing falls without gravity: take an impact.gravity above 0, or"
            " bounces: 1 and drop: 0"
        )
        meant = {"impact.bounces": impact.bounces > 1, "impact.drop": impact.drop}
        return [(key, text) for key in meant if meant[key]]
    duration = 2.0 * impact.bounces * v / g
    faults = [
        (
            impact.drop and v != impact.fall_speed,
            "impact.drop",
            f"impact.velocity = {v:g} (or the mean of own velocities) is not the speed"
            f" of this fall: write {ImpactSection.velocity:g}, its default, or drop=0",
        ),
        (
            impact.gap != "auto",
            "impact.gap",
            "heights under gravity begin where the wall is hardly felt: write auto",
        ),
        (
            impact.rise < reach,
            "impact.gravity",
            f"the disk would lie on the wall, which it feels up to {reach:.2g} R: write"
            f" at most {0.49 * v**2 / reach:.2g}, or a higher velocity; with a drop"
            " only a higher drop helps",
        ),
        (
            duration > LONGEST_FLIGHTS,
            "impact.gravity",
            f"the flights would last {duration:.2g} R/c, of the paper's disk some"
            f" {duration / 17e3:.1f} million steps: write a larger one, or fewer"
            " bounces",
        ),
    ]
    return [(key, text) for is_fault, key, text in faults if is_fault]
