"""What a worker does: compute a few scenes of one lattice. This module is what other processes import."""

from __future__ import annotations

import atexit
import pickle
import socket
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from math import isfinite
from typing import Any

from taichi_disk import engine, runtime
from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.output.files import versions
from taichi_disk.scenes import Scene, check_memory
from taichi_disk.scenes.setup import setup_of


@dataclass(frozen=True)
class PointResult:
    """What became of one scene of a sweep.

    Attributes:
        status: "done" or "failed".
        reason: why it failed.
        numbers: results, moduli, error estimate, energy imbalance, steps, dt, integrator; empty if it failed.
        warnings: what a person should know of the run.
        estimated: whether an error estimate was asked for.
        versions: what computed it.
    """

    status: str
    reason: str | None = None
    numbers: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    estimated: bool = False
    versions: dict[str, str] = field(default_factory=dict)


def relevant_versions() -> dict[str, str]:
    """The packages that numbers follow from."""
    return {name: version for name, version in versions().items() if name != "python"}


def compute_task(expected: dict[str, str], scenes: bytes, estimate: bool) -> list[PointResult]:
    """The task that an executor is given: the results of some scenes, in their order.

    Args:
        expected: the versions that are installed where the sweep was started.
        scenes: pickled; they are looked at once the versions are known to agree.

    Raises:
        InputError: other versions are installed here.
    """
    here = relevant_versions()
    other = [f"{name} {here.get(name)} instead of {one}" for name, one in expected.items() if here.get(name) != one]
    if other:
        where = f"a worker on {socket.gethostname()}"
        raise InputError(f"{where} has {', '.join(other)}: install the same versions everywhere")
    with runtime.alone():  # an executor's worker may have several threads
        _start_worker()
    return list(compute_points(pickle.loads(scenes), estimate))


@lru_cache(maxsize=1)
def _start_worker() -> None:
    """Start Taichi, on one core unless this process uses it already.

    It is ended before the process: only then it keeps what it compiled for the next one.
    """
    runtime.start(None if engine.loaded() else 1)
    atexit.register(engine.loaded().reset)


def compute_points(scenes: Iterable[Scene], estimate: bool) -> Iterator[PointResult]:
    """The results of `scenes`, one by one; Taichi runs."""
    for scene in scenes:
        try:
            yield _computed(scene, estimate)
        except (TaichiDiskError, MemoryError) as error:
            yield PointResult("failed", str(error) or "not enough memory")


@runtime.alone()
def _computed(scene: Scene, estimate: bool) -> PointResult:
    from taichi_disk.api import shared_kernels
    from taichi_disk.computation.outcome import compute

    check_memory(scene)
    setup = setup_of(scene)
    scenario = scene.scenario(setup.body)
    modes = None if scenario.static else setup.modes(scenario.model)
    outcome = compute(scenario, scene.time, kernels=shared_kernels(), modes=modes, estimate=estimate, loads=1)
    summary = outcome.summary
    numbers: dict[str, Any] = scenario.result(outcome.columns) | setup.moduli
    if not all(map(isfinite, numbers.values())):
        return PointResult("failed", "a result is not a finite number")
    numbers["error_estimate"] = next(iter(summary["error_estimate"].values()), None)
    if "energy" in summary:
        numbers["energy_imbalance"] = summary["energy"]["closing_imbalance"]
    numbers |= {name: summary[name] for name in ("residual", "dt", "steps", "integrator") if name in summary}
    return PointResult("done", None, numbers, summary["warnings"], estimate, versions())
