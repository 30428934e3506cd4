"""The sandbox without its window: a scene that moves, is changed by hand while it moves, and can be saved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from taichi_disk.errors import TaichiDiskError
from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import contact_point_force, impact_point_force, spectrum
from taichi_disk.model.sums import PEAK
from taichi_disk.model.world import World, signature
from taichi_disk.results import write_text
from taichi_disk.scene import SCENES, AbsorbingWallScene, CompressionScene, Scene
from taichi_disk.scenes import body_of, build
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.impact import Impact
from taichi_disk.simulate import SPRINGS_PER_LAUNCH, blown_up
from taichi_disk.time_step import choose
from taichi_disk.view.ledger import Ledger
from taichi_disk.view.pull import Pull

SPRINGS_PER_FRAME = 5_000_000  # spring evaluations between two pictures, at most: about 25 ms on one core
_WORLDS = 12  # kept at a time
_TAIL = 1000  # rows that are looked at to see whether a scene has ended or blown up


class Sandbox:
    """`ti.init` must have been called. Needs no display.

    Attributes:
        scene: as it would be saved, except for what hands do.
        speed: simulated time per second of the clock [R/c per s].
        paused: whether `advance` does nothing.
        message: what happened last, for the person at the window.
        changed: whether this is no longer what `run` computes from the saved scene.
        result: once the scene has ended, its headline.
        blown: why the state is meaningless, or None.
    """

    def __init__(self, scene: Scene) -> None:
        self.speed, self.paused, self.message = 1.0, False, ""
        self.velocity = 0.0
        self._built: Scene | None = None
        self._body: Lattice
        self._worlds: dict[tuple[Any, ...], World] = {}
        self._build(scene)
        self._start()

    # ---- starting

    def _build(self, scene: Scene) -> None:
        """Lattice and initial state of `scene`. Raises TaichiDiskError, with everything left as it was."""
        if isinstance(scene, CompressionScene) and scene.compression.method == "newton":
            # Nothing moves in time there.
            scene = _with(scene, "compression.method", "relaxation")
        same = self._built is not None and _body_keys(scene) == _body_keys(self._built)
        body: Lattice = self._body if same else body_of(scene)
        setup = build(scene, body)
        modes = spectrum(setup.lattice, replace(setup.physics, eta=setup.physics.eta or 1.0))
        step = choose(scene.time, setup.physics, modes, setup.point_force)
        self.setup, self.scene, self._built, self._body, self._modes = setup, scene, scene, body, modes
        self._first_step = step

    def _start(self) -> None:
        """To t = 0 of the setup."""
        self.velocity = self.setup.velocity if isinstance(self.setup, Impact) else 0.0
        self.step = self._first_step
        self.changed = False
        self.blown: str | None = None
        self.result: dict[str, float] | None = None
        self._pull: Pull | None = None
        self._turned: NDArray[np.float64] | None = None
        self._due = 0.0
        self.positions, self.velocities = self.setup.lattice.positions.copy(), self.setup.velocities.copy()
        self._begin(self.setup.physics, fresh=True)

    def _begin(self, physics: Physics, fresh: bool = False) -> None:
        """Go on from `positions` and `velocities` with `physics`; `fresh`: the clock begins at 0."""
        dt = self.step.dt
        lattice = replace(self.setup.lattice, positions=self.positions)
        physics = replace(physics, integrator=self.step.integrator)
        # Compiling takes seconds: a world that was made once is kept.
        key = signature(lattice, physics)
        known = self._worlds.get(key)
        if known and known.restart(lattice, physics, self.velocities[None], dt):
            self.world = known
        else:
            if known or len(self._worlds) >= _WORLDS:
                self._worlds.pop(key if known else next(iter(self._worlds))).destroy()
            self.world = self._worlds[key] = World(lattice, physics, self.velocities[None], dt)
        interval = self.scene.time.sample_interval
        stride = max(1, round((self.setup.sample_interval if interval == "auto" else interval) / dt))
        first = self.world.first_row[:, 0]
        if fresh:
            self.ledger = Ledger(first, dt, stride)
        else:
            self.ledger.new_stretch(first, dt, stride)
            self.changed = True
        self._state, self._earlier_work = self.world.export_state(), 0.0

    def restart(self) -> None:
        """To t = 0 of the present scene: from here on this is what `run` computes."""
        if self.scene != self._built:
            self._build(self.scene)
        self._start()
        self.paused, self.message = False, "restarted"

    def restart_with_smaller_step(self) -> None:
        """Half the step, from the start: the way out of a blow-up."""
        scene = _with(self.scene, "time.safety", 0.5 * self.scene.time.safety)
        self.scene = scene if scene.time.dt == "auto" else _with(scene, "time.dt", 0.5 * scene.time.dt)
        self.restart()
        self.message = f"restarted with half the step, {self.step.dt:.3g} R/c"

    # ---- time

    def advance(self, seconds: float) -> int:
        """Let `seconds` of the clock pass; returns the steps made, fewer than due where the machine is too slow."""
        if self.paused or self.blown:
            return 0
        self._due += seconds * self.speed / self.step.dt
        steps = min(int(self._due), max(1, SPRINGS_PER_FRAME // len(self.setup.lattice.bonds)))
        self._due = min(self._due - steps, 1.0)
        self._go(steps)
        return steps

    def single_step(self) -> None:
        """Pause, and make one time step."""
        self.paused = True
        if not self.blown:
            self._go(1)

    def _go(self, steps: int) -> None:
        if steps == 0:
            return
        good, known = self._state, len(self.ledger)
        self._march(steps)
        tail = self.ledger.columns(_TAIL)
        new = len(self.ledger) - known
        if problem := blown_up(tail, 1) or (None if np.isfinite(self.ledger.last).all() else "not a finite state"):
            # The picture stays that of the last good state.
            self.blown = self.message = f"{problem}. r: restart, m: restart with half the step"
            self.paused = True
            return
        if new and self.result is None and not self._pull:
            over = np.flatnonzero(self.setup.ended(tail)[-new:])
            if len(over):
                # This went past the end: go back, and stop where `run` stops.
                count = known + int(over[0]) + 1
                self.ledger.back_to(known)
                self.world.import_state(good)
                self._march((count - 1) * self.ledger.stride - good.step)
                self._end()
        self._look()

    def _march(self, steps: int) -> None:
        world, stride = self.world, self.ledger.stride
        launch = max(1, SPRINGS_PER_LAUNCH // len(self.setup.lattice.bonds))
        last = world.step_number + steps
        while world.step_number < last:
            left = last - world.step_number
            to_row = stride - world.step_number % stride
            if self._pull:
                row = self._pull.step()[0]
            elif to_row == stride and stride <= min(left, launch):
                rows = world.advance(min(left, launch) // stride, stride)[:, :, 0]
                first = world.step_number - (len(rows) - 1) * stride
                for k, row in enumerate(rows[:-1]):
                    self.ledger.add(row, first + k * stride, self._worked())
                row = rows[-1]
            else:
                row = world.advance(1, min(left, launch, to_row))[0, :, 0]
            self.ledger.add(row, world.step_number, self._worked())

    def _worked(self) -> float:
        return self._earlier_work + (self._pull.work if self._pull else 0.0)

    def _look(self) -> None:
        self._state = self.world.export_state()
        x, v, f = self._state.vectors[:3, ..., 0]
        self.positions = x
        self.velocities = v + 0.5 * self.world.dt / self.world.mass * f

    def _end(self) -> None:
        self.paused = True
        columns = self.ledger.columns()
        if isinstance(self.setup, Impact):
            e = float(columns["com_vy"][-1] / self.velocity)
            self.result, self.message = {"restitution": e}, f"the disk has left: e = {e:.6f}; r: restart, h: hit again"
        else:
            xi = self.setup.headline(columns).values["xi"]
            self.result, self.message = {"xi": xi}, f"at rest: xi = {xi:.6f} R; r: restart"

    # ---- changes by hand

    def set(self, key: str, value: Any) -> None:
        """Change one key of the scene ("material.eta_star"); at once where the lattice stays.

        A value that the scene refuses changes nothing and is explained in `message`.
        """
        try:
            scene = _with(self.scene, key, value)
        except ValidationError as error:
            self.message = "; ".join(one["msg"] for one in error.errors(include_url=False))
            return
        if scene == self.scene:
            return
        before, self.scene = self.scene, scene
        try:
            if key == "impact.velocity":
                self._set_velocity(float(value))
            elif key in ("material.eta_star", "wall.a", "wall.boundary", "compression.pressure"):
                self._set_physics()
            else:
                self.restart()
        except TaichiDiskError as error:
            self.scene, self.message = before, str(error)

    def switch(self, kind: str) -> None:
        """To another scene, with its own defaults and the present lattice."""
        if kind == self.scene.scene:
            return
        try:
            self._build(SCENES[kind](lattice=self.scene.lattice))
        except TaichiDiskError as error:
            self.message = str(error)
            return
        self._start()
        self.paused, self.message = False, f"scene: {kind}"

    def hit_again(self) -> None:
        """Send the disk back at the wall with the velocity of the scene; what shakes in it goes on shaking."""
        if not isinstance(self.scene, CompressionScene):
            self._throw(self.scene.impact.velocity)
            self.paused, self.result = False, None
            self.message = f"sent back with v = {self.velocity:g} c"

    @property
    def flying_in(self) -> bool:
        """Whether the disk has not felt the wall yet: its springs are still at rest."""
        if self.world.step_number == 0 and not self.changed:
            return True
        return isinstance(self.setup, Impact) and bool(self.ledger.now()["elastic"] <= 1e-8 * self.setup.kinetic)

    def _set_velocity(self, velocity: float) -> None:
        if self.flying_in and self.result is None:
            self._throw(velocity)
            self.message = ""
        else:
            self.message = f"v = {velocity:g} c from the next hit (h) or restart (r) on"

    def _throw(self, velocity: float) -> None:
        """Give the disk's centre of mass the velocity (0, -velocity) at once."""
        assert isinstance(self.setup, Impact) and not isinstance(self.scene, CompressionScene)
        n = self.setup.lattice.disk_points
        self.velocities = self.velocities.copy()
        self.velocities[:n] += np.array([0.0, -velocity]) - self.velocities[:n].mean(axis=0)
        self.velocity = self.setup.velocity = velocity
        self.setup.kinetic = 0.5 * velocity**2
        self._change(self.world.physics)

    def _set_physics(self) -> None:
        scene, physics = self.scene, self.world.physics
        physics = replace(physics, eta=scene.material.eta_star / scene.lattice.points, a=scene.wall.a)
        if isinstance(scene, CompressionScene) and isinstance(self.setup, Compression):
            self.setup.pressure = scene.compression.pressure
            physics = replace(physics, load=scene.compression.pressure)
        if isinstance(scene, AbsorbingWallScene) and scene.wall.boundary != physics.boundary:
            wall = build(scene, self._body).physics  # its dashpots' constants take a test of the wall's stiffness
            physics = replace(
                physics, boundary=wall.boundary, reset_interval=wall.reset_interval, impedance=wall.impedance
            )
        self._change(physics)
        self.message = ""

    def _change(self, physics: Physics) -> None:
        self.release()
        if isinstance(self.scene, CompressionScene):
            force = contact_point_force(self.setup.lattice, physics, 2.0 * physics.load)
        else:
            force = impact_point_force(self.setup.lattice, physics, self.velocity)
        peak = float(self._state.sums[PEAK].max())
        if peak > 0.0:
            # At the distance where one point took F = a V0 exp(-a l), another a may push harder.
            before = self.world.physics
            near = np.log(before.a * before.V0 / peak) / before.a
            force = max(force, float(physics.a * physics.V0 * np.exp(-physics.a * near)))
        self.step = choose(self.scene.time, physics, self._modes, force)
        self._begin(physics)

    # ---- the mouse

    def turn(self, angle: float) -> None:
        """Show the disk turned by `angle` [rad] from where it was; `release` makes it so."""
        n = self.setup.lattice.disk_points
        turned = self._state.vectors[0, :, :, 0].copy()
        lowest, centre = turned[:n, 1].min(), turned[:n].mean(axis=0)
        c, s = np.cos(angle), np.sin(angle)
        turned[:n] = centre + (turned[:n] - centre) @ np.array([[c, s], [-s, c]])
        # As high above the wall as before.
        turned[:n, 1] += lowest - turned[:n, 1].min()
        self.positions = self._turned = turned

    def grab(self, x: float, y: float) -> None:
        """Tie the disk's point nearest to (x, y) [R] to the mouse by a spring; its work enters the energy balance."""
        disk = self.positions[: self.setup.lattice.disk_points]
        point = int(np.hypot(disk[:, 0] - x, disk[:, 1] - y).argmin())
        self._pull, self.changed, self.result = Pull(self.world, point, (x, y)), True, None

    def drag(self, x: float, y: float) -> None:
        """Move the other end of the pulling spring."""
        if self._pull:
            self._pull.target = (x, y)

    def release(self) -> None:
        """Let go of the disk."""
        if self._pull:
            self._earlier_work += self._pull.work
            self._pull = None
        if self._turned is not None:
            self.positions, self._turned = self._turned, None
            self._begin(self.world.physics)

    @property
    def pulled(self) -> tuple[NDArray[np.float64], tuple[float, float]] | None:
        """The two ends of the pulling spring, or None."""
        return (self.positions[self._pull.point], self._pull.target) if self._pull else None

    # ---- out

    def saved_scene(self) -> Scene:
        """The scene with the step that is taken here, so that `run` computes the very same numbers."""
        if self.scene != self._built:
            return self.scene
        step, dt = self._first_step, self._first_step.dt
        interval = self.setup.physics.reset_interval
        if interval and interval / -int(-interval // dt) != dt:
            # A whole part of the interval, rounded down: the least bit more gives the same part again.
            dt = float(np.nextafter(dt, np.inf))
        scene, between = self.scene, self.scene.time.sample_interval
        if between != "auto" and between < dt:
            scene = _with(scene, "time.sample_interval", dt)  # a row for every step, as here
        return _with(_with(scene, "time.integrator", step.integrator), "time.dt", dt)

    def save(self, path: Path) -> None:
        """Write the scene: what is seen after a restart is what `run` computes from it."""
        write_text(path, self.saved_scene().to_yaml())
        note = "; what hands did on the way is not in it" if self.changed else ""
        self.message = f"saved {path}{note}"

    def destroy(self) -> None:
        """Free the fields; the sandbox cannot be used afterwards."""
        for world in self._worlds.values():
            world.destroy()
        self._worlds.clear()


def _body_keys(scene: Scene) -> tuple[Any, ...]:
    """All that the unloaded lattice depends on."""
    wall = (scene.wall.points, scene.wall.width) if isinstance(scene, AbsorbingWallScene) else ()
    return (scene.lattice, *wall)


def _with(scene: Scene, key: str, value: Any) -> Scene:
    """`scene` with one dotted key changed. Raises ValidationError for a value that it refuses."""
    section, name = key.split(".")
    values = scene.model_dump()
    values[section][name] = value
    return type(scene).model_validate(values)
