"""Leapfrog on the plain NumPy force: what every program has to agree with before it is timed."""

from __future__ import annotations

from taichi_disk.benchmark.task import Task
from taichi_disk.study.reference import Reference


def restitution(task: Task, lead: float) -> float:
    """e of the first lane by v_{k+1/2} = v_{k-1/2} + h f_k/m, x_{k+1} = x_k + h v_{k+1/2}.

    The dashpots of f_k take the velocities v_{k-1/2} + lead h f_{k-1}/m: lead = 1/2 is what `velocity_verlet` predicts
    for t_k. Shares no code with the kernels.
    """
    reference = Reference(task.lattice, task.physics)
    x, v = task.lattice.positions.copy(), task.velocities[0].copy()
    g = task.dt / task.lattice.masses[:, None]
    f = reference.force(x, v)
    v -= 0.5 * g * f
    for _ in range(task.steps):
        v += g * f
        x += task.dt * v
        f = reference.force(x, v + lead * g * f)
    return task.restitution(v + 0.5 * g * f)
