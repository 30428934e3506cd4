"""Normal restitution of oblique impacts on an elastic wall, after Kuninaka and
Hayakawa, PRL 93, 154301 (2004).

    python docs/experiments/oblique.py [lattices] > docs/data/oblique.csv
    python docs/experiments/oblique.py claim [lattices] > docs/data/oblique_claim.csv

Means over lattices, for walls softer and stiffer than the disk, both contact laws,
plain and rough surfaces. A run is discarded if it does not end, if its energy is off at
the end by more than DISCARD, or if the program stops it because the energy balance is
lost or a point has gone through the wall.

`claim` examines the cases with a mean e above 1, with more lattices and with an almost
rigid wall. `tilt` is the angle [rad] between the impulse on the disk and the wall's
mean normal, positive if the impulse points back to where the disk came from.
`e_impulse` is the restitution along the direction of the impulse: minus the velocity
after the impact over the velocity before it, both along that direction.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from math import atan, atan2, nan, sin
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk import Lattice, Scene, load_scene
from taichi_disk.base import runtime

runtime.start()

from taichi_disk.experiments.computation.driver import Driver  # noqa: E402
from taichi_disk.experiments.computation.scenario import Scenario  # noqa: E402
from taichi_disk.experiments.computation.stability import TimeStep, spectrum  # noqa: E402
from taichi_disk.experiments.computation.step_control import StepControl  # noqa: E402

SCENE = Path(__file__).with_suffix(".yaml")
WALLS = (10.0, 1.0, 0.1, 0.02)  # k_a of the wall [M c^2/R^2]; the disk has 1
TANGENTS = (0.0, 1.5, 3.0, 5.0)  # tangents of the angle between flight and normal
ROUGH = 0.03  # noise of a rough surface [R]
LATTICES, CLAIM_LATTICES = 20, 100  # number of lattices for each row
# k_a of walls with the smooth contact, with which no run is discarded
CLAIM_WALLS = (100.0, 10.0, 1.0)
# largest imbalance over the kinetic energy towards the wall; the program itself allows
# 0.001
DISCARD = 0.02


def thrown(tangent: float, **wall: float | str) -> Scene:
    """Return the scene at that angle, with other keys of its wall. An oblique throw
    starts off the middle."""
    angle = atan(tangent)
    keys = {f"wall.{key}": value for key, value in wall.items()}
    return load_scene(str(SCENE)).with_(
        {"impact.angle": angle, "impact.offset": -1.5 * sin(angle), **keys}
    )


def roughened(body: Lattice, roughness: float, seed: int) -> Lattice:
    """Return disk and wall with their surface points displaced along the normal by
    normal noise [R], springs unloaded.

    If a triangle would be flatter than a quarter of its former height, its surface
    points are drawn again. The wall is moved down until its highest point is at y = 0.
    """
    rng, n = np.random.default_rng([seed, 3]), body.disk_points
    # the corners stay in place
    surface = np.concatenate([body.disk_surface, body.wall_surface[1:-1]])
    normal = np.where(
        (surface < n)[:, None],
        body.positions[surface] - body.mean(body.positions),
        [0.0, 1.0],
    )
    normal /= np.hypot(*normal.T)[:, None]
    noise, again = np.zeros(len(surface)), np.ones(len(surface), bool)
    while again.any():
        noise[again] = rng.normal(0.0, roughness, again.sum())
        x = body.positions.copy()
        x[surface] += noise[:, None] * normal
        flat = area(x, body.triangles) < 0.25 * area(body.positions, body.triangles)
        again = np.isin(surface, body.triangles[flat])
    x[n:, 1] -= x[n:, 1].max()
    i, j = body.bonds.T
    return replace(body, positions=x, rest_lengths=np.hypot(*(x[i] - x[j]).T))


def area(x: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    (ax, ay), (bx, by) = ((x[triangles[:, k]] - x[triangles[:, 0]]).T for k in (1, 2))
    return 0.5 * (ax * by - ay * bx)


def impact(scene: Scene, body: Lattice) -> tuple[float, float, float]:
    """Return normal e, e along the impulse, and tilt of the impulse [rad]; NaN if the
    run is discarded."""
    scenario: Any = scene.scenario(body)
    control = StepControl(scenario, spectrum(scenario.lattice, scenario.model))
    driver = run(scenario, control.step)
    while control.shortens(driver):
        driver = run(scenario, control.step)
    columns = driver.columns
    lost = (columns["total"][-1] - columns["total"][0]) / scenario.kinetic
    if driver.status == "failed" or abs(lost) > DISCARD:
        return nan, nan, nan
    before, after = (
        np.array([columns["com_vx"][k], columns["com_vy"][k]]) for k in (0, -1)
    )
    impulse = after - before
    return (
        scenario.result(columns)["restitution"],
        -float(after @ impulse) / float(before @ impulse),
        atan2(-impulse[0], impulse[1]),
    )


def run(scenario: Scenario, step: TimeStep) -> Driver:
    driver = Driver(scenario, step)
    driver.advance()
    return driver


@cache
def body(k_a: float, roughness: float, seed: int) -> Lattice:
    plain = thrown(0.0, k_a=k_a).with_(seed=seed).body()
    return roughened(plain, roughness, seed) if roughness else plain


def rows() -> Iterator[tuple[float, str, float, float]]:
    """Yield the wall's k_a, contact, roughness [R] and tan gamma of each row of the
    table."""
    for tangent, roughness, contact, k_a in product(
        TANGENTS, (0.0, ROUGH), ("springs", "smooth"), WALLS
    ):
        yield k_a, contact, roughness, tangent


def claim_rows() -> Iterator[tuple[float, str, float, float]]:
    """Yield the same for rough walls at the largest angle."""
    for k_a in CLAIM_WALLS:
        yield k_a, "smooth", ROUGH, TANGENTS[-1]


def statistics(found: np.ndarray, claim: bool) -> list[str]:
    """Return the columns of a row from `found` (lattices, 3), the results of
    `impact`."""
    kept = found[np.isfinite(found[:, 0])]
    e, along, tilt = kept.T
    numbers: list[float] = []
    if len(kept) > 1:
        numbers = [e.mean(), e.std(ddof=1) / len(e) ** 0.5, e.min(), e.max()]
        numbers += (
            [e.std(ddof=1), along.mean(), along.max(), tilt.mean(), tilt.std(ddof=1)]
            if claim
            else []
        )
    written = [f"{number:.4f}" for number in numbers] or [""] * (9 if claim else 4)
    return [
        str(len(found)),
        str(len(found) - len(kept)),
        *written,
        str(np.count_nonzero(e > 1.0)),
    ]


if __name__ == "__main__":
    claim = "claim" in sys.argv
    numbers = [int(word) for word in sys.argv[1:] if word != "claim"]
    lattices = numbers[0] if numbers else CLAIM_LATTICES if claim else LATTICES
    more = "deviation,e_impulse,highest_e_impulse,tilt,tilt_deviation," if claim else ""
    print(
        f"wall_k_a,contact,roughness,tan_gamma,lattices,discarded,e,error,lowest,highest,{more}above_1"
    )
    for k_a, contact, roughness, tangent in claim_rows() if claim else rows():
        scene = thrown(tangent, k_a=k_a, contact=contact)
        found = np.array(
            [impact(scene, body(k_a, roughness, seed)) for seed in range(lattices)]
        )
        print(
            k_a,
            contact,
            roughness,
            tangent,
            *statistics(found, claim),
            sep=",",
            flush=True,
        )
