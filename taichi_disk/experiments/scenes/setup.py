"""Cache of lattices and their spectra, which may take longer to compute than a run."""

from __future__ import annotations

from collections.abc import Hashable
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from taichi_disk.experiments.scenes import Scene
from taichi_disk.mechanics.lattice import Lattice, file_digest

if TYPE_CHECKING:
    from taichi_disk.experiments.computation.outcome import Outcome
    from taichi_disk.experiments.computation.stability import Spectrum
    from taichi_disk.mechanics.physics import Model

MAX_POINTS = 100_000  # of the cached lattices; with more, all are forgotten

_BODIES: dict[Hashable, Lattice] = {}
_SPECTRA: dict[Hashable, Spectrum] = {}  # four numbers each, so all are kept


def body_of(scene: Scene) -> Lattice:
    """Return the scene's unloaded lattice. Raises TaichiDiskError if there is no such
    lattice."""
    key = lattice_key(scene)
    if key not in _BODIES:
        if sum(len(one.masses) for one in _BODIES.values()) > MAX_POINTS:
            _BODIES.clear()
        _BODIES[key] = scene.body()
    return _BODIES[key]


def spectrum_of(scene: Scene, lattice: Lattice, model: Model) -> Spectrum:
    """Return the spectrum of the scene's lattice, which is `lattice` at t = 0, with the
    springs and dashpots of `model`."""
    from taichi_disk.experiments.computation.stability import spectrum

    # a file's springs may be strained, and relax before a compression
    if scene.lattice.file != "none":
        return spectrum(lattice, model)
    key = lattice_key(scene), model.springs.damped
    if key not in _SPECTRA:
        _SPECTRA[key] = spectrum(body_of(scene), model)
    return _SPECTRA[key]


def outcome_of(scene: Scene, **options: Any) -> Outcome:
    """Compute a scene on its cached lattice, without the path of a loading. Options and
    errors as for `compute`."""
    from taichi_disk.experiments.computation.outcome import compute

    scenario = scene.scenario(body_of(scene))
    known_spectrum = partial(spectrum_of, scene)
    return compute(scenario, spectrum_of=known_spectrum, loads=1, **options)


def lattice_key(scene: Scene) -> Hashable:
    of_lattice = (attrgetter(name)(scene) for name in scene.lattice_keys)
    return (
        type(scene),
        scene.material.k_a,
        file_digest(scene.lattice, "file"),
        file_digest(scene.lattice, "outline"),
        *of_lattice,
    )
