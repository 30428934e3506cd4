"""`time.tolerance` put to the test: is the true error within it, and what does that cost beside a step by hand?

    python -m taichi_disk.study.tolerance_trial [--first 0] [--scenes 100] [--out out/tolerance]

It may be stopped and started again: judgements.jsonl in its folder holds what is done, and the report is on all of it.
Scenes are drawn by number: `trial_scene`. The truth is that of `taichi_disk.study.truth`; where contacts jump or the
wall is hard it is computed at two tolerances of its own, and if these differ by more than a tenth of the tolerance
asked for, the scene has no truth to be held against. Work is counted in force evaluations of all runs together, a step
with implicit dashpots as 2.8. The best step by hand is the cheapest, over the integrators and a grid of steps 10 %
apart from 0.95 of the stability limit down, from which on all shorter ones tried keep the tolerance: nobody knows it
without knowing the truth.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from taichi_disk.dynamics import first_step, move
from taichi_disk.errors import SimulationError
from taichi_disk.model import runtime
from taichi_disk.model.chebyshev import SMALL_FACTOR_COST
from taichi_disk.model.integrators import SPLITTINGS
from taichi_disk.model.physics import Integrator
from taichi_disk.model.stability import Spectrum, spectrum, step_limit
from taichi_disk.model.world import World, features
from taichi_disk.outcome import Outcome
from taichi_disk.progress import QuietProgress
from taichi_disk.results import write_text
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import build
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.impact import Impact
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import make_world, simulate
from taichi_disk.study.truth import Solver, at_rest
from taichi_disk.time_step import TimeStep, fitted

POINTS, SHARES = (30, 60, 100, 200, 400), (0.35, 0.35, 0.2, 0.07, 0.03)
# rim, min_spacing; the default one more often
LATTICES = ((True, 0.7), (True, 0.7), (True, 0.7), (True, 0.4), (True, 0.4), (False, 0.7), (False, 0.0))
BOUNDARIES = ("reset", "pinned", "dashpot")
GRID = 0.9  # of one step by hand to the next
MOST_WORLDS = 60  # before Taichi is started afresh: it never gives all back


def trial_scene(number: int) -> tuple[str, tuple[str, ...]]:
    """Name and settings of scene `number`, its tolerance among them.

    Impacts and compressions with N 30 to 400, v 2e-3 to 0.2, eta* 0 or 0.1 to 100, a 30 to 3000, k_a 1 or 0.01
    to 10, tolerances 1e-8 to 1e-3; rim and literal lattices; all boundaries of the elastic wall.
    """
    rng = np.random.default_rng([33, number])

    def between(low: float, high: float) -> float:
        return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.4g}")

    name = str(rng.choice(["exponential_wall", "absorbing_wall", "compression"], p=[0.5, 0.35, 0.15]))
    points = int(rng.choice(POINTS, p=SHARES))
    rim, spacing = LATTICES[rng.integers(len(LATTICES))]
    boundary = BOUNDARIES[rng.integers(len(BOUNDARIES))]
    eta_star = 0.0 if rng.random() < 0.4 else between(0.1, 100.0)
    a, v = between(30.0, 3000.0), between(2e-3, 0.2)
    k_a = 1.0 if rng.random() < 0.7 else between(0.01, 10.0)
    settings = [
        *(f"lattice.points={points}", f"lattice.seed={rng.integers(10000)}"),
        *(f"lattice.rim={str(rim).lower()}", f"lattice.min_spacing={spacing}", f"material.k_a={k_a}"),
        *(f"wall.a={a}", f"wall.V0={0.5 * a}", f"time.tolerance={between(1e-8, 1e-3):.2g}"),
    ]
    if name == "compression":
        pressure = float(f"{k_a * between(1e-3, 3e-2):.4g}")
        return name, (*settings, f"material.eta_star={between(20.0, 100.0)}", f"compression.pressure={pressure}")
    settings += [f"material.eta_star={eta_star}", f"impact.velocity={v}"]
    if name == "absorbing_wall":
        reach = (math.log(0.5 * a) - math.log(5e-6) - 2.0 * math.log(v)) / a
        settings += [
            *(f"wall.points={round(1.2 * points)}", "wall.width=3.0", f"wall.boundary={boundary}"),
            f"wall.threshold={max(reach * rng.uniform(1.01, 3.0), 1e-3):.4g}",
            f"wall.reset_interval={between(0.03, 0.3)}",
        ]
    return name, tuple(settings)


@dataclass(frozen=True)
class Judgement:
    """What became of scene `number`. Errors are of e or of xi [R], work is in force evaluations.

    `end`: kept or broken; told: the run said that it could not show it; ended: the scene has no result at any step;
    untold: there is no truth to the tolerance.
    `crossed`: parts of the wall's decay length that the automatic step crosses, a v h.
    """

    number: int
    end: Literal["kept", "broken", "told", "ended", "untold"]
    scene: str
    tolerance: float
    text: str = ""
    crossed: float = 0.0
    error: float = math.nan
    estimate: float = math.nan
    doubt: float = 0.0
    attempts: int = 0
    work: float = math.nan
    by_hand: float = math.nan

    @property
    def ratio(self) -> float:
        return self.work / self.by_hand


class Trials:
    """Judges scenes one after the other, keeping compiled worlds."""

    def __init__(self) -> None:
        self._worlds: dict[object, World] = {}
        self._running: tuple[World, Integrator] | None = None
        self._work = 0.0
        runtime.start("cpu", threads=1)

    def judge(self, number: int) -> Judgement:
        if len(self._worlds) >= MOST_WORLDS:
            self._worlds.clear()
            runtime.start("cpu", threads=1)
        name, settings = trial_scene(number)
        scene = load_scene(name, settings)
        assert scene.time.tolerance != "none"
        text = " ".join((name, *settings))
        setup = build(scene)
        modes = spectrum(setup.lattice, setup.physics)
        first = first_step(setup, scene.time, modes)
        crossed = (
            setup.physics.a * setup.velocity * scene.time.safety * first.limit if isinstance(setup, Impact) else 0.0
        )
        judgement = Judgement(number, "kept", text, scene.time.tolerance, crossed=crossed)
        try:
            outcome = self._counted(setup, modes)
        except SimulationError as error:
            end: Literal["told", "ended"] = "told" if "time.tolerance" in str(error) else "ended"
            return replace(judgement, end=end, text=f"{text}: {error}", work=self._work)
        _, found = setup.main_number(outcome.columns)
        judgement = replace(
            judgement,
            estimate=next(iter(outcome.facts["error_estimate"].values())),
            attempts=outcome.facts["attempts"],
            work=self._work,
        )
        truth, doubt = true_number(setup, outcome, scene.time.tolerance)
        kept = abs(found - truth) <= scene.time.tolerance
        judgement = replace(judgement, end="kept" if kept else "broken", error=abs(found - truth), doubt=doubt)
        if doubt > 0.1 * scene.time.tolerance:
            return replace(judgement, end="untold")
        finish = float(outcome.columns["t"][-1])
        best = self._best_by_hand(setup, modes, first, finish, truth, scene.time.tolerance)
        return replace(judgement, by_hand=best)

    def _counted(self, setup: Setup, modes: Spectrum) -> Outcome:
        """The scene run as `run` does; `_work` is that of all its runs."""
        self._work, self._running = 0.0, None
        try:
            return move(setup, setup.scene.time, modes, QuietProgress(), self._make)
        finally:
            self._count()

    def _make(self, setup: Setup, step: TimeStep, earlier: World | None) -> World:
        self._count()
        world = self._world(setup, step)
        self._running = world, step.integrator
        return world

    def _count(self) -> None:
        if self._running is not None:
            world, integrator = self._running
            self._work += world.step_number * cost(integrator)

    def _world(self, setup: Setup, step: TimeStep) -> World:
        key = features(replace(setup.physics, integrator=step.integrator))
        self._worlds[key] = make_world(setup, step, self._worlds.get(key))
        return self._worlds[key]

    def _best_by_hand(
        self, setup: Setup, modes: Spectrum, first: TimeStep, end: float, truth: float, tolerance: float
    ) -> float:
        """Work of the best step by hand to time `end` [R/c]; infinite where none keeps the tolerance."""
        integrators: list[Integrator] = ["velocity_verlet", "trapezoidal" if setup.physics.dissipates else "vefrl"]
        if setup.physics.damped and not setup.physics.dissipates:
            integrators.remove("vefrl")
        integrators.sort(key=lambda one: one != first.integrator)
        best = math.inf
        for integrator in integrators:
            limit = step_limit(modes, replace(setup.physics, integrator=integrator), setup.point_force)
            step = TimeStep(integrator, limit, 0.95 * limit)
            if end / step.dt * cost(integrator) < best:
                best = min(best, self._first_to_keep(setup, step, truth, tolerance, best))
        return best

    def _first_to_keep(self, setup: Setup, step: TimeStep, truth: float, tolerance: float, most: float) -> float:
        """Work at the first step of the grid from which on three in a row keep the tolerance."""
        kept: list[float] = []
        while len(kept) < 3:
            taken = replace(step, dt=fitted(step.dt, setup.physics.reset_interval))
            shorter = GRID
            try:
                run = simulate(setup, self._world(setup, taken), taken, setup.sample_interval, QuietProgress())
            except SimulationError:
                kept = []
            else:
                work, error = run.end.step * cost(step.integrator), abs(setup.main_number(run.columns)[1] - truth)
                kept = [*kept, work] if error <= tolerance else []
                if (kept or [work])[0] > most:
                    return math.inf
                if error > 4.0 * tolerance:  # far off: no need of a fine grid
                    shorter = max(1.0 / 3.0, (2.0 * tolerance / error) ** (1.0 / SPLITTINGS[step.integrator].order))
            step = replace(step, dt=min(shorter * step.dt, (1.0 - 1e-6) * taken.dt))
        return kept[0]


def cost(integrator: Integrator) -> float:
    """Of a step, in force evaluations."""
    return SMALL_FACTOR_COST if integrator == "trapezoidal" else float(SPLITTINGS[integrator].forces)


def true_number(setup: Setup, outcome: Outcome, tolerance: float) -> tuple[float, float]:
    """e or xi [R], and how far it is in doubt itself."""
    if isinstance(setup, Compression):
        y = at_rest(setup.lattice, setup.physics, outcome.positions)[:, 1]
        return setup.unloaded - float(y.mean() - y.min()), 0.0
    assert isinstance(setup, Impact)
    # On until the wall's potential has fallen by e^3: the run ends where it is small, not where it is zero.
    t, v = outcome.columns["t"][-1], outcome.columns["com_vy"][-1]
    end = float(t + min(3.0 / (setup.physics.a * v), 0.3 * t))
    rtol, disk = max(1e-12, 1e-4 * tolerance), setup.lattice.disk_points

    def solved(rtol: float) -> float:
        found = Solver(setup.lattice, setup.physics).solve(setup.velocities, end, rtol)
        return float(found[1, :disk, 1].mean()) / setup.velocity

    tight = solved(rtol)
    rough = setup.physics.wall == "elastic" or setup.physics.a * setup.velocity * outcome.facts["dt"] > 0.3
    return tight, abs(tight - solved(10.0 * rtol)) if rough else 0.0


def report(judgements: Iterable[Judgement]) -> Iterator[str]:
    """The figures in Markdown, then every scene that was not kept."""
    from scipy.stats import beta

    found = list(judgements)
    judged = [one for one in found if one.end in ("kept", "broken")]
    kept = sum(one.end == "kept" for one in judged)
    low = float(beta.ppf(0.025, kept, len(judged) - kept + 1)) if kept else 0.0
    high = float(beta.ppf(0.975, kept + 1, len(judged) - kept)) if kept < len(judged) else 1.0
    yield (
        f"{len(found)} scenes, {len(judged)} judged: the tolerance is kept in {kept} ({kept / len(judged):.1%}; "
        f"95 % interval {low:.1%} to {high:.1%}, Clopper and Pearson)."
    )
    for name, part in (
        ("all", judged),
        ("a v h <= 1", [one for one in judged if one.crossed <= 1.0]),
        ("a v h > 1", [one for one in judged if one.crossed > 1.0]),
    ):
        ratios = np.array([one.ratio for one in part if math.isfinite(one.by_hand)])
        if len(ratios):
            middle, most, worst = np.quantile(ratios, [0.5, 0.9, 0.95])
            yield (
                f"* work over that of the best step by hand, {name} ({len(ratios)}): median {middle:.2f}, "
                f"90 % {most:.2f}, 95 % {worst:.2f}; at most 3 in {np.mean(ratios <= 3.0):.0%}"
            )
    larger = np.array([one.estimate / max(one.error, 1e-15) for one in judged])
    yield f"* estimate over true error: median {np.median(larger):.1f}, least {larger.min():.2f}"
    for end in ("broken", "told", "ended", "untold"):
        for one in found:
            if one.end == end:
                yield (
                    f"* {end}: {one.number}: error {one.error:.2g}, estimate {one.estimate:.2g}, "
                    f"doubt {one.doubt:.1g}, a v h = {one.crossed:.1f}: {one.text or one.scene}"
                )


def main() -> None:
    parser = argparse.ArgumentParser(description="time.tolerance against the truth and the best step by hand")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--out", type=Path, default=Path("out/tolerance"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / "judgements.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    found = {one.number: one for one in (Judgement(**json.loads(line)) for line in lines)}
    trials = Trials()
    for number in range(arguments.first, arguments.first + arguments.scenes):
        if number not in found:
            found[number] = trials.judge(number)
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(found[number])) + "\n")
    text = "\n".join(report(found[number] for number in sorted(found)))
    write_text(arguments.out / "tolerance.md", text + "\n")
    print(text)


if __name__ == "__main__":
    main()
