"""A state that goes on in time, from one change by hand to the next, with a step that its energy ledger bears out."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from taichi_disk.diagnosis import Diagnosis
from taichi_disk.dynamics import ATTEMPTS, CLOSING, MARGIN, WORST
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import step_limit
from taichi_disk.model.sums import PEAK
from taichi_disk.scene import TimeSection
from taichi_disk.scenes.impact import Impact
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import blown_up
from taichi_disk.time_step import choose
from taichi_disk.view.ledger import Ledger
from taichi_disk.view.stage import Stage
from taichi_disk.view.worlds import Worlds

_SPRINGS_PER_LAUNCH = 1_000_000  # spring evaluations between two looks at the clock: some 5 ms on one core
STIFFNESS = 0.2  # of the mouse's spring, in k_a
STRONGEST = 0.02  # its largest pull, in k_a R: more would turn triangles of a fine lattice inside out
_TAIL = 1000  # rows that are looked at to see whether a scene has ended or blown up


class Motion:
    """Begins at t = 0 of `stage`.

    A stretch is the time between two changes. As in `run`, a stretch whose energy ledger stays open, or in which a
    point met a harder wall than was reckoned with, is made again with a shorter step, if the step is automatic.

    Attributes:
        setup: of the stage, until a change by hand.
        positions, velocities: (n, 2) now [R], [c].
        step: that of this stretch.
        unloaded: from the disk's lowest point up to its centre of mass, before it touched the wall [R].
        behind: how far this is behind the moment that was seen already [R/c].
        pull: the point tied to the mouse and where the mouse is, or None.
        changed: whether this is no longer what `run` computes from the scene.
        ended: whether the scene has come to its end.
        blown: why the state is meaningless, or None.
        note: what happened last that a person should know.
    """

    def __init__(self, stage: Stage, worlds: Worlds) -> None:
        self.stage, self.setup, self._worlds = stage, stage.setup, worlds
        self.step = stage.step
        self.positions, self.velocities = self.setup.lattice.positions.copy(), self.setup.velocities.copy()
        self.behind, self.changed, self.ended, self.note = 0.0, False, False, ""
        self.pull: tuple[int, tuple[float, float]] | None = None
        self.blown: str | None = None
        self._stubborn = False
        self._begin(self.setup.physics)
        self.unloaded = self._height()
        self.ledger = Ledger(self.world.first_row[:, 0], self.step.dt, self._stride())
        self._new_trials(stage.scene.time, self.setup.point_force)

    def change(
        self,
        physics: Physics,
        time: TimeSection,
        point_force: float,
        setup: Setup,
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64],
    ) -> None:
        """Go on with these, in a step for `point_force`, the largest force of the wall on one point [M c^2/R].

        Raises InputError for a step given by hand that is too long now, with everything left as it was.
        """
        self.step = choose(time, physics, self.stage.modes, point_force)
        flying_in = self.flying_in
        self.setup, self.positions, self.velocities = setup, positions, velocities
        if flying_in:  # it may have been turned
            self.unloaded = self._height()
        self.pull, self.changed, self.ended = None, True, False
        self._begin(physics)
        self.ledger.new_stretch(self.world.first_row[:, 0], self.step.dt, self._stride())
        self._new_trials(time, point_force)

    def _begin(self, physics: Physics) -> None:
        lattice = replace(self.setup.lattice, positions=self.positions)
        physics = replace(physics, integrator=self.step.integrator, pulled=True)
        self._origin = self.positions, self.velocities
        self.world = self._worlds.start(lattice, physics, self.velocities, self.step.dt)
        self.state, self._touched = self.world.export_state(), False

    def _height(self) -> float:
        y = self.positions[: self.setup.lattice.disk_points, 1]
        return float(y.mean() - y.min())

    def _stride(self) -> int:
        return max(1, round(self.setup.row_interval / self.step.dt))

    @property
    def scale(self) -> float:
        """What the energy imbalance is measured against [M c^2]."""
        if isinstance(self.setup, Impact):
            return self.setup.kinetic
        # The work of the load on its way to rest is about P xi, and xi about P/k_a.
        return float(self.world.physics.load**2 / self.world.physics.k_a)

    @property
    def flying_in(self) -> bool:
        """Whether the disk has not felt the wall yet: its springs are still at rest."""
        if self.world.step_number == 0 and not self.changed:
            return True
        return isinstance(self.setup, Impact) and bool(self.ledger.now()["elastic"] <= 1e-8 * self.setup.kinetic)

    # ---- time

    def go(self, steps: int, patience: float) -> int:
        """Make `steps` steps, fewer where computing them takes longer than `patience` [s]; returns how many."""
        if steps <= 0 or self.blown:
            return 0
        good, known = self.state, len(self.ledger)
        made = self._march(steps, perf_counter() + patience)
        self.behind = max(0.0, self.behind - made * self.step.dt)
        tail = self.ledger.columns(_TAIL)
        new = len(self.ledger) - known
        lattice, physics = self.world.lattice, self.world.physics
        lost = blown_up(lattice, physics, tail, 1, self.world.positions()[0] if physics.wall == "elastic" else None)
        if lost is None and not np.isfinite(self.ledger.last).all():
            lost = Diagnosis("not a finite state", "")
        if lost is not None:
            again = not (lost.stubborn and self._stubborn) and self._try_shorter(float(good.sums[PEAK].max()), 4.0)
            self._stubborn = lost.stubborn
            if not again:
                self.blown = lost.cause  # the picture stays that of the last good state
            return made
        over = new > 0 and not (self.ended or self.pull) and bool((ended := self.setup.ended(tail)[-new:]).any())
        if over:
            # This went past the end: go back, and stop where `run` stops.
            count = known + int(ended.argmax()) + 1
            self.ledger.back_to(known)
            self.world.import_state(good)
            self._march((count - 1) * self.ledger.stride - good.step)
        self._look()
        self._judge(over)
        return made

    def _march(self, steps: int, until: float = np.inf) -> int:
        world, stride = self.world, self.ledger.stride
        launch = max(1, _SPRINGS_PER_LAUNCH // (len(self.setup.lattice.bonds) * world.splitting.forces))
        first = world.step_number
        last = first + steps
        while world.step_number < last and (world.step_number == first or perf_counter() < until):
            left = last - world.step_number
            to_row = stride - world.step_number % stride
            if to_row == stride and stride <= min(left, launch):
                rows = world.advance(min(left, launch) // stride, stride)[:, :, 0]
                number = world.step_number - (len(rows) - 1) * stride
                for k, row in enumerate(rows[:-1]):
                    self.ledger.add(row, number + k * stride)
                row = rows[-1]
            else:
                row = world.advance(1, min(left, launch, to_row))[0, :, 0]
            self.ledger.add(row, world.step_number)
        return world.step_number - first

    def _look(self) -> None:
        self.state = self.world.export_state()
        x, v, f = self.state.vectors[:3, ..., 0]
        self.positions = x
        self.velocities = v + self.world.splitting.kicks[-1] * self.world.dt / self.world.mass * f

    # ---- the mouse

    def tie(self, point: int, x: float, y: float) -> None:
        """Tie a point to the mouse at (x, y) [R] by a spring, or lead it there; what that gives is noted."""
        self.pull, self.changed, self.ended, self._touched = (point, (x, y)), True, False, True
        k_a = self.world.physics.k_a
        self.ledger.pulled(self.world.take_hold(point, (x, y), STIFFNESS * k_a, STRONGEST * k_a))
        self._look()  # the next kick is another one now

    def let_go(self) -> None:
        """Untie the point, if one is tied."""
        if self.pull:
            self.pull = None
            self.ledger.pulled(self.world.take_hold(-1, (0.0, 0.0), 0.0, 0.0))
            self._look()

    # ---- the step on trial

    def _new_trials(self, time: TimeSection, point_force: float) -> None:
        self._time, self._force = time, point_force
        self._attempts = 1 if time.dt == "auto" else ATTEMPTS
        self._tried: tuple[float, float] | None = None  # when the last trial failed, and by how much
        self._stands = False
        self._stubborn = False  # the last trial blew up from what a shorter step seldom mends
        self._closing = np.inf  # excess at the end, in the trial before

    def _judge(self, over: bool) -> None:
        """End the scene if it is `over`, or go back to the start of the stretch if a shorter step does better."""
        peak = float(self.state.sums[PEAK].max())
        if peak > self._force:
            limit = step_limit(self.stage.modes, self.world.physics, peak)
            if self.step.dt > max(MARGIN, self._time.safety) * limit and self._try_shorter(peak, 0.0):
                return
        worst = self.ledger.worst() / (WORST * self.scale)
        if worst > 1.0 and not self._stands:
            if self._tried and self.ledger.worst(self._tried[0]) > 0.5 * self._tried[1]:
                # It is not the step that is at fault, or not in the middle of the contact.
                self._stands = True
            elif self._try_shorter(peak, worst):
                return
        if over:
            # Only closing can be compared with closing: during the contact the energy also swings with the step.
            closing = abs(self.ledger.stretch_imbalance()) / (CLOSING * self.scale)
            if 1.0 < closing <= 0.5 * self._closing:
                self._closing = closing
                if self._try_shorter(peak, closing):
                    return
            self.ended = True

    def _try_shorter(self, peak: float, excess: float) -> bool:
        """Make the stretch again with a shorter step, if that is allowed; `excess` 0: only the wall was too hard."""
        if self._attempts == ATTEMPTS or self._touched:
            return False
        self._attempts += 1
        if excess:
            self._tried = self.ledger.stretch_time, self.ledger.worst()
            # Order 2. Of the step taken, which a reset boundary may have made shorter than the one asked for.
            factor = min(0.5, 0.9 / float(np.sqrt(excess))) * self.step.dt / self.step.limit
            self._time = self._time.model_copy(update={"safety": factor})
        else:
            self._force = 1.5 * peak
        self.behind += self.ledger.stretch_time
        physics = self.world.physics
        self.step = choose(self._time, physics, self.stage.modes, max(self._force, peak))
        if not self.changed:
            self.stage = replace(self.stage, step=self.step)
        self.positions, self.velocities = self._origin
        self._begin(physics)
        self.ledger.again(self.world.first_row[:, 0], self.step.dt, self._stride())
        self.note = f"made again with a shorter step, {self.step.dt:.2g} R/c, to keep the energy balance"
        return True
