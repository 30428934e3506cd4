"""What each key does. The panel's buttons press keys, so that there is one way to do a thing."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from taichi_disk.errors import TaichiDiskError
from taichi_disk.render.colouring import COLOURINGS
from taichi_disk.scene import CompressionScene
from taichi_disk.view.controls import BOUNDARIES, LEAST_LOG_ETA, MOST_LOG_ETA, SHOWS, Controls


class Keys:
    """Keys by the name that the panel shows; each acts on `controls`.

    GGUI hears letters, arrows, space and Escape, but no digits and no signs.
    """

    def __init__(self, controls: Controls) -> None:
        self._controls = controls

    def buttons(self) -> Iterator[tuple[str, str]]:
        """(key, what it does now) of what the panel has a button for."""
        c = self._controls
        sandbox = c.sandbox
        yield "space", "go on" if sandbox.paused else "pause"
        yield "s", "single step"
        yield "r", "restart"
        if sandbox.motion.blown:
            yield "m", "restart with half the step"
        if not isinstance(sandbox.scene, CompressionScene):
            yield "h", "hit again"
        yield "w", "write the scene"
        yield "v", "stop recording" if c.recording else "record a film"
        yield "p", "picture"
        yield "l", f"another lattice than {c.seed}"
        if c.boundary_number is not None:
            yield "b", f"boundary: {BOUNDARIES[c.boundary_number]}"
        yield "x", f"draw: {SHOWS[c.show_number]}"
        yield "q", "close the window"

    def press(self, key: str) -> None:
        """Do what a key stands for; an unknown one does nothing. What fails is told in the sandbox's message."""
        action = self._actions().get(key)
        if action is None:
            return
        try:
            action()
        except TaichiDiskError as error:
            self._controls.sandbox.message = str(error)

    def _actions(self) -> dict[str, Callable[[], None]]:
        c, sandbox = self._controls, self._controls.sandbox
        low, high = c.push_range
        return {
            "space": c.pause,
            "s": sandbox.single_step,
            "r": sandbox.restart,
            "m": sandbox.restart_with_smaller_step,
            "h": sandbox.hit_again,
            "w": lambda: sandbox.save(c.next_file(".yaml")),
            "v": c.record,
            "p": c.want_picture,
            "q": c.close,
            "l": c.another_lattice,
            "n": lambda: c.change_points(more=True),
            "k": lambda: c.change_points(more=False),
            "t": lambda: c.set_scene_number(0),
            "y": lambda: c.set_scene_number(1),
            "u": lambda: c.set_scene_number(2),
            "b": c.next_boundary,
            "c": lambda: c.set_colouring_number((c.colouring_number + 1) % len(COLOURINGS)),
            "x": lambda: c.set_show_number((c.show_number + 1) % len(SHOWS)),
            "e": lambda: c.set_log_eta(_moved(max(c.log_eta, LEAST_LOG_ETA + 0.05), 0.1, LEAST_LOG_ETA, MOST_LOG_ETA)),
            "d": lambda: c.set_log_eta(c.log_eta - 0.1),
            "Up": lambda: c.set_log_push(_moved(c.log_push, 0.05, low, high)),
            "Down": lambda: c.set_log_push(_moved(c.log_push, -0.05, low, high)),
            "a": lambda: c.set_log_hardness(_moved(c.log_hardness, 0.1, 1.0, 4.0)),
            "z": lambda: c.set_log_hardness(_moved(c.log_hardness, -0.1, 1.0, 4.0)),
            "Left": lambda: c.set_log_speed(c.log_speed - 0.1),
            "Right": lambda: c.set_log_speed(c.log_speed + 0.1),
            "Escape": c.mouse.release,
        }


def _moved(value: float, by: float, low: float, high: float) -> float:
    """`value` moved, not beyond the range; from outside it no farther out, and never the other way."""
    return min(value + by, max(high, value)) if by > 0.0 else max(value + by, min(low, value))
