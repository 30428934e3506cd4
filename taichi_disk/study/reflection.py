"""What the elastic wall's matched dashpots send back of a plane wave that meets them head-on.

A slab of the wall's own lattice, stepped by the same kernels. A bump of velocity at its free top runs down as a
plane pulse to the dashpots at the bottom. The sides let a plane wave pass as if there were none: they hold what such
a wave does not move (x under a P wave, y under an S wave) by dashpots too strong to yield, and leave the rest free.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice, disk_lattice
from taichi_disk.model import runtime
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import spectrum, step_limit
from taichi_disk.model.world import World
from taichi_disk.moduli import Moduli, bulk_moduli
from taichi_disk.scenes.absorbing_wall import boundary_impedance
from taichi_disk.wall_lattice import with_wall

Array = NDArray[np.float64]
Wave = Literal["p", "s"]
WIDTH = 2.0  # of the slab [R]
RIGID = 1e6  # dashpots that hold a point fast [M c/R]
SPEED = 1e-6  # of the pulse [c]: small enough for linear waves
LATTICES = 4  # of which the table shows the mean


@dataclass(frozen=True)
class Reflection:
    """What comes back when the pulse has had time to be half way up again.

    `energy`: all that is left in the slab over all that was sent, also what the random lattice has scattered.
    `amplitude`: of the plane pulse, over that of the one sent; negative where the velocity changes its sign.
    """

    energy: float
    amplitude: float


def reflect(wave: Wave, sigma: float, seed: int, points: int = 1099, impedance: float = 1.0) -> Reflection:
    """Send a pulse with the velocity profile exp(-y^2/(2 sigma^2)), `sigma` [R], down a slab 10 sigma deep.

    Taichi has to be started. `points`: of the disk whose material the slab is made of. `impedance`: the bottom's
    dashpots over matched ones; plane waves then come back with the amplitude (1 - impedance)/(1 + impedance).
    """
    moduli = bulk_moduli(points, seed, 1.0, 0.7)
    lattice = _slab(points, 10.0 * sigma, seed)
    speed = moduli.wave_speed_p if wave == "p" else moduli.wave_speed_s
    along = 1 if wave == "p" else 0  # the component that the wave moves
    physics = Physics(wall="elastic", boundary="dashpot", impedance=_dashpots(lattice, moduli, along, impedance))
    y = lattice.positions[lattice.disk_points :, 1]
    depth = -float(y.min())

    velocities = np.zeros_like(lattice.positions)
    velocities[lattice.disk_points :, along] = SPEED * np.exp(-0.5 * (y / sigma) ** 2)
    dt = 0.5 * step_limit(spectrum(lattice, physics), physics, 0.0)
    world = World(lattice, physics, velocities[None], dt)
    sent = float((0.5 * lattice.masses[:, None] * velocities**2).sum())
    kinetic, elastic = world.advance(1, round(1.5 * depth / speed / dt))[0, 7:9, 0]

    returned = np.exp(-0.5 * ((y + 0.5 * depth) / sigma) ** 2)
    after = world.velocities()[0, lattice.disk_points :, along]
    world.destroy()
    # Of the bump at a free end, and of its mirror image beyond, one half runs down.
    amplitude = float(after @ returned) / (0.5 * SPEED * float(returned @ returned))
    return Reflection((float(kinetic) + float(elastic)) / sent, amplitude)


def _slab(points: int, depth: float, seed: int) -> Lattice:
    """A wall `depth` [R] thick; its disk hangs far above, at rest."""
    return with_wall(
        disk_lattice(points, seed), round(points * WIDTH * depth / np.pi), WIDTH, seed, True, 0.7, gap=10.0
    )


def _dashpots(lattice: Lattice, moduli: Moduli, along: int, impedance: float) -> Array:
    """(k, 2) dashpot constants [M c/R]: those of the scene at the bottom, sides that only guide."""
    speeds = moduli.wave_speed_p, moduli.wave_speed_s
    z = boundary_impedance(lattice, *(moduli.density * speed for speed in speeds))
    chain = lattice.positions[lattice.wall_boundary]
    side = np.abs(chain[:, 0]) >= 0.5 * WIDTH - 1e-9
    bottom = np.flatnonzero(chain[:, 1] <= chain[:, 1].min() + 1e-9)
    # A corner's own share holds half a spring of the side too.
    z[bottom[[0, -1]], along] = 0.5 * z[bottom[1], along]
    z[bottom] *= impedance
    z[side, 1 - along] = RIGID
    z[np.setdiff1d(np.flatnonzero(side), bottom), along] = 0.0
    return z


def table() -> list[str]:
    """What the matched dashpots send back, measured now, in Markdown; starts Taichi."""
    runtime.start("cpu")
    lines = [
        "**Matched dashpots** absorb waves that meet them head-on: what comes back of a plane pulse with the velocity "
        f"profile exp(−y²/2σ²) in a slab of the wall's lattice, mean of {LATTICES} lattices. Energy counts all that is "
        "left, also what the random lattice scatters on the way; amplitude, the plane wave alone (± its standard "
        "deviation). An impact sends waves longer than these: they last as long as the contact, some 4 R/c.",
        "",
        "| wave | σ [R] | energy | amplitude |",
        "|---|---|---|---|",
    ]
    waves: tuple[Wave, ...] = ("p", "s")
    for wave in waves:
        for sigma in (0.2, 0.35, 0.7):
            found = [reflect(wave, sigma, seed) for seed in range(LATTICES)]
            amplitudes = [one.amplitude for one in found]
            lines.append(
                f"| {wave.upper()} | {sigma:g} | {np.mean([one.energy for one in found]):.2%} "
                f"| {np.mean(amplitudes):+.2%} ± {np.std(amplitudes, ddof=1):.2%} |"
            )
    return lines
