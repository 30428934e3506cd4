"""How fast films are made here: `python -m taichi_disk.render.benchmark [POINTS [SIZE]]`.

Times drawing alone, encoding alone and a film, in which the two overlap. Where other programs keep the
processors busy, the processor time per frame tells more than the frames per second.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import taichi as ti

from taichi_disk.lattice import disk_lattice
from taichi_disk.render.film import record_film
from taichi_disk.render.picture import Frame, Subject
from taichi_disk.render.still import Stills
from taichi_disk.render.video import Video

_FRAMES = 240


def _frames(subject: Subject) -> Iterator[Frame]:
    """A disk crossed by waves, pushed at a dozen points."""
    rest = subject.lattice.positions
    pushed = np.argsort(rest[:, 1])[:12], np.tile([0.0, 0.5], (12, 1))
    for k in range(_FRAMES):
        t = k / 30
        shaken = rest + [0.0, 1.1] + 0.004 * np.sin(9.0 * rest[:, ::-1] - 6.0 * t)
        yield Frame(t, shaken, (f"t = {t:.2f} R/c", f"frame {k}"), pushed=pushed)


def _report(what: str, work: Callable[[], None]) -> None:
    clock, busy = time.perf_counter(), sum(os.times()[:4])
    work()
    clock, busy = time.perf_counter() - clock, sum(os.times()[:4]) - busy
    print(
        f"{what:<22}{_FRAMES / clock:6.1f} frames/s{1e3 * clock / _FRAMES:7.1f} ms"
        f"{1e3 * busy / _FRAMES:7.1f} ms of processor time per frame"
    )


def main(points: int = 1099, size: int = 720) -> None:
    """Print the three speeds for a disk of `points` points at `size` x `size` pixels."""
    ti.init(ti.cpu, default_fp=ti.f64, fast_math=False, log_level=ti.ERROR)
    view = (-1.1, 1.1, 0.0, 2.2)
    subject = Subject(disk_lattice(points, 0), True, ("Benchmark", f"N = {points}"), 0.04, view, full_force=1.0)
    frames = list(_frames(subject))
    with tempfile.TemporaryDirectory() as folder:
        with Stills([subject], size, 2) as stills:
            pictures = [stills.draw([frame]).copy() for frame in frames[:30]]  # also compiles the kernels

            def draw() -> None:
                for frame in frames:
                    stills.draw([frame])

            _report("drawing alone", draw)

        def encode() -> None:
            with Video(Path(folder, "encoding.mp4"), size, size, 30) as video:
                for k in range(_FRAMES):
                    video.write(pictures[k % len(pictures)])

        _report("encoding alone", encode)
        _report(
            "a film, with start-up",
            lambda: record_film(
                Path(folder, "film.mp4"), [subject], ([frame] for frame in frames), size=size, total=_FRAMES
            ),
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
