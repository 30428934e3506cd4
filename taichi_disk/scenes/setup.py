"""What scenes of one lattice share, and a process remembers: it takes longer to find than a run on it."""

from __future__ import annotations

from collections.abc import Hashable
from functools import cached_property
from operator import attrgetter
from typing import Any

from taichi_disk.lattice import file_digest
from taichi_disk.scenes import Scene
from taichi_disk.signals import interruptible

KEPT_POINTS = 100_000  # of all lattices that are remembered


class LatticeSetup:
    """The unloaded lattice `body` of a scene, with what follows from it."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self.body = scene, interruptible(scene.body)
        self._modes: dict[tuple[bool, float], Any] = {}

    @cached_property
    def moduli(self) -> dict[str, float]:
        """`young` E [M c^2/R^2] and `poisson` nu of its material; empty for a lattice from a file."""
        if self._scene.lattice.file != "none":
            return {}
        found = self._scene.moduli(self._scene.lattice.points)
        return {"young": found.young, "poisson": found.poisson}

    def modes(self, model: Any) -> Any:
        """Its spectrum, with the dashpots of `model` if there are any."""
        from taichi_disk.computation.stability import spectrum

        key = model.springs.damped, model.springs.k_b  # which stiffens springs that are strained at rest
        if key not in self._modes:
            self._modes[key] = spectrum(self.body, model)
        return self._modes[key]


_SETUPS: dict[Hashable, LatticeSetup] = {}  # the one that was used last stands last


def setup_of(scene: Scene) -> LatticeSetup:
    """The setup of the scene's lattice. Raises TaichiDiskError if there is no such lattice."""
    key = lattice_key(scene)
    setup = _SETUPS[key] = _SETUPS.pop(key) if key in _SETUPS else LatticeSetup(scene)
    while len(_SETUPS) > 1 and sum(len(one.body.masses) for one in _SETUPS.values()) > KEPT_POINTS:
        del _SETUPS[next(iter(_SETUPS))]
    return setup


def lattice_key(scene: Scene) -> Hashable:
    """Equal for scenes that share their lattice and the stiffness of its springs."""
    of_lattice = (attrgetter(name)(scene) for name in scene.lattice_keys)
    return (type(scene), scene.material.k_a, file_digest(scene.lattice.file), *of_lattice)
