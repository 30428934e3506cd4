"""Random scenes by number. A number gives the same scene everywhere."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np

from taichi_disk.computation.diagnostics import MAX_IMBALANCE
from taichi_disk.computation.scenario import Scenario
from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Lattice
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache, Simulation

from .hard_cases import Verdict, judge

BOUNDARIES = ("reset", "pinned", "dashpot")
# Few and small lattices, which many scenes share: points, seed, rim, min_spacing;
# points and width of the wall
WILD_LATTICES = (
    (3, 1, True, 0.7, 100, 8.0),
    (7, 2, False, 0.0, 60, 5.0),
    (20, 3, True, 0.7, 60, 3.0),
    (20, 4, False, 0.0, 60, 3.0),
    (50, 5, True, 0.4, 80, 2.5),
)
TRIAL_POINTS, SHARES = (30, 60, 100, 200, 400), (0.35, 0.35, 0.2, 0.07, 0.03)
# rim, min_spacing; the default is more frequent
TRIAL_LATTICES = (
    (True, 0.7),
    (True, 0.7),
    (True, 0.7),
    (True, 0.4),
    (True, 0.4),
    (False, 0.7),
    (False, 0.0),
)
KEY = re.compile(r"\b(lattice|material|wall|impact|compression|time)\.[a-z_0A-Z]+")
TOO_LONG = "too long"


class Draw:
    """The random numbers of scene `number` of a series."""

    def __init__(self, series: int, number: int) -> None:
        self.rng = np.random.default_rng([series, number])

    def between(self, low: float, high: float) -> float:
        """Return a number with a uniform logarithm, rounded to four digits."""
        return float(f"{np.exp(self.rng.uniform(np.log(low), np.log(high))):.4g}")

    def one_of(self, choices: Any) -> Any:
        return choices[self.rng.integers(len(choices))]


def wild_scene(number: int) -> tuple[str, tuple[str, ...]]:
    """Return name and settings of a scene that may use every key of a scene file.

    It covers six decades of k_a, five of eta*, five of the walls' hardness, twelve of
    their strength, four of speed.
    """
    draw = Draw(20, number)
    rng, between = draw.rng, draw.between
    points, seed, rim, spacing, wall_points, width = draw.one_of(WILD_LATTICES)
    kind = draw.one_of(("exponential_wall", "absorbing_wall", "compression"))
    eta_star = between(0.1, 1e4) if rng.random() < 0.6 else 0.0
    a, V0 = between(1.0, 1e5), between(1e-6, 1e6)
    settings = [
        *(
            f"lattice.points={points}",
            f"lattice.seed={seed}",
            f"lattice.rim={str(rim).lower()}",
        ),
        *(
            f"lattice.min_spacing={spacing}",
            f"material.k_a={between(1e-3, 1e3)}",
            f"material.eta_star={eta_star}",
        ),
        f"material.k_b={between(1e-6, 1e3) if rng.random() < 0.5 else 0.0}",
        *(f"wall.a={a}", f"wall.V0={V0}", f"time.safety={rng.uniform(0.05, 1.0):.3f}"),
    ]
    if kind == "compression":
        settings += [
            *(
                f"compression.pressure={between(1e-5, 10.0)}",
                f"compression.tolerance={between(1e-7, 1e-3)}",
            ),
            f"compression.method={draw.one_of(('newton', 'relaxation'))}",
        ]
    else:
        v = between(1e-3, 10.0)
        settings.append(f"impact.velocity={v}")
    if kind == "absorbing_wall":
        reach = max(math.log(V0) - math.log(5e-6) - 2.0 * math.log(v), 0.1) / a
        settings += [
            *(
                f"wall.points={wall_points}",
                f"wall.width={width}",
                f"wall.reset_interval={between(1e-3, 1.0)}",
            ),
            f"wall.threshold={min(max(reach * rng.uniform(1.01, 4.0), 1e-3), 1e3):.4g}",
            f"wall.boundary={draw.one_of(BOUNDARIES)}",
        ]
    if kind == "exponential_wall" and eta_star == 0.0 and rng.random() < 0.3:
        settings.append("time.integrator=vefrl")
    return kind, tuple(settings)


def trial_scene(number: int) -> tuple[str, tuple[str, ...], float]:
    """Return name, settings and a tolerance of a scene whose true result can be
    computed.

    Impacts and compressions with N 30 to 400, v 2e-3 to 0.2, eta* 0 or 0.1 to 100, a 30
    to 3000, k_a 1 or 0.01 to 10, tolerances 1e-8 to 1e-3; rim and literal lattices; all
    boundaries of the elastic wall.
    """
    draw = Draw(33, number)
    rng, between = draw.rng, draw.between
    name = str(
        rng.choice(
            ["exponential_wall", "absorbing_wall", "compression"], p=[0.5, 0.35, 0.15]
        )
    )
    points = int(rng.choice(TRIAL_POINTS, p=SHARES))
    rim, spacing = draw.one_of(TRIAL_LATTICES)
    boundary = draw.one_of(BOUNDARIES)
    eta_star = 0.0 if rng.random() < 0.4 else between(0.1, 100.0)
    a, v = between(30.0, 3000.0), between(2e-3, 0.2)
    k_a = 1.0 if rng.random() < 0.7 else between(0.01, 10.0)
    settings = [
        *(f"lattice.points={points}", f"lattice.seed={rng.integers(10000)}"),
        *(
            f"lattice.rim={str(rim).lower()}",
            f"lattice.min_spacing={spacing}",
            f"material.k_a={k_a}",
        ),
        *(f"wall.a={a}", f"wall.V0={0.5 * a}"),
    ]
    tolerance = float(f"{between(1e-8, 1e-3):.2g}")
    if name == "compression":
        pressure = float(f"{k_a * between(1e-3, 3e-2):.4g}")
        settings += [
            f"material.eta_star={between(20.0, 100.0)}",
            f"compression.pressure={pressure}",
        ]
        return name, tuple(settings), tolerance
    settings += [f"material.eta_star={eta_star}", f"impact.velocity={v}"]
    if name == "absorbing_wall":
        reach = (math.log(0.5 * a) - math.log(5e-6) - 2.0 * math.log(v)) / a
        settings += [
            *(
                f"wall.points={round(1.2 * points)}",
                "wall.width=3.0",
                f"wall.boundary={boundary}",
            ),
            f"wall.threshold={max(reach * rng.uniform(1.01, 3.0), 1e-3):.4g}",
            f"wall.reset_interval={between(0.03, 0.3)}",
        ]
    return name, tuple(settings), tolerance


def hard_scene(number: int) -> tuple[str, tuple[str, ...], float]:
    """Return name and settings of an impact that needs short steps, and the strain of
    its springs at the start.

    N 25 to 100, v 0.01 to 0.2, a spin in two of three, eta* 0 or 1 to 2000; rest
    lengths that differ by up to 3 % in one of three; the elastic wall with both of its
    contacts.
    """
    draw = Draw(34, number)
    rng, between = draw.rng, draw.between
    name = draw.one_of(("exponential_wall", "absorbing_wall"))
    points, a, v = (
        draw.one_of((25, 40, 60, 100)),
        between(30.0, 1000.0),
        between(0.01, 0.2),
    )
    eta_star = 0.0 if rng.random() < 0.25 else between(1.0, 2000.0)
    spin = 0.0 if rng.random() < 0.33 else between(0.01, 0.3) * draw.one_of((-1.0, 1.0))
    settings = [
        *(
            f"lattice.points={points}",
            f"lattice.seed={rng.integers(10000)}",
            f"material.eta_star={eta_star}",
        ),
        *(
            f"wall.a={a}",
            f"wall.V0={0.5 * a}",
            f"impact.velocity={v}",
            f"impact.spin={spin}",
        ),
    ]
    if name == "absorbing_wall":
        reach = (math.log(0.5 * a) - math.log(5e-6) - 2.0 * math.log(v)) / a
        settings += [
            *(
                f"wall.points={points + 20}",
                "wall.width=3.0",
                f"wall.boundary={draw.one_of(BOUNDARIES)}",
            ),
            *(
                f"wall.threshold={max(1.5 * reach, 1e-3):.4g}",
                f"wall.reset_interval={between(0.03, 0.3)}",
            ),
            f"wall.contact={draw.one_of(('springs', 'smooth'))}",
        ]
    return name, tuple(settings), between(1e-3, 3e-2) if rng.random() < 0.33 else 0.0


def feature_scene(number: int) -> tuple[str, tuple[str, ...], float]:
    """Return name and settings of an impact with any features of bodies, throws and
    walls, and the aspect of a custom body.

    N 30 to 400 with holes and cores, angles, spins, friction 0.05 to 5, both dashpots,
    all boundaries and contacts of the elastic wall, v 5e-3 to 0.2, a 30 to 3000. The
    aspect is 0 for a disk from the settings; otherwise the body is an ellipse with this
    ratio of height to width, with unequal masses and springs (`custom_body`).
    """
    draw = Draw(35, number)
    rng, between = draw.rng, draw.between
    chance = lambda part: bool(rng.random() < part)  # noqa: E731
    rigid = chance(0.65)
    name = "exponential_wall" if rigid else "absorbing_wall"
    body = draw.one_of(("plain", "plain", "hole", "core", "custom"))
    points = max(
        int(rng.choice(TRIAL_POINTS, p=SHARES)), 100 if body in ("hole", "core") else 0
    )
    a, v = between(30.0, 3000.0), between(5e-3, 0.2)
    angle = (
        float(f"{rng.uniform(-1.3, 1.3) if rigid else rng.uniform(-0.6, 0.6):.4f}")
        if chance(0.6)
        else 0.0
    )
    spin = between(0.01, 0.3) * draw.one_of((-1.0, 1.0)) if chance(0.4) else 0.0
    settings = [
        *(
            f"lattice.points={points}",
            f"lattice.seed={rng.integers(10000)}",
            f"impact.velocity={v}",
        ),
        *(
            f"wall.a={a}",
            f"wall.V0={0.5 * a}",
            f"impact.angle={angle}",
            f"impact.spin={spin}",
        ),
        f"impact.turn={rng.uniform(-3.14, 3.14):.4f}",
    ]
    eta = 0.0 if chance(0.4) else between(0.1, 100.0)
    settings.append(
        f"material.viscosity={eta / points:.4g}"
        if chance(0.5)
        else f"material.eta_star={eta}"
    )
    axial = eta > 0.0 and chance(0.4)
    settings += ["material.dashpot=axial"] * axial
    if body == "hole":
        settings.append(f"lattice.hole={rng.uniform(0.3, 0.4):.3f}")
    if body == "core":
        settings += [
            f"lattice.core_radius={rng.uniform(0.4, 0.6):.3f}",
            f"lattice.core_stiffness={between(0.3, 4.0)}",
        ]
        settings.append(f"lattice.core_density={between(0.3, 4.0)}")
    if rigid:
        settings.append(f"wall.friction={between(0.05, 5.0) if chance(0.6) else 0.0}")
    else:
        reach = (math.log(0.5 * a) - math.log(5e-6) - 2.0 * math.log(v)) / a
        settings += [
            *(
                f"wall.points={3 * points}",
                "wall.width=8.0",
                f"wall.boundary={draw.one_of(BOUNDARIES)}",
            ),
            *(
                f"wall.threshold={max(1.5 * reach, 1e-3):.4g}",
                f"wall.reset_interval={between(0.03, 0.3)}",
            ),
            *(
                f"wall.contact={draw.one_of(('springs', 'smooth'))}",
                f"wall.k_a={between(0.5, 20.0)}",
            ),
        ]
    return (
        name,
        tuple(settings),
        float(rng.uniform(0.5, 1.0)) if body == "custom" else 0.0,
    )


def custom_body(disk: Lattice, aspect: float, seed: int) -> Lattice:
    """Return an ellipse made of a disk's lattice, with masses and springs unequal by up
    to a factor of 2."""
    rng, n = np.random.default_rng([36, seed]), disk.disk_points
    x, inside = disk.positions.copy(), (disk.bonds < n).all(axis=1)
    x[:n, 1] *= aspect
    masses, stiffness = (
        disk.masses.copy(),
        np.where(inside, rng.uniform(0.7, 1.4, len(disk.bonds)), 1.0),
    )
    masses[:n] *= rng.uniform(0.7, 1.4, n)
    masses[:n] /= masses[:n].sum()
    i, j = disk.bonds.T
    lengths = np.where(inside, np.hypot(*(x[i] - x[j]).T), disk.rest_lengths)
    return replace(
        disk, positions=x, masses=masses, stiffness=stiffness, rest_lengths=lengths
    )


class ShortOnly:
    """A kernel cache that refuses scenes with possibly more than `most_work`, springs
    times steps up to `max_time`."""

    def __init__(self, kernels: KernelCache, most_work: float) -> None:
        self.kernels, self.most_work, self.max_time = kernels, most_work, math.inf
        self.compile_seconds = 0.0

    def simulation(
        self, lattice: Any, model: Any, integrator: Any, velocities: Any, dt: float
    ) -> Simulation:
        if len(lattice.bonds) * self.max_time / dt > self.most_work:
            raise SimulationError(TOO_LONG)
        return self.kernels.simulation(lattice, model, integrator, velocities, dt)


def fate(number: int, kernels: ShortOnly) -> tuple[Verdict, str]:
    """Run a wild scene, and return how it ended, and a fault that no scene may have (""
    if there is none)."""

    def prepare() -> Scenario:
        name, settings = wild_scene(number)
        scene = load_scene(name, settings)
        scenario = scene.scenario()
        kernels.max_time = scenario.max_time
        return scenario

    verdict = judge(prepare, kernels, estimate=False)
    if verdict.text == TOO_LONG:
        return replace(verdict, end="long", text=""), ""
    if verdict.end == "stopped" and not KEY.search(verdict.text):
        return verdict, f"no remedy: {verdict.text}"
    return verdict, _fault(verdict.summary) if verdict.end == "done" else ""


def _fault(summary: dict[str, Any]) -> str:
    value, energy = (
        summary.get("restitution", summary.get("xi", math.nan)),
        summary.get("energy"),
    )
    if not math.isfinite(value):
        return f"the result is {value}"
    if energy is None:
        return ""
    if not abs(energy["closing_imbalance"]) <= MAX_IMBALANCE:
        return f"the energy imbalance is {energy['closing_imbalance']:.2g}"
    gain = max(0.0, -energy["sliding"] / energy["scale"]) + 2e-3
    if "restitution" in summary and not 0.0 < value <= math.sqrt(1.0 + gain):
        return f"e = {value}"
    return ""
