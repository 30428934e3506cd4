"""The start of a scene in the sandbox: lattice, scenario with a mouse spring, spectrum of the springs."""

from __future__ import annotations

from dataclasses import replace
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum, spectrum
from taichi_disk.lattice import Lattice
from taichi_disk.physics import MouseSpring
from taichi_disk.scenes import Scene


class Start(NamedTuple):
    """A scene at t = 0: its unloaded lattice, its scenario with a mouse spring, its spectrum."""

    body: Lattice
    scenario: Scenario
    spectrum: Spectrum


def start_of(scene: Scene, before: Start | None = None) -> Start:
    """Return the start of a scene, and take from `before` what the scenes share. Raises TaichiDiskError."""
    scene = scene.in_time()
    if before and _lattice_values(scene) != _lattice_values(before.scenario.scene):
        before = None
    body = before.body if before else scene.body()
    scenario = with_mouse(scene, body)
    lattice, springs = scenario.lattice, scenario.model.springs
    if before and np.array_equal(before.scenario.lattice.positions, lattice.positions):
        return Start(body, scenario, before.spectrum)
    # The spectrum must include the rates of dashpots, which may be switched on later.
    damped = replace(scenario.model, springs=replace(springs, eta=1.0))
    return Start(body, scenario, spectrum(lattice, damped))


def _lattice_values(scene: Scene) -> Any:
    """Return the values on which the unloaded lattice and its spectrum depend."""
    return attrgetter("material.k_a", *scene.lattice_keys)(scene)


def with_mouse(scene: Scene, body: Lattice) -> Scenario:
    """Return the scene at t = 0, with a mouse spring that pulls no point; `body`: its unloaded lattice."""
    scenario = scene.scenario(body)
    modulus = scenario.model.springs.modulus
    # A force above 0.02 modulus R would turn triangles of a fine lattice inside out.
    scenario.model = replace(scenario.model, mouse=MouseSpring(0.2 * modulus, 0.02 * modulus))
    return scenario
