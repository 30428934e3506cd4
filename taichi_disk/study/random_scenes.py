"""Scenes drawn at random from all that a scene file may say, and what became of each.

A scene is known by its number: the same one everywhere. Sizes are few and small, so that scenes share kernels.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from taichi_disk.dynamics import OPEN
from taichi_disk.errors import InputError, SimulationError
from taichi_disk.model import runtime
from taichi_disk.model.world import World, features
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import make_world
from taichi_disk.study.hard_cases import End, compute
from taichi_disk.time_step import TimeStep

# points, seed, rim, min_spacing; points and width of the wall
LATTICES = (
    (3, 1, True, 0.7, 100, 8.0),
    (7, 2, False, 0.0, 60, 5.0),
    (20, 3, True, 0.7, 60, 3.0),
    (20, 4, False, 0.0, 60, 3.0),
    (50, 5, True, 0.4, 80, 2.5),
)
MOST_WORK = 3e8  # springs times steps, up to the scene's max_time: about a second
MOST_WORLDS = 200  # before Taichi is started afresh: it never gives all back
KEY = re.compile(r"\b(lattice|material|wall|impact|compression|time)\.[a-z_0A-Z]+")


def random_scene(number: int, kinds: int = 3) -> tuple[str, tuple[str, ...]]:
    """Name and settings of scene `number`; `kinds` = 2: impacts of one disk that share two sets of kernels.

    Six decades of k_a, five of eta*, five of the walls' hardness, twelve of their strength, four of speed.
    """
    rng = np.random.default_rng([20, number])

    def between(low: float, high: float) -> float:
        return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.4g}")

    points, seed, rim, spacing, wall_points, width = LATTICES[rng.integers(len(LATTICES)) if kinds == 3 else 2]
    kind = ("exponential_wall", "absorbing_wall", "compression")[rng.integers(kinds)]
    eta_star = between(0.1, 1e4) if kinds < 3 or rng.random() < 0.6 else 0.0
    a, V0 = between(1.0, 1e5), between(1e-6, 1e6)
    settings = [
        *(f"lattice.points={points}", f"lattice.seed={seed}", f"lattice.rim={str(rim).lower()}"),
        *(f"lattice.min_spacing={spacing}", f"material.k_a={between(1e-3, 1e3)}", f"material.eta_star={eta_star}"),
        f"material.k_b={between(1e-6, 1e3) if kinds < 3 or rng.random() < 0.5 else 0.0}",
        *(f"wall.a={a}", f"wall.V0={V0}", f"time.safety={rng.uniform(0.05, 1.0):.3f}"),
    ]
    if kind == "compression":
        settings += [
            *(f"compression.pressure={between(1e-5, 10.0)}", f"compression.tolerance={between(1e-7, 1e-3)}"),
            f"compression.method={('newton', 'relaxation')[rng.integers(2)]}",
        ]
    else:
        v = between(1e-3, 10.0)
        settings.append(f"impact.velocity={v}")
    if kind == "absorbing_wall":
        reach = max(math.log(V0) - math.log(5e-6) - 2.0 * math.log(v), 0.1) / a
        settings += [
            *(f"wall.points={wall_points}", f"wall.width={width}", f"wall.reset_interval={between(1e-3, 1.0)}"),
            f"wall.threshold={min(max(reach * rng.uniform(1.01, 4.0), 1e-3), 1e3):.4g}",
            f"wall.boundary={('reset', 'pinned', 'dashpot')[rng.integers(3 if kinds == 3 else 1)]}",
        ]
    if kind == "exponential_wall" and eta_star == 0.0 and rng.random() < 0.3:
        settings.append("time.integrator=vefrl")
    elif kinds < 3:
        settings.append("time.integrator=trapezoidal")
    return kind, tuple(settings)


@dataclass(frozen=True)
class Fate:
    """How scene `number` ended; `fault`: what a scene must never do, if it did it. `long`: it was given up."""

    number: int
    end: End | Literal["long"]
    text: str
    fault: str | None = None


class _TooLong(Exception):
    """More work than a scene of a thousand may take."""


class Fates:
    """Computes scenes one after the other, keeping compiled worlds."""

    def __init__(self) -> None:
        self._worlds: dict[object, World] = {}
        runtime.start("cpu", threads=1)

    def of(self, number: int, kinds: int = 3) -> Fate:
        if len(self._worlds) >= MOST_WORLDS:
            self._worlds.clear()
            runtime.start("cpu", threads=1)
        name, settings = random_scene(number, kinds)
        try:
            facts = compute(load_scene(name, settings), make=self._make).facts
        except _TooLong as error:
            return Fate(number, "long", str(error))
        except InputError as error:
            return Fate(number, "refused", str(error))
        except SimulationError as error:
            text = str(error)
            return Fate(number, "stopped", text, None if KEY.search(text) else f"no remedy: {text}")
        return Fate(number, "done", "; ".join(facts.get("warnings", ())), _fault(name, facts))

    def _make(self, setup: Setup, step: TimeStep, earlier: World | None) -> World:
        work = len(setup.lattice.bonds) * setup.max_time / step.dt
        if work > MOST_WORK:
            raise _TooLong(f"{work:.1g} springs times steps")
        key = features(replace(setup.physics, integrator=step.integrator))
        self._worlds[key] = make_world(setup, step, self._worlds.get(key))
        return self._worlds[key]


def _fault(name: str, facts: dict[str, object]) -> str | None:
    """What is wrong with the result of a scene that says it is done."""
    headline = "xi" if name == "compression" else "restitution"
    value, energy = facts[headline], facts.get("energy")
    assert isinstance(value, float)
    if not math.isfinite(value):
        return f"{headline} = {value}"
    if not isinstance(energy, dict):
        return None
    if not abs(energy["closing_imbalance"]) <= OPEN:
        return f"the ledger is off by {energy['closing_imbalance']:.2g}"
    gain = max(0.0, -energy["sliding"] / energy["scale"]) + 2e-3
    if headline == "restitution" and not 0.0 < value <= math.sqrt(1.0 + gain):
        return f"e = {value}"
    return None
