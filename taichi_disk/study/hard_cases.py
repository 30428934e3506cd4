"""Hard cases: scenes at and beyond the edge of what the model can hold, and what the program should do with each.

Each ends in one of three ways: done, with an energy ledger that closes; stopped, with the reason and a remedy named;
refused before anything is computed. The tests hold every case to that; `stability_page` makes a table of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from taichi_disk.dynamics import OPEN, move
from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice import Lattice, bond_lengths
from taichi_disk.model.stability import spectrum
from taichi_disk.outcome import Outcome
from taichi_disk.progress import QuietProgress
from taichi_disk.quasistatic import press
from taichi_disk.scene import Scene
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import body_of, build
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import BlowUp, make_world
from taichi_disk.triangulation import triangulate

End = Literal["done", "stopped", "refused"]


@dataclass(frozen=True)
class Verdict:
    """How a case ended: `text` is the error's message or the warnings, `facts` the summary's with the headline."""

    end: End
    text: str
    facts: dict[str, Any] = field(default_factory=dict)
    last_good: dict[str, Any] = field(default_factory=dict)

    @property
    def measured(self) -> str:
        """For the table."""
        if self.end != "done":
            return re.sub(r"\s+", " ", self.text)
        facts = self.facts
        headline = "e" if "restitution" in facts else "xi"
        text = f"{headline} = {facts['restitution' if headline == 'e' else 'xi']:.4f}"
        if "energy" in facts:
            energy = facts["energy"]
            text += (
                f", imbalance {energy['closing_imbalance']:+.0e} at the end, {energy['worst_imbalance']:.0e} at worst"
            )
            if energy["sliding"]:
                text += f", lost by sliding {energy['sliding'] / energy['scale']:+.0e}"
            text += f"; {facts['steps']:,} steps, {facts['attempts']} attempts"
        return text + (f"; warning: {self.text}" if self.text else "")


@dataclass(frozen=True)
class Case:
    """A scene with `settings`, perhaps another `body` or a changed start, and how it should end.

    `tells`: a regular expression that the message, or the warnings, must contain; none where there must be none. (Where
    it says that the ledger is open, the ledger may be.)
    `quick`: whether the default tests run it; `single`: `end` and `tells` in single precision, where they are others.
    """

    name: str
    scene: str
    settings: tuple[str, ...]
    end: End = "done"
    tells: str = ""
    force: bool = False
    body: Callable[[Scene], Lattice] = body_of
    start: Callable[[Setup], None] | None = None
    quick: bool = False
    single: tuple[End, str] | None = None

    def in_single_precision(self) -> Case:
        end, tells = self.single or (self.end, self.tells)
        return replace(self, settings=(*self.settings, "time.precision=f32"), end=end, tells=tells)

    def failings(self, verdict: Verdict) -> list[str]:
        """What is not as it should be; empty where all is."""
        found = []
        if verdict.end != self.end:
            found.append(f"{verdict.end}, not {self.end}: {verdict.text}")
        if bool(self.tells) != bool(verdict.text) or not re.search(self.tells, verdict.text, re.DOTALL):
            found.append(f"told {verdict.text!r}, not {self.tells!r}")
        energy = verdict.facts.get("energy")
        if energy and "ledger" not in self.tells and not energy["worst_imbalance"] <= OPEN:
            found.append(f"the ledger is off by {energy['worst_imbalance']:.1e}")
        if verdict.last_good and not all(np.isfinite(values).all() for values in verdict.last_good.values()):
            found.append("the last good state is not finite")
        return found


def compute(
    scene: Scene,
    force: bool = False,
    body: Callable[[Scene], Lattice] = body_of,
    start: Callable[[Setup], None] | None = None,
    make: Callable[..., Any] = make_world,
) -> Outcome:
    """As `runner.run` does, without files; Taichi must have been started in the scene's precision."""
    setup = build(scene, body(scene))
    if isinstance(setup, Compression) and setup.scene.compression.method == "newton":
        outcome = press(setup)
    else:
        if start is not None:
            start(setup)
        modes = spectrum(setup.lattice, setup.physics)
        outcome = move(setup, scene.time, modes, QuietProgress(), make, force)
    return replace(outcome, facts=outcome.facts | setup.headline(outcome.columns).values)


def judge(case: Case) -> Verdict:
    try:
        scene = load_scene(case.scene, case.settings)
        facts = compute(scene, case.force, case.body, case.start).facts
    except InputError as error:
        return Verdict("refused", str(error))
    except BlowUp as error:
        return Verdict("stopped", str(error), last_good=error.last_good)
    except SimulationError as error:
        return Verdict("stopped", str(error))
    return Verdict("done", "; ".join(facts.get("warnings", ())), facts)


def _twins(scene: Scene) -> Lattice:
    """The scene's disk with one point moved to 1e-6 R from another."""
    disk = body_of(scene)
    x = disk.positions.copy()
    inside = np.setdiff1d(np.arange(len(x)), disk.disk_surface)
    i, j = inside[0], inside[1]
    x[j] = x[i] + [6e-7, 8e-7]
    mesh = triangulate(x)
    return replace(
        disk,
        positions=mesh.positions,
        bonds=mesh.bonds,
        rest_lengths=bond_lengths(mesh.positions, mesh.bonds),
        disk_surface=mesh.outline,
    )


def _shifted(x: float) -> Callable[[Setup], None]:
    def shift(setup: Setup) -> None:
        positions = setup.lattice.positions.copy()
        positions[: setup.lattice.disk_points, 0] += x
        setup.lattice = replace(setup.lattice, positions=positions)

    return shift


def _above_a_wall_point(setup: Setup) -> None:
    lattice = setup.lattice
    lowest = lattice.disk_surface[lattice.positions[lattice.disk_surface, 1].argmin()]
    middle = lattice.wall_surface[len(lattice.wall_surface) // 2]
    _shifted(float(lattice.positions[middle, 0] - lattice.positions[lowest, 0]))(setup)
    assert setup.lattice.positions[lowest, 0] == lattice.positions[middle, 0]


_RIGID, _ELASTIC, _PRESSED = "exponential_wall", "absorbing_wall", "compression"
_SMALL = ("lattice.points=150",)
_FREE = (*_SMALL, "material.eta_star=0")
_LITERAL = ("lattice.rim=false", "lattice.min_spacing=0")
_BED = (*_SMALL, "wall.points=180", "wall.width=3.4")
_COARSE: tuple[End, str] = ("refused", "comes to rest to 0.0001[05]? at best: write compression.tolerance: 0.0001[05]")

CASES = (
    Case("η* = 1000", _RIGID, (*_SMALL, "material.eta_star=1e3")),
    Case("η* = 10⁴", _RIGID, (*_SMALL, "material.eta_star=1e4")),
    Case(
        "η* = 10⁴, explicit dashpots",
        _RIGID,
        ("lattice.points=60", "material.eta_star=1e4", "time.integrator=velocity_verlet"),
    ),
    Case("η* = 10⁴, pressed", _PRESSED, (*_SMALL, "material.eta_star=1e4"), single=_COARSE),
    Case(
        "the same, N = 60: hardly rolls",
        _PRESSED,
        ("lattice.points=60", "material.eta_star=1e4"),
        "stopped",
        "not at rest.*newton.*hardly roll",
        single=_COARSE,
    ),
    Case(
        "k_a = 1/1099 at v = 0.05: triangles turn over",
        _RIGID,
        ("material.k_a=9.1e-4", "impact.velocity=0.05", "material.eta_star=0"),
    ),
    Case("the same, η* = 10", _RIGID, ("material.k_a=9.1e-4", "impact.velocity=0.05")),
    Case("v = 0.5", _RIGID, (*_FREE, "impact.velocity=0.5")),
    Case("v = 5", _RIGID, (*_FREE, "impact.velocity=5")),
    Case("a = 30/R", _RIGID, (*_FREE, "wall.a=30")),
    Case("a = 3000/R", _RIGID, (*_FREE, "wall.a=3000")),
    Case("a = 30000/R", _RIGID, (*_FREE, "wall.a=3e4")),
    Case("a = 10⁶/R", _RIGID, (*_FREE, "wall.a=1e6")),
    Case(
        "a = 80000/R at v = 1",
        _RIGID,
        (*("lattice.points=7", "material.eta_star=0", "material.k_a=2e-3"), "wall.a=8e4", "impact.velocity=1.0"),
        single=("stopped", "ledger is off.*time.precision: f64"),
    ),
    Case("N = 3, all on one point", _RIGID, ("lattice.points=3", "material.eta_star=0"), quick=True),
    Case("N = 7", _RIGID, ("lattice.points=7",)),
    Case("N = 50", _RIGID, ("lattice.points=50",)),
    Case("N = 3, pressed", _PRESSED, ("lattice.points=3", "compression.method=newton")),
    Case("P = 10: pressed flat", _PRESSED, ("lattice.points=60", "compression.pressure=10"), single=_COARSE),
    Case("a spring of 10⁻⁶ R", _RIGID, _FREE, body=_twins),
    Case("a spring of 10⁻⁶ R, η* = 100", _RIGID, (*_SMALL, "material.eta_star=100"), body=_twins),
    *(
        Case(f"literal lattice {seed}, hull of slivers", _RIGID, (*_FREE, *_LITERAL, f"lattice.seed={seed}"))
        for seed in range(4)
    ),
    *(
        Case(
            f"literal disk and wall {seed}, v = 0.1",
            _ELASTIC,
            (*_BED, *_LITERAL, "wall.boundary=pinned", "impact.velocity=0.1", f"lattice.seed={seed}"),
        )
        for seed in range(4)
    ),
    Case("exactly above a point of the wall", _ELASTIC, _BED, start=_above_a_wall_point),
    Case(
        "half over the wall's end",
        _ELASTIC,
        _BED,
        start=_shifted(1.7),
        end="stopped",
        tells="from beside it.*wall.width|slipped off",
    ),
    Case(
        "past the wall's end",
        _ELASTIC,
        _BED,
        start=_shifted(3.0),
        end="stopped",
        tells="slipped off the end.*wall.width",
    ),
    Case(
        "elastic wall at v = 0.3: dented steeply",
        _ELASTIC,
        (*_BED, "impact.velocity=0.3"),
        "stopped",
        "step [0-9,]+, .*slid from.*lower impact.velocity",
        quick=True,
    ),
    Case(
        "elastic wall, dented: points slide",
        _ELASTIC,
        (
            *("lattice.points=50", "lattice.seed=19", "lattice.min_spacing=0.4", "material.k_a=0.01593"),
            *("wall.points=60", "wall.width=2.14", "wall.boundary=pinned", "impact.velocity=0.043"),
            *("wall.a=71.18", "wall.V0=7.479e5", "wall.threshold=0.562"),
        ),
        tells="slid from spring to spring.*lower impact.velocity",
    ),
    Case(
        "elastic wall at v = 2: gone through",
        _ELASTIC,
        (*_BED, "impact.velocity=2"),
        "stopped",
        "gone through|slid from",
    ),
    Case(
        "elastic wall at v = 10: gone through",
        _ELASTIC,
        (*_BED, "impact.velocity=10"),
        "stopped",
        "gone through|slid from",
    ),
    Case(
        "elastic wall, k_a = 10⁻³",
        _ELASTIC,
        (*_BED, "material.k_a=1e-3", "impact.velocity=0.05"),
        "stopped",
        "gone through",
    ),
    Case(
        "dt by hand, beyond the limit",
        _RIGID,
        ("lattice.points=80", "material.eta_star=0", "time.dt=0.1"),
        "refused",
        "stability limit",
        quick=True,
    ),
    Case(
        "dt by hand, beyond the limit, forced",
        _RIGID,
        ("lattice.points=80", "material.eta_star=0", "time.dt=0.1"),
        "stopped",
        "step [0-9,]+, .*beyond the stability limit.*time.dt: auto",
        force=True,
    ),
    Case(
        "dt by hand, stable by the estimated force of the wall only",
        _RIGID,
        ("lattice.points=3", "material.eta_star=0", "time.dt=0.38"),
        tells="0.38 R/c is beyond the stability limit that the measured.*ledger is off by .*time.dt: auto",
        quick=True,
    ),
    Case(
        "explicit dashpots, forced to ten times the limit",
        _RIGID,
        ("lattice.points=80", "material.eta_star=100", "time.integrator=velocity_verlet", "time.dt=0.01"),
        "stopped",
        "beyond the stability limit",
        force=True,
    ),
    Case(
        "dt by hand, crushed",
        _RIGID,
        (
            "lattice.points=80",
            "material.eta_star=0",
            "time.dt=0.018",
            "impact.velocity=5",
            "wall.a=30",
            "material.k_a=0.01",
        ),
        "stopped",
        "crushed.*time.dt: auto",
        quick=True,
    ),
)
