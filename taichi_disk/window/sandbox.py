"""The sandbox without its window: a scene that moves, is changed by hand, goes back in time, and can be saved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, inf
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk.errors import TaichiDiskError
from taichi_disk.lattice import Array
from taichi_disk.output.files import write_text
from taichi_disk.scenes import Scene
from taichi_disk.scenes.impact import ImpactScenario
from taichi_disk.simulation.observables import INDEX
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.changes import AT_ONCE, Start, continued, start_of, with_key, with_mouse
from taichi_disk.window.history import Moment, Stretch, Timeline

PATIENCE = 0.025  # time spent computing between two pictures, at most [s]
SLOW = 0.2  # part of the speed at which a contact passes in slow motion
CONTACT = 0.01  # of v sqrt(k_a) M, about the largest force of an impact, is contact
RESULTS = 5  # in the table


@dataclass(frozen=True)
class Result:
    """The primary result of a scene that came to its end.

    Attributes:
        value: restitution, or xi [R].
        scenario: its numbers.
        label: what hands have done, "" if nothing.
        start: number of the start that it counts from.
        t: the time then [R/c].
    """

    value: float
    scenario: Any
    label: str
    start: int
    t: float


class Sandbox:
    """`ti.init` must have been called. Needs no display.

    Attributes:
        scene: as it would be saved.
        start: the scene as it began.
        starts: how often this has begun.
        time: what has passed since the start, and the moment that is seen.
        speed: simulated time per second of the clock [R/c per s].
        slow: whether contacts pass in slow motion.
        paused: whether `advance` lets no time pass.
        message: what happened last, for the person at the window.
        results: of the last scenes that came to their end, the newest last.
        held: the point tied to the mouse and where the mouse is [R], or None.
    """

    scene: Scene
    start: Start
    time: Timeline
    held: tuple[int, tuple[float, float]] | None

    def __init__(
        self, scene: Scene, before_compiling: Callable[[], None] = lambda: None, kernels: KernelCache | None = None
    ) -> None:
        """Raises TaichiDiskError. `before_compiling` is called whenever the next thing takes a moment."""
        self.kernels = kernels or KernelCache(before_compiling=before_compiling)
        self.speed, self.slow, self.starts = 1.0, False, 0
        self.results: list[Result] = []
        self._begin(start_of(scene))

    # ---- the start

    def begin(self, scene: Scene | None = None) -> None:
        """To t = 0 of `scene` (default: the present one), paused: from here on this is what `run` computes.

        Raises TaichiDiskError, with everything left as it was.
        """
        self._begin(start_of(scene or self.scene, self.start))

    def _begin(self, start: Start) -> None:
        self.time = Timeline(Stretch(start.scenario, start.scene.time, self.kernels, start.spectrum))
        self.start, self.scene, self.starts = start, start.scene, self.starts + 1
        self.paused, self.message, self._due, self.held = True, "", 0.0, None

    def half_the_step(self) -> None:
        """Begin again with half the step: the way out of a blow-up. Raises TaichiDiskError."""
        time = self.scene.time
        half = {"time.safety": 0.5 * time.safety} if time.dt == "auto" else {"time.dt": 0.5 * time.dt}
        self.begin(self.scene.with_(half))
        self.message = f"half the step, {self.stretch.step.dt:.3g} R/c"

    # ---- what is known

    @property
    def stretch(self) -> Stretch:
        """The one that moves."""
        return self.time.last

    @property
    def moment(self) -> Moment:
        """What there is to see."""
        return self.time.moment

    @property
    def at_start(self) -> bool:
        """Whether nothing has moved yet, and no hand has touched the disk."""
        return len(self.time.stretches) == 1 and not self.stretch.state.step and not self.moment.by_hand

    @property
    def is_impact(self) -> bool:
        return isinstance(self.stretch.scenario, ImpactScenario)

    @property
    def imbalance(self) -> float:
        """Energy that has appeared from nowhere in this hit, over the kinetic energy, or about the load's work."""
        scenario: Any = self.stretch.scenario
        scale = scenario.kinetic if self.is_impact else scenario.pressure**2 / scenario.scene.material.k_a
        return float(sum(one.imbalance for one in self.time.of_hit(self.stretch.hit)) / scale)

    @property
    def given(self) -> float:
        """Energy that hands have given in this hit [M c^2]."""
        return sum(one.given + one.gift for one in self.time.of_hit(self.stretch.hit))

    @property
    def pace(self) -> float:
        """Simulated time per second of the clock now [R/c per s]."""
        scenario = self.stretch.scenario
        if not (self.slow and isinstance(scenario, ImpactScenario)):
            return self.speed
        force = CONTACT * scenario.velocity * scenario.scene.material.k_a**0.5
        return self.speed * (SLOW if self.stretch.row[INDEX["wall_force"]] > force else 1.0)

    # ---- time

    def advance(self, seconds: float, patience: float = PATIENCE) -> int:
        """Let `seconds` of the clock pass; returns the steps made.

        They are fewer than due where computing them takes longer than `patience` [s], and others than due while a
        stretch is made again with a shorter step.
        """
        stretch = self.stretch
        if stretch.behind > 0.0:
            return self._go(ceil(stretch.behind / stretch.step.dt), patience)
        if self.paused or stretch.status == "failed":
            return 0
        self._due += seconds * self.pace / stretch.step.dt
        made = self._go(int(self._due), patience)
        self._due = min(max(self._due - made, 0.0), 1.0)
        return made

    def _go(self, steps: int, patience: float) -> int:
        stretch = self.stretch
        before, made = stretch.status, stretch.go(steps, patience)
        if stretch.status == "restarted":
            self.message = f"computed again with a shorter step, {stretch.step.dt:.2g} R/c"
        elif stretch.status == "failed":
            self.paused, self.message = True, str(stretch.failure)
        elif stretch.status == "finished" != before:
            _, value = stretch.scenario.primary(stretch.columns)
            result = Result(value, stretch.scenario, stretch.label, self.starts, stretch.now)
            self.results = [*self.results, result][-RESULTS:]
            self.paused = True
            self.message = f"the disk has left: e = {value:.6f}" if self.is_impact else f"at rest: xi = {value:.6f} R"
        if stretch.behind == 0.0:
            self.time.look()
        return made

    def pause(self) -> None:
        """Pause, or go on from what there is to see."""
        if self.paused and self.stretch.status == "failed" and not self.time.past:
            return
        self.paused = not self.paused
        if not self.paused:
            self._settle()
            self.message = ""

    def scrub(self, t: float) -> None:
        """Show the state that is remembered nearest to the time `t` [R/c], and pause."""
        if self._hold_still():
            self.time.look_at(t)

    def step(self, count: int) -> None:
        """Show the state `count` places later, or earlier if negative, and pause; beyond the last, time goes on."""
        if self._hold_still() and not self.time.look_beside(count):
            stretch = self.stretch
            self._go(stretch.spacing - stretch.simulation.step_number % stretch.spacing, inf)

    def _hold_still(self) -> bool:
        self.let_go()
        if self.stretch.behind > 0.0:
            return False
        self.paused, self._due = True, 0.0
        return True

    def _settle(self) -> None:
        """Make the moment that is seen the present one: what came after it is forgotten."""
        moment = self.moment
        if not self.time.past:
            return
        self.results = [one for one in self.results if one.start != self.starts or one.t <= moment.t]
        if self.time.cut():
            scene = moment.stretch.scenario.scene
            self.scene = replace(scene, video=self.scene.video)
        else:
            self._carry_on(self.scene, moment.x, moment.v, "by hand")

    # ---- changes by hand

    def set(self, key: str, value: Any) -> None:
        """Change one key of the scene ("material.eta_star"); at once where the lattice stays.

        A value that the scene refuses changes nothing and is explained in `message`.
        """
        try:
            scene = with_key(self.scene, key, value)
            if scene == self.scene:
                return
            if key.startswith("video."):
                self.scene = scene
            elif self.at_start or key not in (*AT_ONCE, "impact.velocity"):
                self.begin(scene)
            elif key == "impact.velocity":
                self.scene = scene
                self.message = "the velocity counts from the next hit (h) or start (r) on"
            else:
                self._change(key, value)
        except TaichiDiskError as error:
            self.message = str(error)

    def _change(self, key: str, value: Any) -> None:
        self.let_go()
        self._settle()
        now = self.stretch.present
        self._carry_on(with_key(self.scene, key, value), now.x, now.v, "by hand")
        lift = float(self.moment.x[0, 1] - now.x[0, 1])
        self.message = f"moved by {lift:+.3f} R, to where this wall pushes as the other did" if lift else ""

    def hit_again(self) -> None:
        """Send the disk at the wall with the velocity of the scene; what shakes in it goes on shaking.

        Raises TaichiDiskError, with everything left as it was.
        """
        if not self.is_impact:
            return
        if not self.at_start:
            wanted: Any = self.scene
            self.let_go()
            self._settle()
            now, velocity = self.stretch.present, wanted.impact.velocity
            flying = now.v[: self.start.body.disk_points]
            flying += (0.0, -velocity) - flying.mean(axis=0)
            self._carry_on(wanted, now.x, now.v, "hit again", self.stretch.hit + 1)
            self.message = f"sent back with v = {velocity:g} c"
        self.paused = False

    def _carry_on(self, scene: Scene, x: Array, v: Array, label: str, hit: int = 0) -> None:
        """Begin another stretch. Raises TaichiDiskError, with everything left as it was."""
        last, start = self.stretch, self.start
        # After a blow-up a step by hand would be refused for the force that it has led to.
        peak = 0.0 if last.status == "failed" else last.simulation.peak_point_force(last.state)
        scenario = continued(scene, start.body, last.scenario, x, v, peak)
        hit, began = hit or last.hit, last.now
        new = Stretch(scenario, scene.time, self.kernels, start.spectrum, began=began, hit=hit, label=label)
        new.gift = _mechanical(new.row) - _mechanical(last.row)
        if not last.state.step and len(self.time.stretches) > 1:
            new.gift += last.gift + last.given  # nothing has passed: this is one change, not two
            self.time.stretches.pop()
        if last.status in ("failed", "finished"):  # any change gives a new life
            self.paused = False
        self.scene, self._due, self.held = scene, 0.0, None
        self.time.append(new)

    # ---- the mouse

    def turn(self, angle: float, for_good: bool = True) -> None:
        """At the start of an impact, turn the disk by `angle` [rad] from where the scene has it: `impact.turn` changes.

        Else it is only shown so.
        """
        scene: Any = self.scene
        if not (self.at_start and self.is_impact):
            return
        turn = np.angle(np.exp(1j * (scene.impact.turn + angle)))
        scene = scene.with_({"impact.turn": float(f"{turn:.4f}")})
        if for_good:
            self.begin(scene)
        else:
            self.time.moment = replace(self.moment, x=with_mouse(scene, self.start.body).lattice.positions)

    def pull(self, x: float, y: float) -> None:
        """Tie the disk's point nearest to (x, y) [R] to the mouse there, or lead the one that is tied.

        A state that is past becomes the present.
        """
        self._settle()
        stretch = self.stretch
        if stretch.status == "failed" or stretch.behind > 0.0:
            return
        disk = stretch.present.x[: self.start.body.disk_points]
        point = self.held[0] if self.held else int(np.hypot(disk[:, 0] - x, disk[:, 1] - y).argmin())
        self.held = point, (x, y)
        stretch.pull(*self.held)

    def let_go(self) -> None:
        """Untie the point, if one is tied: from here on the scene can end again."""
        if self.held:
            self.held, stretch = None, self.stretch
            if stretch.status != "failed":
                stretch.pull(-1, (0.0, 0.0))
                self._carry_on(self.scene, stretch.present.x, stretch.present.v, "by hand")

    # ---- out

    def save(self, path: Path) -> None:
        """Write the scene: `run` computes from it, bit for bit, what is seen after a start. Raises SimulationError."""
        write_text(path, self.scene.to_yaml())
        self.message = f"saved {path}{'; what hands did on the way is not in it' if self.moment.by_hand else ''}"


def _mechanical(row: Array) -> float:
    """Kinetic and potential energy [M c^2] of a row of observables."""
    return float(row[[INDEX[name] for name in ("kinetic", "elastic", "wall", "load")]].sum())
