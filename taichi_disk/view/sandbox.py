"""The sandbox without its window: a scene that moves, is changed by hand while it moves, and can be saved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from taichi_disk.errors import TaichiDiskError
from taichi_disk.results import write_text
from taichi_disk.scene import SCENES, CompressionScene, Scene
from taichi_disk.scenes.impact import Impact
from taichi_disk.view.changes import AT_ONCE, throw, turn_knobs
from taichi_disk.view.motion import Motion
from taichi_disk.view.stage import as_run, set_up, with_key
from taichi_disk.view.worlds import Worlds

PATIENCE = 0.025  # time spent computing between two pictures, at most [s]


class Sandbox:
    """`ti.init` must have been called. Needs no display.

    Attributes:
        scene: as it would be saved, except for what hands do.
        motion: the state that goes on in time.
        speed: simulated time per second of the clock [R/c per s].
        paused: whether `advance` lets no time pass.
        message: what happened last, for the person at the window.
        result: once the scene has ended, its headline.
    """

    def __init__(self, scene: Scene, before_compiling: Callable[[], None] = lambda: None) -> None:
        """Raises TaichiDiskError. `before_compiling` is called whenever the next thing takes a moment."""
        self.worlds = Worlds(before_compiling)
        self.speed = 1.0
        self._start(Motion(set_up(scene), self.worlds), "")

    def _start(self, motion: Motion, message: str) -> None:
        self.motion, self.scene, self.message = motion, motion.stage.scene, message
        self.paused = False
        self.result: dict[str, float] | None = None
        self._due = 0.0

    def restart(self) -> None:
        """To t = 0 of the present scene: from here on this is what `run` computes. Raises TaichiDiskError."""
        stage = self.motion.stage
        if self.scene != stage.scene:
            stage = set_up(self.scene, stage)
        self._start(Motion(stage, self.worlds), "restarted")

    def restart_with_smaller_step(self) -> None:
        """Half the step, from the start: the way out of a blow-up."""
        scene = with_key(self.scene, "time.safety", 0.5 * self.scene.time.safety)
        self.scene = scene if scene.time.dt == "auto" else with_key(scene, "time.dt", 0.5 * scene.time.dt)
        self.restart()
        self.message = f"restarted with half the step, {self.motion.step.dt:.3g} R/c"

    def switch(self, kind: str) -> None:
        """To another scene with its own defaults, a wall as deep as by default, the present lattice and look."""
        if kind == self.scene.scene:
            return
        lattice = self.scene.lattice
        try:
            scene = with_key(SCENES[kind](video=self.scene.video), "lattice.points", lattice.points)
            stage = set_up(scene.model_copy(update={"lattice": lattice}), self.motion.stage)
        except (TaichiDiskError, ValidationError) as error:
            self.message = _said(error)
            return
        self._start(Motion(stage, self.worlds), f"scene: {kind}")

    # ---- time

    def advance(self, seconds: float, patience: float = PATIENCE) -> int:
        """Let `seconds` of the clock pass; returns the steps made.

        They are fewer than due where computing them takes longer than `patience` [s], and others than due while a
        stretch is made again with a shorter step.
        """
        motion = self.motion
        if motion.behind > 0.0:
            made = motion.go(int(motion.behind / motion.step.dt) + 1, patience)
        elif self.paused:
            return 0
        else:
            self._due += seconds * self.speed / motion.step.dt
            made = motion.go(int(self._due), patience)
            self._due = min(self._due - made, 1.0)
        self._tell()
        return made

    def single_step(self) -> None:
        """Pause, and make one time step."""
        self.paused = True
        self.motion.go(1, np.inf)
        self._tell()

    def _tell(self) -> None:
        motion = self.motion
        if motion.note:
            self.message, motion.note, self._due = motion.note, "", 0.0
        if motion.blown:
            self.message, self.paused = f"{motion.blown}. r: restart, m: restart with half the step", True
        elif motion.ended and self.result is None:
            self.paused = True
            columns = motion.ledger.columns()
            if isinstance(motion.setup, Impact):
                e = float(columns["com_vy"][-1] / motion.setup.velocity)
                self.result = {"restitution": e}
                self.message = f"the disk has left: e = {e:.6f}; r: restart, h: hit again"
            else:
                xi = motion.setup.headline(columns).values["xi"]
                self.result, self.message = {"xi": xi}, f"at rest: xi = {xi:.6f} R; r: restart"

    # ---- changes by hand

    def set(self, key: str, value: Any) -> None:
        """Change one key of the scene ("material.eta_star"); at once where the lattice stays.

        A value that the scene refuses changes nothing and is explained in `message`.
        """
        before = self.scene
        try:
            self.scene = with_key(before, key, value)
            if self.scene == before:
                return
            if key.startswith("video."):
                stage = self.motion.stage
                self.motion.stage = replace(stage, scene=with_key(stage.scene, key, value))
            elif key == "impact.velocity":
                self._set_velocity()
            elif key in AT_ONCE:
                self.message, self.result = turn_knobs(self.motion, self.scene), None
            else:
                self.restart()
        except (TaichiDiskError, ValidationError) as error:
            self.scene, self.message = before, _said(error)

    def hit_again(self) -> None:
        """Send the disk back at the wall with the velocity of the scene; what shakes in it goes on shaking."""
        if isinstance(self.scene, CompressionScene):
            return
        throw(self.motion, self.scene)
        self.paused, self.result = False, None
        self.message = f"sent back with v = {self.scene.impact.velocity:g} c"

    def _set_velocity(self) -> None:
        if self.motion.flying_in and self.result is None:
            throw(self.motion, self.scene)
            self.message = ""
        else:
            self.message = "the velocity counts from the next hit (h) or restart (r) on"

    # ---- out

    def saved_scene(self) -> Scene:
        """The scene with the step that is taken here, so that `run` computes the very same numbers."""
        return as_run(self.motion.stage, self.scene)

    def save(self, path: Path) -> None:
        """Write the scene: what is seen after a restart is what `run` computes from it."""
        write_text(path, self.saved_scene().to_yaml())
        note = "; what hands did on the way is not in it" if self.motion.changed else ""
        self.message = f"saved {path}{note}"

    def destroy(self) -> None:
        """Free the fields; the sandbox cannot be used afterwards."""
        self.worlds.destroy()


def _said(error: TaichiDiskError | ValidationError) -> str:
    if isinstance(error, ValidationError):
        return "; ".join(one["msg"] for one in error.errors(include_url=False))
    return str(error)
