"""Work of one process of a sweep: computing a few scenes of one lattice. Workers import
this module."""

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
from taichi_disk.scenes import Scene
from taichi_disk.scenes.setup import outcome_of, setup_of


@dataclass(frozen=True)
class PointResult:
    """Result of one scene of a sweep."""

    status: str  # "done" or "failed"
    reason: str | None = None  # of a failure
    # Results, moduli, error estimate, energy imbalance, steps, dt, integrator; empty
    # after a failure.
    numbers: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    estimated: bool = False  # whether an error estimate was requested
    # of the packages that computed the result
    versions: dict[str, str] = field(default_factory=dict)


def relevant_versions() -> dict[str, str]:
    return {name: version for name, version in versions().items() if name != "python"}


def compute_task(
    expected: dict[str, str], scenes: bytes, estimate: bool
) -> list[PointResult]:
    """Compute a task of an executor and return the results of its scenes, in order.

    `expected`: versions installed where the sweep was started; `scenes`: pickled
    scenes, which are unpickled only if the versions here agree. Raises InputError if
    they do not.
    """
    installed = relevant_versions()
    mismatches = [
        f"{name} {installed.get(name)} instead of {version}"
        for name, version in expected.items()
        if installed.get(name) != version
    ]
    if mismatches:
        worker = f"a worker on {socket.gethostname()}"
        raise InputError(
            f"{worker} has {', '.join(mismatches)}: install the same versions"
            " everywhere"
        )
    with runtime.alone():  # a worker may have several threads
        _start_worker()
    return list(compute_points(pickle.loads(scenes), estimate))


@lru_cache(maxsize=1)
def _start_worker() -> None:
    """Start Taichi on one core unless this process uses it already. Taichi stops at
    exit, which saves its cache."""
    runtime.start(None if engine.loaded() else 1)
    atexit.register(engine.loaded().reset)


def compute_points(scenes: Iterable[Scene], estimate: bool) -> Iterator[PointResult]:
    for scene in scenes:
        try:
            yield _computed(scene, estimate)
        except (TaichiDiskError, MemoryError) as error:
            yield PointResult("failed", str(error) or "not enough memory")


@runtime.alone()
def _computed(scene: Scene, estimate: bool) -> PointResult:
    outcome = outcome_of(scene, estimate=estimate)
    summary = outcome.summary
    numbers: dict[str, Any] = (
        outcome.scenario.result(outcome.columns) | setup_of(scene).moduli
    )
    if not all(map(isfinite, numbers.values())):
        return PointResult("failed", "a result is not a finite number")
    numbers["error_estimate"] = next(iter(summary["error_estimate"].values()), None)
    if "energy" in summary:
        numbers["energy_imbalance"] = summary["energy"]["closing_imbalance"]
    numbers |= {
        name: summary[name]
        for name in ("residual", "dt", "steps", "integrator")
        if name in summary
    }
    return PointResult("done", None, numbers, summary["warnings"], estimate, versions())
