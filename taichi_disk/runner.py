"""From a scene to its numbers, its plot and its film."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from taichi_disk import results
from taichi_disk.dynamics import first_step, move
from taichi_disk.errors import SimulationError, TaichiDiskError
from taichi_disk.film import film
from taichi_disk.model import runtime
from taichi_disk.model.stability import spectrum
from taichi_disk.outcome import Outcome
from taichi_disk.output import prepare_output
from taichi_disk.plot import plot_run
from taichi_disk.progress import Progress, QuietProgress
from taichi_disk.quasistatic import press
from taichi_disk.scene import CompressionScene, Scene
from taichi_disk.scenes import build
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import BlowUp


@dataclass(frozen=True)
class RunResult:
    """What a run gave.

    `summary` is what summary.json holds; `video_error` says why there is no film where there should be one.
    """

    status: str
    headline: dict[str, float]
    summary: dict[str, Any]
    out: Path
    video_error: str | None


def run(
    scene: Scene,
    out: Path | str,
    *,
    video: bool = True,
    arch: str = "cpu",
    threads: int | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> RunResult:
    """Compute `scene` and write summary, time series, lattice, final state, plot and film into `out`.

    Args:
        video: whether to make the film. If it cannot be made, the numbers are there all the same.
        arch: "cpu" or "cuda"; see `taichi_disk.model.runtime.start`.
        threads: CPU threads; results do not depend on it.
        force: take a hand-written time step even beyond the stability limit.
        progress: told how far it is.

    Raises InputError, with nothing written, for what cannot be computed as asked; SimulationError when the
    computation fails: `out` then holds summary.json (status `failed` and why) and, after a blow-up, failure.npz.
    """
    out, progress, clock = Path(out), progress or QuietProgress(), _Clock()
    static = isinstance(scene, CompressionScene) and scene.compression.method == "newton"
    summary: dict[str, Any] = {
        "scene": scene.scene,
        "status": "failed",
        "reason": None,
        "seed": scene.lattice.seed,
        "precision": "f64" if static else scene.time.precision,
        "arch": "cpu" if static else arch,
        "versions": results.versions(),
        "wall_clock": clock.seconds,
    }
    try:
        with clock("build"):
            runtime.start(arch, threads, scene.time.precision)
            setup = build(scene)
            if not static:
                modes = spectrum(setup.lattice, setup.physics)
                first_step(setup, scene.time, modes, force)  # refused, if it is, before anything is written
    except SimulationError as failure:
        _begin(out, scene)
        results.write_summary(out / "summary.json", summary | {"reason": str(failure)})
        raise
    _begin(out, scene)
    results.write_lattice(out / "lattice.npz", setup.lattice, setup.velocities, setup.physics.impedance)
    try:
        with clock("simulate"):
            if isinstance(setup, Compression) and static:
                outcome = press(setup)
            else:
                outcome = move(setup, scene.time, modes, progress, force=force)
    except (SimulationError, KeyboardInterrupt) as failure:
        if isinstance(failure, KeyboardInterrupt):
            summary["status"] = "interrupted"
        summary["reason"] = str(failure) or None
        if isinstance(failure, BlowUp):
            results.write_arrays(out / "failure.npz", **failure.last_good)
        results.write_summary(out / "summary.json", summary)
        raise
    clock.move("simulate", "compile", outcome.compile_seconds)

    headline = setup.headline(outcome.columns)
    summary |= {
        "status": "done",
        **headline.values,
        "measured": headline.notes,
        **outcome.facts,
        "video": None,
    }
    _write(out, scene, setup, outcome, headline.values)
    results.write_summary(out / "summary.json", summary)
    video_error = None
    if video:
        name = results.PICTURES if scene.video.format == "png" else f"video.{scene.video.format}"
        try:
            with clock("render"):
                film(out / name, [(setup, outcome)], scene.video, progress)
            summary["video"] = name
        except TaichiDiskError as error:
            video_error = summary["video_error"] = str(error)
        results.write_summary(out / "summary.json", summary)
    progress.stop()
    return RunResult("done", headline.values, summary, out, video_error)


def _begin(out: Path, scene: Scene) -> None:
    prepare_output(out)
    results.clear(out)
    results.write_text(out / "scene.yaml", scene.to_yaml())


def _write(out: Path, scene: Scene, setup: Setup, outcome: Outcome, headline: dict[str, float]) -> None:
    asked = scene.time.sample_interval
    # Newton's rows are on the way to rest, not in time.
    interval = 0.0 if asked == "auto" or "dt" not in outcome.facts else asked
    results.write_timeseries(out / "timeseries.csv", outcome.columns, interval)
    results.write_arrays(
        out / "final.npz",
        positions=outcome.positions,
        velocities=outcome.velocities,
        t=outcome.columns["t"][-1],
    )
    plot_run(out / "plot.png", scene.scene, outcome.columns, headline, "    ".join(setup.title()[1:]))


class _Clock:
    """Wall-clock seconds by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        began = perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + perf_counter() - began

    def move(self, source: str, target: str, seconds: float) -> None:
        self.seconds[source] -= seconds
        self.seconds[target] = self.seconds.get(target, 0.0) + seconds
