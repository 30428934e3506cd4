"""Cache of lattices and their spectra, which may take longer to compute than a run."""

from __future__ import annotations

from collections.abc import Hashable
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from taichi_disk.lattice import Lattice, file_digest
from taichi_disk.scenes import Scene

if TYPE_CHECKING:
    from taichi_disk.computation.outcome import Outcome

MAX_POINTS = 100_000  # total number of points of the cached lattices


class LatticeSetup:
    """The unloaded lattice `body` of a scene, with its moduli and spectra."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.body = scene.body()
        self._spectra: dict[bool, Any] = {}

    @cached_property
    def moduli(self) -> dict[str, float]:
        """`young` E [M c^2/R^2] and `poisson` nu of the material; empty for a lattice
        from a file."""
        if self._scene.lattice.file != "none":
            return {}
        found = self._scene.moduli(self._scene.lattice.points)
        return {"young": found.young, "poisson": found.poisson}

    def spectrum(self, lattice: Lattice, model: Any) -> Any:
        """Return the spectrum of this body at t = 0, which is `lattice`, with the
        springs and dashpots of `model`."""
        from taichi_disk.computation.stability import spectrum

        # a file's springs may be strained, and relax before a compression
        if self._scene.lattice.file != "none":
            return spectrum(lattice, model)
        damped = model.springs.damped
        if damped not in self._spectra:
            self._spectra[damped] = spectrum(self.body, model)
        return self._spectra[damped]


_SETUPS: dict[Hashable, LatticeSetup] = {}  # in the order of their last use


def setup_of(scene: Scene) -> LatticeSetup:
    """Return the setup of the scene's lattice. Raises TaichiDiskError if there is no
    such lattice."""
    key = lattice_key(scene)
    setup = _SETUPS.pop(key, None) or LatticeSetup(scene)
    _SETUPS[key] = setup
    points = sum(len(one.body.masses) for one in _SETUPS.values())
    while points > MAX_POINTS and len(_SETUPS) > 1:
        oldest = _SETUPS.pop(next(iter(_SETUPS)))
        points -= len(oldest.body.masses)
    return setup


def outcome_of(scene: Scene, **options: Any) -> Outcome:
    """Compute a scene on its cached lattice, without the path of a loading. Options and
    errors as for `compute`."""
    from taichi_disk.computation.outcome import compute

    setup = setup_of(scene)
    scenario = scene.scenario(setup.body)
    return compute(scenario, spectrum_of=setup.spectrum, loads=1, **options)


def lattice_key(scene: Scene) -> Hashable:
    of_lattice = (attrgetter(name)(scene) for name in scene.lattice_keys)
    return (
        type(scene),
        scene.material.k_a,
        file_digest(scene.lattice.file),
        *of_lattice,
    )
