"""What a page needs to throw the disk of a run again: see stepper.js and again.js."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from taichi_disk.experiments.computation.contact import contact_interval
from taichi_disk.experiments.computation.stability import explicit_limit
from taichi_disk.experiments.config.sections import SLIDERS, VideoSection
from taichi_disk.mechanics.lattice.network import laplacian, largest_eigenvalue
from taichi_disk.mechanics.simulation.observables import BY_NAME
from taichi_disk.pictures import plot
from taichi_disk.pictures.panel import ON_DARK
from taichi_disk.pictures.plot import INK, LINE
from taichi_disk.pictures.render import geometry, moments, palette, recording
from taichi_disk.pictures.render.moments import time_of
from taichi_disk.pictures.render.recording import Flight
from taichi_disk.pictures.web.drawing import encoded

# most springs times steps of a run that is thrown again on a page: some 0.2 s
_MOST_WORK = 2.5e7
# columns of the curves over time, in three panels
_PANELS = (
    ("com_vy",),
    ("wall_force",),
    ("translation", "rotation", "vibration", "elastic", "wall", "dissipated"),
)

# numbers by which a film chooses what it shows, and a page for its own throws, too
_RULES = {
    "fullColour": palette.FULL_COLOUR / 100.0,
    "roundNumbers": palette.STEPS,
    "scaleStates": recording.SCALE_TIMES,
    "longestForce": recording.MAX_ARROW,
    "flattening": geometry.FLATTENING,
    "mostMagnified": geometry.MAX_MAGNIFICATION,
    "ringing": moments.RINGING,
    "mostRinging": moments.MAX_RINGING,
    "faint": moments.FAINT,
    "damped": moments.DAMPED,
    "ease": moments.EASE,
    "visibleEnergy": plot.VISIBLE_ENERGY,
    "besideContact": moments.BESIDE_CONTACT,
    "slowPace": moments.SLOW,
    "muchSlower": moments.MUCH_SLOWER,
}


def throwable(flight: Flight, video: VideoSection) -> dict[str, Any] | None:
    """Return the disk of a run, ready for JSON, or None if pages cannot throw it."""
    run = flight.run
    scenario: Any = run.scenario
    scene = scenario.scene
    lattice = scenario.lattice
    settings = scene.time
    if (
        scene.scene != "exponential_wall"
        or scene.is_oblique
        or scene.impact.gap != "auto"
        or (settings.dt, settings.tolerance) != ("auto", "none")
        or scene.lattice.file != "none"
        or scene.material.dashpot != "vector"
        or lattice.stiffness is not None
        or scenario.own.velocities is not None
    ):
        return None
    masses = lattice.masses
    eta = scene.material.eta(len(masses))
    stiffness = scenario.model.springs.stiffness(lattice, lattice.positions)
    omega = float(np.sqrt(largest_eigenvalue(stiffness, masses)))
    damping = largest_eigenvalue(laplacian(lattice), masses)
    steps = run.series["t"][-1] / explicit_limit(omega, eta * damping)
    if steps * len(lattice.bonds) > _MOST_WORK:
        return None
    first, second = contact_interval(run.series)
    return (
        asdict(scene.material)
        | asdict(scene.wall)
        | asdict(scenario.shape)
        | {
            "positions": encoded(lattice.positions, np.float64),
            "masses": encoded(masses, np.float64),
            "velocity": scenario.velocity,
            "gap": scenario.gap,
            "safety": settings.safety,
            "interval": settings.sample_interval,
            "magnify": video.magnify,
            "omega": omega,
            "damping": damping,
            "top": scenario.gap - flight.start * scenario.velocity,
            "moments": [first, time_of("greatest", run.series), second],
            "curves": _curves(),
            "rules": _RULES,
            "numbers": scenario.numbers(),
            "sliders": SLIDERS,
            "eta_star": eta * len(masses),
        }
    )


def _curves() -> list[list[Any]]:
    """Return panel, column, name and colours of a throw's curves."""
    found = []
    for panel, columns in enumerate(_PANELS):
        for column in columns:
            kind = BY_NAME[column]
            colour = kind.colour or (LINE, INK)[panel]
            found.append([panel, column, kind.label, [colour, ON_DARK[colour]]])
    return found
