"""Worlds that were compiled once and are kept, because compiling takes seconds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.model.world import World, features

_KEPT = 12  # at a time


class Worlds:
    """One world for each set of features; it grows with the largest lattice."""

    def __init__(self, before_compiling: Callable[[], None]) -> None:
        """`before_compiling` is called before the caller has to wait."""
        self._known: dict[tuple[Any, ...], World] = {}
        self._before_compiling = before_compiling

    def start(self, lattice: Lattice, physics: Physics, velocities: NDArray[np.float64], dt: float) -> World:
        """A world at t = 0 of these; one that was given before may become it."""
        key = features(physics)
        known = self._known.pop(key, None)
        if known is None or not known.restart(lattice, physics, velocities[None], dt):
            self._before_compiling()
            if known is None and len(self._known) >= _KEPT:
                known = self._known.pop(next(iter(self._known)))
            if known is not None:
                known.destroy()
            known = World(lattice, physics, velocities[None], dt)
            known.advance(0)  # compiles the step, too
        self._known[key] = known  # the last one used stands last
        return known

    def destroy(self) -> None:
        """Free all fields; the worlds cannot be used afterwards."""
        for world in self._known.values():
            world.destroy()
        self._known.clear()
