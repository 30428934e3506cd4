"""Hard cases: scenes at and beyond the limits of the model, and how each should end.

Each ends in one of three ways: done, with a closed energy balance; stopped, with a
reason and a remedy; refused before anything is computed. The tests check every case.

    python -m tests.validation.hard_cases [--out docs/data]     writes hard_cases.csv,
    the table of docs/stability.md
"""

import argparse
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk.base import runtime
from taichi_disk.base.errors import InputError, SimulationError
from taichi_disk.base.files import write_csv
from taichi_disk.experiments.computation.diagnostics import MAX_IMBALANCE
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.scenes import Scene, load_scene
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.lattice.lattice import triangulate


@dataclass(frozen=True)
class Verdict:
    """How a scene ended: done, stopped, refused or long. `text`: the error message or
    the warnings; `summary`: that of the outcome, with the result."""

    end: str
    text: str
    summary: dict[str, Any] = field(default_factory=dict)


def judge(prepare, **options):
    """Compute a scene as `run` does."""
    try:
        scenario = prepare()
        outcome = compute(scenario, **options)
    except InputError as error:
        return Verdict("refused", str(error))
    except SimulationError as error:
        return Verdict("stopped", str(error))
    summary = outcome.summary | scenario.result(outcome.series)
    return Verdict("done", "; ".join(summary["warnings"]), summary)


@dataclass(frozen=True)
class Case:
    """A scene with `settings`, perhaps another body or start, and how it should end.

    `tells`: regular expression that the message or the warnings must contain; if empty,
    there must be none. If it mentions an imbalance, the balance need not close. `e`:
    the true restitution, if the error estimate is to hold it.
    """

    name: str
    scene: str
    settings: str
    end: str = "done"
    tells: str = ""
    force: bool = False
    e: float = 0.0
    body: Callable[[Scene], Lattice] | None = None
    start: Callable[[Scenario], Scenario] | None = None

    def judge(self):
        return judge(self.scenario, force=self.force)

    def scenario(self):
        scene = load_scene(self.scene, self.settings.split())
        scenario = scene.scenario(self.body(scene) if self.body else None)
        return self.start(scenario) if self.start else scenario

    def failings(self, verdict):
        """Return the deviations from the expected end."""
        found = []
        if verdict.end != self.end:
            found.append(f"{verdict.end}, not {self.end}: {verdict.text}")
        is_told = re.search(self.tells, verdict.text, re.DOTALL)
        if bool(self.tells) != bool(verdict.text) or not is_told:
            found.append(f"the message {verdict.text!r} does not match {self.tells!r}")
        energy = verdict.summary.get("energy")
        if energy and "imbalance" not in self.tells:
            worst = energy["worst_imbalance"]
            if not worst <= MAX_IMBALANCE:
                found.append(f"the energy imbalance is {worst:.1e}")
        if self.e:
            off = abs(verdict.summary["restitution"] - self.e)
            if off > verdict.summary["error_estimate"]["restitution"]:
                found.append(f"e is off by {off:.1e}")
        return found


def _moved(scene):
    """Return the scene's disk, a copy of its positions, and its inner points."""
    disk = scene.body()
    inside = np.setdiff1d(np.arange(len(disk.positions)), disk.disk_surface)
    return disk, disk.positions.copy(), inside


def _twins(scene):
    """Return the scene's disk with one point moved to 1e-6 R from another."""
    _, x, inside = _moved(scene)
    x[inside[1]] = x[inside[0]] + [6e-7, 8e-7]
    return triangulate(x)


def _beside_a_spring(scene):
    """Return the scene's disk with one inner point moved to 1e-12 R beside the middle
    of a spring, which makes a flat triangle."""
    disk, x, inside = _moved(scene)
    # a triangle of inner points, of which the first comes to lie beside the others
    is_inner = np.isin(disk.triangles, inside).all(axis=1)
    point, one, other = disk.triangles[is_inner][0]
    side = x[other] - x[one]
    across = np.array([-side[1], side[0]]) / np.hypot(*side)
    x[point] = 0.5 * (x[one] + x[other]) + 1e-12 * across
    return Lattice.from_points(x, triangles=disk.triangles)


def _light_point(scene):
    """Return the scene's disk with one inner point of 1e-8 times the others' mass."""
    disk, x, inside = _moved(scene)
    masses = np.ones(len(x))
    masses[inside[0]] = 1e-8
    return Lattice.from_points(x, triangles=disk.triangles, masses=masses)


def _stiff_springs(scene):
    """Return the scene's disk with springs 1e6 times as stiff at one point."""
    disk, x, inside = _moved(scene)
    stiffness = np.where((disk.bonds == inside[0]).any(axis=1), 1e6, 1.0)
    own = {"triangles": disk.triangles, "stiffness": stiffness}
    return Lattice.from_points(x, disk.bonds, **own)


def _placed(scenario, change):
    """Return the scenario with `change` (n, 2) added to the positions of its disk."""
    lattice = scenario.lattice
    positions = lattice.positions.copy()
    positions[: lattice.disk_points] += change(lattice)
    return replace(scenario, lattice=replace(lattice, positions=positions))


def _turned(scenario):
    """Return a scenario with its disk turned by 1e-10 rad."""

    def turn(lattice):
        x = lattice.positions[: lattice.disk_points]
        arm = x - lattice.mean(lattice.positions)
        return 1e-10 * np.stack([-arm[:, 1], arm[:, 0]], axis=1)

    return _placed(scenario, turn)


def _shifted(x):
    return partial(_placed, change=lambda lattice: [x, 0.0])


def _above_a_wall_point(scenario):
    lattice = scenario.lattice
    lowest = lattice.disk_surface[lattice.positions[lattice.disk_surface, 1].argmin()]
    middle = lattice.wall_surface[len(lattice.wall_surface) // 2]
    distance = float(lattice.positions[middle, 0] - lattice.positions[lowest, 0])
    shifted = _shifted(distance)(scenario)
    assert shifted.lattice.positions[lowest, 0] == lattice.positions[middle, 0]
    return shifted


RIGID = "exponential_wall"
ELASTIC = "absorbing_wall"
PRESSED = "compression"
SMALL = "lattice.points=150 "
UNDAMPED = "material.eta_star=0 "
FREE = SMALL + UNDAMPED
EIGHTY = "lattice.points=80 " + UNDAMPED
LITERAL = "lattice.rim=false lattice.min_spacing=0 "
BED = SMALL + "wall.points=180 wall.width=3.4 "
LITERAL_BED = BED + LITERAL + "wall.boundary=pinned impact.velocity=0.1 "
SOFT = "material.k_a=9.1e-4 impact.velocity=0.05 "
FLAT = "lattice.points=7 material.k_a=2e-3 wall.a=8e4 impact.velocity=1 " + UNDAMPED
SIXTY = "lattice.points=60 "
STRONG = "material.eta_star=1e4 "
DAMPED = "material.eta_star=100 "
EXPLICIT = "time.integrator=velocity_verlet "
SLIDING = (
    "lattice.points=50 lattice.seed=19 lattice.min_spacing=0.4 material.k_a=0.01593"
    " wall.points=60 wall.width=2.14 wall.boundary=pinned impact.velocity=0.043"
    " wall.a=71.18 wall.V0=7.479e5 wall.threshold=0.562"
)
CRUSHED = "time.dt=0.018 impact.velocity=5 wall.a=30 material.k_a=0.01 "
WITHIN = " time.tolerance=1e-3"
RING = "lattice.hole=0.8 wall.a=3000 wall.V0=1500 impact.velocity=0.1 "
CHAOTIC = (
    "lattice.points=40 lattice.seed=805583 impact.velocity=0.15 wall.a=3000"
    " wall.V0=1500 material.eta_star=0 impact.spin=0.08932 wall.width=3.572"
    " wall.points=87 wall.boundary=reset wall.contact=smooth wall.k_a=0.2635"
    " wall.reset_interval=0.009079 wall.threshold=0.1 impact.offset=0.01591"
)
HARD_RESET = (
    "lattice.points=73 lattice.seed=339945 material.eta_star=0 impact.velocity=0.05853"
    " impact.offset=0.0017 wall.a=2041 wall.V0=1020.5 wall.points=160 wall.k_a=0.4533"
    " wall.width=3.6 wall.threshold=0.1 wall.reset_interval=0.02479"
)
AGREEING = (
    "lattice.points=71 lattice.seed=643705 material.eta_star=0 impact.velocity=0.05058"
    " impact.offset=0.0367 wall.a=3951 wall.V0=1975.5 wall.points=156 wall.k_a=0.3062"
    " wall.width=3.6 wall.threshold=0.1 wall.reset_interval=0.009533"
)
FOLDING = (
    "lattice.points=334 lattice.seed=14881 material.eta_star=5"
    " impact.velocity=0.3044474127306886 impact.spin=0.9483723865185107"
    " wall.a=250.27979947521234 wall.V0=125.13989973760617"
)
FAST_SPIN = (
    "lattice.points=44 lattice.seed=878246 lattice.rim=false"
    " lattice.min_spacing=0.05575 material.eta_star=5.217 material.k_b=0.3314"
    " impact.velocity=0.005342 impact.spin=0.2141 wall.a=3772 wall.V0=1886"
)

INSIDE_OUT = "turned inside out"
UNCERTAIN = "estimated error of restitution.*time.tolerance"
DENTED = (
    "dented the wall, gone through it or slipped off its end.*lower"
    " impact.velocity.*wall.width"
)
OFF_THE_END = "slipped off the end.*wall.width"
SLIDES = "slid from spring to spring.*lower impact.velocity"
HARDLY_ROLLS = "not at rest.*newton.*hardly roll"
BEYOND = "energy balance.*beyond the stability limit.*time.dt: auto"
HARDER = (
    "0.38 R/c is beyond the stability limit with the measured.*energy imbalance"
    " .*time.dt: auto"
)
LIMIT = "beyond the stability limit: set time.dt: auto"
GROWS = (
    r"after 9 runs, .* is chaotic\. A change of the start changes e by \de\+07 times"
)
inverts = partial(Case, tells=INSIDE_OUT)
stops = partial(Case, end="stopped")

CASES = (
    Case("η* = 10⁴", RIGID, SMALL + STRONG),
    Case("η* = 10⁴, explicit dashpots", RIGID, SIXTY + STRONG + EXPLICIT),
    Case("η* = 10⁴, pressed", PRESSED, SMALL + STRONG),
    stops(
        "the same, N = 60: hardly rolls", PRESSED, SIXTY + STRONG, tells=HARDLY_ROLLS
    ),
    inverts("k_a = 1/1099 at v = 0.05", RIGID, SOFT + UNDAMPED),
    inverts("the same, η* = 10", RIGID, SOFT),
    inverts("v = 0.5", RIGID, FREE + "impact.velocity=0.5"),
    inverts("v = 5", RIGID, FREE + "impact.velocity=5"),
    Case("a = 3000/R", RIGID, FREE + "wall.a=3000"),
    Case("a = 30000/R", RIGID, FREE + "wall.a=3e4"),
    Case("a = 10⁶/R", RIGID, FREE + "wall.a=1e6"),
    inverts("a = 80000/R at v = 1", RIGID, FLAT),
    Case("N = 3, all on one point", RIGID, "lattice.points=3 " + UNDAMPED),
    Case("N = 7", RIGID, "lattice.points=7"),
    Case("N = 3, pressed", PRESSED, "lattice.points=3 compression.method=newton"),
    inverts("P = 10: pressed flat", PRESSED, SIXTY + "compression.pressure=10"),
    inverts("a spring of 10⁻⁶ R", RIGID, FREE, body=_twins),
    inverts("a spring of 10⁻⁶ R, η* = 100", RIGID, SMALL + DAMPED, body=_twins),
    inverts("a flat triangle, 10⁻¹² R high", RIGID, FREE, body=_beside_a_spring),
    Case("a point of 10⁻⁸ times the mass", RIGID, FREE, body=_light_point),
    Case("springs of 10⁶ times the stiffness", RIGID, FREE, body=_stiff_springs),
    Case("V0 = 10⁻⁹", RIGID, FREE + "wall.V0=1e-9"),
    inverts("a ring that touches many times", RIGID, RING + UNDAMPED),
    Case("chaotic impact", ELASTIC, CHAOTIC, tells=UNCERTAIN),
    Case("the same, turned by 10⁻¹⁰", ELASTIC, CHAOTIC, tells=UNCERTAIN, start=_turned),
    stops("the same, with a tolerance", ELASTIC, CHAOTIC + WITHIN, tells=GROWS),
    Case("hard wall with resets", ELASTIC, HARD_RESET, tells=UNCERTAIN),
    Case(  # by DOP853; the first two runs agree within 8e-4
        "two steps agree by chance, with a tolerance",
        ELASTIC,
        AGREEING + WITHIN,
        e=0.908046,
    ),
    inverts("folds after the greatest compression", RIGID, FOLDING),
    Case("fast spin on a slow flight", RIGID, FAST_SPIN, tells="dashpots took.*axial"),
    Case(
        "literal lattice 0, hull of slivers", RIGID, FREE + LITERAL + "lattice.seed=0"
    ),
    inverts(
        "literal lattice 1, hull of slivers", RIGID, FREE + LITERAL + "lattice.seed=1"
    ),
    *(
        inverts(
            f"literal disk and wall {seed}, v = 0.1",
            ELASTIC,
            f"{LITERAL_BED}lattice.seed={seed}",
        )
        for seed in range(4)
    ),
    Case("exactly above a point of the wall", ELASTIC, BED, start=_above_a_wall_point),
    stops("half over the wall's end", ELASTIC, BED, tells=DENTED, start=_shifted(1.7)),
    stops("past the wall's end", ELASTIC, BED, tells=OFF_THE_END, start=_shifted(3.0)),
    stops(
        "elastic wall at v = 0.3: dented",
        ELASTIC,
        BED + "impact.velocity=0.3",
        tells=DENTED,
    ),
    Case("elastic wall, dented: points slide", ELASTIC, SLIDING, tells=SLIDES),
    stops(
        "elastic wall at v = 2: gone through",
        ELASTIC,
        BED + "impact.velocity=2",
        tells=DENTED,
    ),
    stops(
        "elastic wall, k_a = 10⁻³",
        ELASTIC,
        BED + "material.k_a=1e-3 impact.velocity=0.05",
        tells=DENTED,
    ),
    Case(
        "user's dt, beyond the limit",
        RIGID,
        EIGHTY + "time.dt=0.2",
        "refused",
        "stability limit",
    ),
    stops(
        "user's dt, beyond the limit, forced",
        RIGID,
        EIGHTY + "time.dt=0.2",
        tells=BEYOND,
        force=True,
    ),
    Case(
        "user's dt, stable by the estimated force of the wall only",
        RIGID,
        f"lattice.points=3 {UNDAMPED}time.dt=0.38 {EXPLICIT}",
        tells=HARDER,
    ),
    stops(
        "explicit dashpots, forced to ten times the limit",
        RIGID,
        f"lattice.points=80 {DAMPED}time.dt=0.01 {EXPLICIT}",
        tells=BEYOND,
        force=True,
    ),
    stops("user's dt, crushed", RIGID, EIGHTY + EXPLICIT + CRUSHED, tells=LIMIT),
)


def row(case):
    """Return a row of the table: the case, and what the program does."""
    verdict = case.judge()
    summary = verdict.summary
    energy = verdict.summary.get("energy", {})
    name = "restitution" if "restitution" in summary else "xi"
    entries = {
        "case": case.name,
        "scene": case.scene,
        "settings": (
            " ".join(case.settings.split()) + (" --force" if case.force else "")
        ),
        "end": verdict.end,
        "result": summary.get(name),
        "error_estimate": summary.get("error_estimate", {}).get(name),
        "closing_imbalance": energy.get("closing_imbalance"),
        "worst_imbalance": energy.get("worst_imbalance"),
        "sliding": (
            energy["sliding"] / energy["scale"] if energy.get("sliding") else None
        ),
        "steps": summary.get("steps"),
        "attempts": summary.get("attempts"),
        "message": re.sub(r"\s+", " ", verdict.text),
        "not_as_it_should_be": "; ".join(case.failings(verdict)),
    }
    return {
        key: f"{value:.6g}" if isinstance(value, float) else value
        for key, value in entries.items()
    }


def main():
    parser = argparse.ArgumentParser(
        description="Run every hard case and write the table about them."
    )
    parser.add_argument("--out", type=Path, default=Path("docs/data"))
    given = parser.parse_args()
    runtime.start(threads=1)
    write_csv(given.out / "hard_cases.csv", [row(case) for case in CASES])


if __name__ == "__main__":
    main()
