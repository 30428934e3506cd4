"""The error of the time step beside the others: how the headline changes with lattice, number of points and wall."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from taichi_disk.dynamics import move
from taichi_disk.lattice import MAX_POINTS
from taichi_disk.model import runtime
from taichi_disk.model.stability import spectrum
from taichi_disk.progress import Progress, QuietProgress
from taichi_disk.quasistatic import press
from taichi_disk.scene import Scene
from taichi_disk.scenes import build
from taichi_disk.scenes.compression import Compression
from taichi_disk.study.accuracy import Point

SEEDS = 8
FINER = (4, 16, 64)  # times the points, while there may be so many; same mass, stiffness, viscosity of the whole disk
HARDER = (3.0, 10.0)  # times the wall's a
AUTOMATIC = 0.8  # of the stability limit


@dataclass(frozen=True)
class Source:
    """One change to the scene: what it is, the headline with it, and how far that is from the headline without."""

    source: str
    change: str
    headline: float
    difference: float


def other_errors(scene: Scene, points: list[Point], progress: Progress) -> list[Source]:
    """Compute the scene with other lattices, finer lattices and harder walls, each by its automatic step.

    `points`: the errors of the step, measured against the reference. Compressions are solved by Newton's method.
    """
    runtime.start("cpu")
    changes = list(_changes(scene))
    progress.start("compare", len(changes) + 1)
    base = _headline(scene)
    progress.update(1)
    found = [Source("time step", _named(one), base, one.error) for one in points if one.fraction == AUTOMATIC]
    for number, (source, change, other) in enumerate(changes, 2):
        headline = _headline(other)
        found.append(Source(source, change, headline, headline - base))
        progress.update(number)
    return found


def _named(point: Point) -> str:
    return f"{point.integrator}, {point.precision}, {point.fraction:g} of the limit"


def _changes(scene: Scene) -> Iterator[tuple[str, str, Scene]]:
    """(source, change, scene with it)."""
    lattice, material, wall = scene.lattice, scene.material, scene.wall
    for seed in range(lattice.seed + 1, lattice.seed + SEEDS):
        yield "lattice sample", f"seed {seed}", _with(scene, lattice={"seed": seed})
    for factor in FINER:
        points = factor * lattice.points
        if points > MAX_POINTS:
            break
        changed: dict[str, dict[str, Any]] = {"lattice": {"points": points}}
        # eta = eta* m c/R of a spring is a material constant, m = M/N is not.
        changed["material"] = {"eta_star": factor * material.eta_star}
        if scene.scene == "absorbing_wall":
            changed["wall"] = {"points": factor * scene.wall.points}
        yield "points", f"N = {points:,}", _with(scene, **changed)
    for multiple in HARDER:
        yield "wall hardness", f"a = {multiple * wall.a:g}/R", _with(scene, wall={"a": multiple * wall.a})


def _with(scene: Scene, **sections: dict[str, Any]) -> Scene:
    updates = {name: getattr(scene, name).model_copy(update=values) for name, values in sections.items()}
    return scene.model_copy(update=updates)


def _headline(scene: Scene) -> float:
    setup = build(scene)
    if isinstance(setup, Compression):
        outcome = press(setup)
    else:
        modes = spectrum(setup.lattice, setup.physics)
        outcome = move(setup, scene.time, modes, QuietProgress())
    return next(iter(setup.headline(outcome.columns).values.values()))
