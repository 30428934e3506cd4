"""What a page needs to throw the disk of a run again: see stepper.js and again.js."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from taichi_disk.experiments.computation.stability import explicit_limit
from taichi_disk.experiments.config.sections import SLIDERS, VideoSection
from taichi_disk.mechanics.lattice.network import laplacian, largest_eigenvalue
from taichi_disk.pictures import plot
from taichi_disk.pictures.curves import LOOKS
from taichi_disk.pictures.render import geometry, moments, palette, recording
from taichi_disk.pictures.render.recording import Flight
from taichi_disk.pictures.web.drawing import Message, encoded

# A page cannot throw a disk again that has more points, or whose own throw takes more
# springs times steps: some 1.5 s.
MOST_POINTS = 4_000
_MOST_WORK = 1e8
TOO_LARGE = (
    "This disk is too large for a page to throw: taichi-disk run computes other throws."
)
# columns of the curves over time
_COLUMNS = (
    "com_vy",
    "wall_force",
    "translation",
    "rotation",
    "vibration",
    "elastic",
    "wall",
    "dissipated",
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


def throwable(flight: Flight) -> bool:
    """Return whether a page can step the disk of a run, however long that takes."""
    scenario: Any = flight.run.scenario
    scene = scenario.scene
    return (
        scene.scene == "exponential_wall"
        and not scene.is_oblique
        and not scene.impact.gravity
        and scene.impact.gap == "auto"
        and (scene.time.dt, scene.time.tolerance) == ("auto", "none")
        and scene.lattice.file == "none"
        and scene.material.dashpot == "vector"
        and scenario.lattice.stiffness is None
        and scenario.own.velocities is None
    )


def thrown_disk(flight: Flight, video: VideoSection) -> Message | None:
    """Return the disk of a run that is `throwable`, ready for JSON, or None if it is
    too large for a page."""
    run = flight.run
    scenario: Any = run.scenario
    scene = scenario.scene
    lattice = scenario.lattice
    settings = scene.time
    masses = lattice.masses
    eta = scene.material.eta(len(masses))
    stiffness = scenario.model.springs.stiffness(lattice, lattice.positions)
    omega = float(np.sqrt(largest_eigenvalue(stiffness, masses)))
    damping = largest_eigenvalue(laplacian(lattice), masses)
    steps = run.end / explicit_limit(omega, eta * damping)
    if len(masses) > MOST_POINTS or steps * len(lattice.bonds) > _MOST_WORK:
        return None
    contact = run.contact
    looks = [LOOKS[column] for column in _COLUMNS]
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
            "goal": video.goal,
            "omega": omega,
            "damping": damping,
            "top": scenario.gap - flight.start * scenario.velocity,
            "moments": [contact.start, contact.greatest, contact.end],
            # panel, column, name and colours of each
            "curves": [
                [look.panel, look.column, look.name, look.colours] for look in looks
            ],
            "rules": _RULES,
            "numbers": scenario.numbers(),
            "sliders": SLIDERS,
            "eta_star": eta * len(masses),
        }
    )
