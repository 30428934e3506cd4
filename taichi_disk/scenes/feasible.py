"""What can be said of a scene without computing it: that it would be refused when it is run."""

from __future__ import annotations

from taichi_disk.config.scene_base import SceneBase
from taichi_disk.config.sections import ElasticWallSection
from taichi_disk.config.sweep_axes import Sweep
from taichi_disk.errors import InputError
from taichi_disk.lattice import check_thickness
from taichi_disk.runtime import free_memory
from taichi_disk.scenes import Scene


def check_feasible(scene: Scene | Sweep) -> None:
    """Raises InputError where `run` would: a lattice that cannot be, a step beyond the stability limit.

    Of a sweep the first scene is looked at. The lattice is built only where a step by hand depends on it.
    """
    if isinstance(scene, Sweep):
        return check_feasible(scene.scenes[0])
    check_memory(scene)
    points = scene.lattice.points if scene.lattice.file == "none" else scene.body().disk_points
    if isinstance(scene.wall, ElasticWallSection):
        check_thickness(points, scene.wall.points, scene.wall.width)
    if scene.time.dt == "auto":
        return
    from taichi_disk.simulation.stability import spectrum
    from taichi_disk.simulation.step_control import StepControl

    scenario = scene.scenario()
    if not scenario.static:
        StepControl(scenario, scene.time, spectrum(scenario.lattice, scenario.model))


BYTES = 3e8, 2e3  # of a process, and of each point; measured with 1,099 to 2,000,000 points


def check_memory(scene: SceneBase) -> None:
    """Raises InputError for more points than there is free memory for."""
    wall = getattr(scene, "wall", None)
    points = scene.lattice.points + (wall.points if isinstance(wall, ElasticWallSection) else 0)
    needed, free = BYTES[0] + BYTES[1] * points, free_memory()
    if points > 20_000 and needed > free:
        raise InputError(
            f"lattice.points: {points:,} points need about {needed / 1e9:.1f} GB of memory, "
            f"{free / 1e9:.1f} GB are free: take at most {max(3, int((free - BYTES[0]) / BYTES[1])):,}, or stop other "
            "programs"
        )
