"""What a page needs to throw the disk of a run again, with another speed and other
dashpots: see stepper.js."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_disk.computation.stability import Spectrum, step_limit
from taichi_disk.config.sections import SLIDERS
from taichi_disk.integrators import VELOCITY_VERLET
from taichi_disk.lattice.network import laplacian, largest_eigenvalue
from taichi_disk.output.panel import ON_DARK
from taichi_disk.output.plot import INK, LINE
from taichi_disk.render.moments import contact_of, time_of
from taichi_disk.render.recording import Flight
from taichi_disk.simulation.observables import BY_NAME
from taichi_disk.web.drawing import encoded

# most springs times steps of a run that is thrown again on a page: some 0.2 s
_MOST_WORK = 2.5e7
# columns of the time series by the names that stepper.js has for them
_ENERGIES = {
    "flight": "translation",
    "vibration": "vibration",
    "elastic": "elastic",
    "wall": "wall",
    "lost": "dissipated",
}


def throwable(flight: Flight) -> dict[str, Any] | None:
    """Return the disk of a run as stepper.js and again.js need it, ready for JSON, or
    None if they cannot throw it."""
    run = flight.run
    scenario: Any = run.scenario
    scene = scenario.scene
    lattice = scenario.lattice
    if (
        scene.scene != "exponential_wall"
        or scene.is_oblique
        or scene.time.dt != "auto"
        or scene.time.tolerance != "none"
        or scene.lattice.file != "none"
        or scene.material.dashpot != "vector"
        or lattice.stiffness is not None
        or scenario.own.velocities is not None
    ):
        return None
    masses = lattice.masses
    springs = scenario.model.springs
    stiffness = springs.stiffness(lattice, lattice.positions)
    spectrum = Spectrum(
        omega=float(np.sqrt(largest_eigenvalue(stiffness, masses))),
        damping=largest_eigenvalue(laplacian(lattice), masses),
        mass=float(masses.min()),
        points=len(masses),
    )
    limit = step_limit(spectrum, scenario.model, VELOCITY_VERLET, scenario.point_force)
    steps = run.series["t"][-1] / (scene.time.safety * limit)
    if steps * len(lattice.bonds) > _MOST_WORK:
        return None
    surface = lattice.positions[lattice.disk_surface]
    chords = np.hypot(*(surface - np.roll(surface, 1, axis=0)).T)
    first, second = contact_of(run)
    interval = scene.time.sample_interval
    eta_star = scene.material.eta(len(masses)) * len(masses)
    return {
        "positions": encoded(lattice.positions, np.float64),
        "masses": encoded(masses, np.float64),
        "k_a": scene.material.k_a,
        "k_b": scene.material.k_b,
        "a": scene.wall.a,
        "V0": scene.wall.V0,
        "velocity": scenario.velocity,
        "gap": scenario.gap,
        "gap_is_auto": scene.impact.gap == "auto",
        "safety": scene.time.safety,
        "interval": None if interval == "auto" else interval,
        "omega": spectrum.omega,
        "damping": spectrum.damping,
        "heaviest": float(masses.max()),
        "lightest": spectrum.mass,
        "chord": float(chords.max()),
        "radius": scenario.shape.radius,
        "compliance": scenario.shape.compliance,
        "top": scenario.gap - flight.start * scenario.velocity,
        "moments": [first, time_of("greatest", run.series), second],
        "curves": _curves(),
        "numbers": [
            _slider("v", "speed v", "c", "impact.velocity", scenario.velocity),
            _slider("eta", "viscosity η*", "", "material.eta_star", eta_star),
        ],
    }


def _slider(key: str, name: str, unit: str, of: str, value: float) -> dict[str, Any]:
    """Return a slider for the key `of` of a scene, with ends that contain `value`."""
    low, high = SLIDERS[of]
    ends = {"low": min(low, value), "high": max(high, value)}
    return {"key": key, "name": name, "unit": unit, "value": value, **ends}


def _curves() -> list[dict[str, Any]]:
    """Return panel, name and colours of a throw's curves; `column` is their name in
    stepper.js."""
    found = [("vy", 0, "", LINE), ("force", 1, "", INK)]
    for column, name in _ENERGIES.items():
        found.append((column, 2, BY_NAME[name].label, BY_NAME[name].colour))
    return [
        {
            "column": column,
            "panel": panel,
            "name": name,
            "colours": [colour, ON_DARK[colour]],
        }
        for column, panel, name, colour in found
    ]
