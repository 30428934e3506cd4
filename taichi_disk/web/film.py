"""A film that can be played with: one HTML file that holds the states of runs and the
modules that draw them."""

from __future__ import annotations

import json
import zlib
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.config.sections import VideoSection
from taichi_disk.fields import QUANTITIES, Triangles
from taichi_disk.lattice import Array
from taichi_disk.output.files import write_text
from taichi_disk.progress import Progress
from taichi_disk.render import film as pictures
from taichi_disk.render.geometry import flattening, magnification
from taichi_disk.render.moments import (
    WHOLE,
    Run,
    Span,
    check_runs,
    cues,
    lines,
    scale_times,
    titles,
)
from taichi_disk.render.palette import full_scale, round_near
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.statics.equilibrium import roll_angle, turned
from taichi_disk.web.drawing import (
    DRAWING,
    bundle,
    colour_values,
    contact_forces,
    scene_message,
    source,
)

_LEVELS = 32_000  # levels of a displacement on either side of zero
# levels of a colour on either side of zero, and from zero up
_SIGNED, _AMOUNT = 127, 255
_STATES = 300_000  # approximate number of points in all states of a file together
_FEWEST = 40  # fewest states, for a large disk; the page interpolates between them


def film(
    path: Path,
    runs: Sequence[Run],
    video: VideoSection,
    progress: Progress,
    span: Span = WHOLE,
) -> None:
    """Write a page (.html) that plays the states of `runs` side by side, with the
    arguments of `render.film.film`.

    A page needs no Vulkan. Raises what `render.film.film` raises.
    """
    if path.suffix != ".html":
        return pictures.film(path, runs, video, progress, span)
    check_runs(runs)
    most = max(
        _STATES // max(len(run.scenario.lattice.positions) for run in runs), _FEWEST
    )
    frames = min(round(video.fps * video.seconds), most)
    shots = cues(runs, frames, video.fps, span)
    at = np.array([t for t, _ in shots])
    times = np.unique(at)
    recorded = []
    for k, run in enumerate(runs):
        progress("render", k, len(runs))
        recorded.append(_recorded(run, times))
    limits = {name: max(one.limits[name] for one in recorded) for name in QUANTITIES}
    views = np.array([one.view for one in recorded])
    view = [*views[:, 0::2].min(axis=0), *views[:, 1::2].max(axis=0)]
    largest = max(one.largest_force for one in recorded)
    shown = replace(
        video,
        magnify=magnification(video.magnify, max(one.flattest for one in recorded)),
    )
    force = round_near(largest) if largest else 0.0
    data, packed = b"", []
    for run, one, title in zip(runs, recorded, titles(runs), strict=True):
        message = scene_message(run.scenario, shown, largest_force=one.largest_force)
        arrays, scales = one.arrays(limits)
        places = {}
        for name, array in arrays.items():
            data += bytes(-len(data) % 4)
            places[name] = len(data), array.size
            data += array.tobytes()
        packed.append(
            {
                "scene": (
                    message
                    | {
                        "title": list(title),
                        "view": [float(view[k]) for k in (0, 2, 1, 3)],
                        "full_force": force,
                    }
                ),
                "states": len(times),
                "unit": one.unit,
                "first": np.cumsum([0, *(len(each) for each in one.forces)]).tolist(),
                "limits": scales,
                "captions": [list(each) for each in lines(run, shots)],
                "arrays": places,
            }
        )
    # cues in a second
    rate = video.fps * frames / max(round(video.fps * video.seconds), 1)
    head = json.dumps(
        {"fps": rate, "cues": np.searchsorted(times, at).tolist(), "runs": packed}
    ).encode()
    head += b" " * (-len(head) % 4)
    states = zlib.compress(np.array([len(head)], "<u4").tobytes() + head + data, 9)
    text = Template(source("film.html")).substitute(
        title=escape(" | ".join(title[0] for title in titles(runs))),
        origin=escape(pictures.film_origin(runs, video)),
        states=b64encode(states).decode(),
        style=source("style.css"),
        script=bundle(*DRAWING, "controls.js", "film.js"),
    )
    write_text(path, text)
    progress("render", len(runs), len(runs))


@dataclass
class _Recorded:
    """States of one run.

    Attributes:
        motion: (T, 3) mean position of the disk's points [R] and angle [rad] by which
            the disk is turned.
        displacements: (T, n, 2) of the points without that motion, in the axes of the
            unloaded disk [R].
        forces: the `contact_forces` of each state.
        values: (T, n) values of each quantity at the points.
        limits: end of each quantity's colour scale.
        flattest: flattening of the disk at the greatest compression [R].
        largest_force: largest force of the wall on one point at the greatest
            compression [M c^2/R].
        centres: (T, 2) centres of mass [R].
        view: bounds of all states [R].
    """

    motion: Array
    displacements: Array
    forces: list[NDArray[np.float32]]
    values: dict[str, NDArray[np.float32]]
    limits: dict[str, float]
    flattest: float
    largest_force: float
    centres: Array
    view: list[float]

    @property
    def unit(self) -> float:
        """Resolution of the stored displacements [R]."""
        return max(float(np.abs(self.displacements).max()), 1e-9) / _LEVELS

    def arrays(
        self, limits: dict[str, float]
    ) -> tuple[dict[str, Array], dict[str, Any]]:
        """Return the arrays to pack, by name, and the scale of each quantity; integers
        hold changes between states."""
        steps = _differences(
            np.rint(self.displacements / self.unit).astype(np.int16)
        ).astype("<i2")
        found = {
            "motion": self.motion.astype("<f4"),
            "centres": self.centres.astype("<f4"),
            "forces": np.concatenate(self.forces).astype("<f4"),
            "displacements": np.stack(
                [steps.view(np.uint8)[..., k::2] for k in (0, 1)]
            ),
        }
        scales = {}
        for name, kind in QUANTITIES.items():
            full = float(self.values[name].max()) if name == "fringes" else limits[name]
            part = self.values[name] / max(full, 1e-300)
            codes = (
                _SIGNED * (1.0 + np.clip(part, -1.0, 1.0))
                if kind.signed
                else _AMOUNT * np.clip(part, 0.0, 1.0)
            )
            found[name] = _differences(np.rint(codes).astype(np.uint8))
            scales[name] = {"limit": limits[name], "range": full, "signed": kind.signed}
        return found, scales


def _recorded(run: Run, times: Array) -> _Recorded:
    scenario, outcome = run.scenario, run
    lattice, springs, wall = (
        scenario.lattice,
        scenario.model.springs,
        scenario.model.wall,
    )
    triangles, n, columns = Triangles(lattice), lattice.disk_points, outcome.columns
    rest, looks = lattice.positions, scale_times(scenario, columns)
    motion, displacements, forces = [], [], []
    values: dict[str, list[NDArray[np.float32]]] = {name: [] for name in QUANTITIES}
    limits, largest = dict.fromkeys(QUANTITIES, 0.0), 0.0
    left, right, low, high = scenario.view
    every = np.unique([*times, *looks])
    for t, (_, x, v) in zip(every, outcome.frames(every), strict=True):
        raise_if_interrupted()
        shown = {
            name: colour_values(name, triangles, springs, x, v) for name in QUANTITIES
        }
        pushes = contact_forces(wall, lattice, springs, x, v)
        if t in looks:
            limits = {
                name: max(limits[name], full_scale(shown[name][:n], name))
                for name in QUANTITIES
            }
            if t == looks[-1]:
                flattest = flattening(lattice, x)
                largest = float(np.hypot(*pushes[:, 1:].T).max(initial=0.0))
        if t in times:
            centre, angle = x[:n].mean(axis=0), roll_angle(rest[:n], x[:n])
            moved = x - rest
            moved[:n] = (
                turned(x[:n], -angle) - centre - (rest[:n] - rest[:n].mean(axis=0))
            )
            motion.append([*centre, angle])
            displacements.append(moved)
            forces.append(pushes)
            for name, one in shown.items():
                values[name].append(one)
            (xmin, _), (xmax, ymax) = x[:n].min(axis=0), x[:n].max(axis=0)
            left, right, high = (
                min(left, xmin - 0.05),
                max(right, xmax + 0.05),
                max(high, ymax),
            )
    moves = np.array(motion)
    moves[:, 2] = np.unwrap(moves[:, 2])
    centres = np.column_stack(
        [np.interp(times, columns["t"], columns[name]) for name in ("com_x", "com_y")]
    )
    stacked = {name: np.array(states) for name, states in values.items()}
    view = [float(one) for one in (left, right, low, high)]
    return _Recorded(
        moves,
        np.array(displacements),
        forces,
        stacked,
        limits,
        flattest,
        largest,
        centres,
        view,
    )


def _differences(states: Array) -> Array:
    """Return the differences (T, ...) of successive states, which are small and so
    compress well; integers wrap."""
    return np.diff(states, axis=0, prepend=np.zeros_like(states[:1]))
