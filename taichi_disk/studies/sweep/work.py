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

from taichi_disk.base import engine, runtime
from taichi_disk.base.errors import InputError, TaichiDiskError
from taichi_disk.base.files import versions
from taichi_disk.experiments.scenes import Scene
from taichi_disk.experiments.scenes.setup import outcome_of

Row = dict[str, Any]  # of points.csv
Versions = dict[str, str]  # of packages
MAX_REASON = 300  # number of characters of an unexpected error's message


@dataclass(frozen=True)
class PointResult:
    """Result of one scene of a sweep."""

    status: str  # "done" or "failed"
    reason: str | None = None  # of a failure
    # Results, moduli, error estimate, energy imbalance, steps, dt, integrator; empty
    # after a failure.
    numbers: Row = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    estimated: bool = False  # whether an error estimate was requested
    # of the packages that computed the result
    versions: Versions = field(default_factory=dict)


def relevant_versions() -> Versions:
    return {name: version for name, version in versions().items() if name != "python"}


def compute_task(
    expected: Versions, scenes: bytes, estimate: bool
) -> list[PointResult]:
    """Return the results of a task's pickled `scenes`. Raises InputError unless the
    versions here are the `expected` ones."""
    check_versions(socket.gethostname(), relevant_versions(), expected)
    with runtime.alone():
        start_worker()
    return list(compute_points(pickle.loads(scenes), estimate))


def check_versions(worker: str, installed: Versions, expected: Versions) -> None:
    mismatches = [
        f"{name} {installed.get(name)} instead of {version}"
        for name, version in expected.items()
        if installed.get(name) != version
    ]
    if mismatches:
        raise InputError(
            f"a worker on {worker} has {', '.join(mismatches)}: install the same"
            " versions everywhere"
        )


@lru_cache(maxsize=1)
def start_worker() -> None:
    """Start Taichi, on one core unless this process has started it already. Taichi
    stops at exit, which saves its cache."""
    threads: int | None = 1
    if engine.loaded():
        threads = None  # as many as the process has
    runtime.start(threads)
    atexit.register(engine.loaded().reset)


def compute_points(scenes: Iterable[Scene], estimate: bool) -> Iterator[PointResult]:
    """Yield the results of `scenes`. Whatever error a scene causes, the next one is
    computed."""
    for scene in scenes:
        try:
            yield _computed(scene, estimate)
        except TaichiDiskError as error:
            yield PointResult("failed", str(error))
        except MemoryError:
            yield PointResult("failed", "not enough memory")
        except Exception as error:
            message = " ".join(str(error).split())
            reason = f"unexpected {type(error).__name__}: {message[:MAX_REASON]}"
            yield PointResult("failed", reason)


@runtime.alone()
def _computed(scene: Scene, estimate: bool) -> PointResult:
    outcome = outcome_of(scene, estimate=estimate)
    summary = outcome.summary
    numbers: Row = dict(outcome.scenario.result(outcome.series))
    if scene.lattice.file == scene.lattice.outline == "none":  # laws are of disks
        moduli = scene.moduli(scene.lattice.points)
        numbers |= {"young": moduli.young, "poisson": moduli.poisson}
    numbers["error_estimate"] = next(iter(summary["error_estimate"].values()), None)
    if "energy" in summary:
        numbers["energy_imbalance"] = summary["energy"]["closing_imbalance"]
    for name in ("residual", "dt", "steps", "integrator"):
        if name in summary:
            numbers[name] = summary[name]
    for name, value in numbers.items():
        if isinstance(value, float) and not isfinite(value):
            return PointResult("failed", f"{name} is not a finite number")
    return PointResult(
        status="done",
        numbers=numbers,
        warnings=summary["warnings"],
        estimated=estimate,
        versions=versions(),
    )
