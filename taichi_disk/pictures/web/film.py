"""A film that can be played with: one HTML file that holds the states of runs and the
modules that draw them."""

from __future__ import annotations

import json
import zlib
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.errors import NOTICES
from taichi_disk.base.files import write_text
from taichi_disk.base.progress import Progress
from taichi_disk.base.signals import raise_if_interrupted
from taichi_disk.experiments.computation.contact import contacts_of
from taichi_disk.experiments.computation.words import Lines
from taichi_disk.experiments.config.sections import VideoSection
from taichi_disk.mechanics.fields import QUANTITIES, Triangles
from taichi_disk.mechanics.lattice import Array
from taichi_disk.pictures.plot import axis_labels, curves
from taichi_disk.pictures.render.film import FEWEST_PICTURES, film_origin, storyboard
from taichi_disk.pictures.render.moments import (
    MOMENTS,
    WHOLE,
    Caption,
    Run,
    Runs,
    Shots,
    Span,
    curve_span,
    time_of,
    titles,
)
from taichi_disk.pictures.render.recording import Recording, Scales
from taichi_disk.pictures.web.drawing import (
    FILM,
    Message,
    bundle,
    colour_values,
    contact_forces,
    scene_message,
    source,
)
from taichi_disk.pictures.web.throws import (
    MOST_POINTS,
    TOO_LARGE,
    throwable,
    thrown_disk,
)

_LEVELS = 32_000  # levels of a displacement on either side of zero
# codes of a colour for zero and for the largest value
_SIGNED = 127, 254
_AMOUNT = 0, 255
_STATES = 300_000  # approximate number of points in all states of a file together
_FEWEST = 40  # fewest states, for a large disk; the page interpolates between them


def write_page(
    path: Path,
    runs: Runs,
    video: VideoSection,
    progress: Progress,
    span: Span = WHOLE,
    labels: Sequence[str] = (),
) -> None:
    """Write a page (.html) that plays the states of `runs` side by side. Arguments and
    errors are those of `render.film.draw_film`.

    A page needs no Vulkan.
    """
    names = titles(runs, labels)
    points = max(len(run.scenario.lattice.positions) for run in runs)
    _, fps = video.size_and_rate("html")
    wanted = max(round(fps * video.seconds), FEWEST_PICTURES)
    frames = min(wanted, max(_STATES // points, _FEWEST))
    rate = fps * frames / wanted  # pictures in a second
    flights, _, words = storyboard(runs, video, span, frames, rate)
    progress("render", 0, len(runs))
    times = [caption.t for caption in words[0]]
    states = [Recording(one, times, list(QUANTITIES)) for one in flights]
    again = None
    elsewhere = ""
    if len(runs) == 1 and span == WHOLE and throwable(flights[0]):
        again = thrown_disk(flights[0], video)
        if not again:
            elsewhere = TOO_LARGE
    if video.goal != "none" and not again:
        NOTICES.warning(
            "video.goal: no task, because this page throws no disk: a page throws one"
            f" disk of at most {MOST_POINTS:,} points at a rigid wall, without gravity,"
            " friction, angle or spin"
        )
    packed = _packed(states, words, video, names, rate, again, progress)
    text = Template(source("film.html")).substitute(
        title=escape(" | ".join(title[0] for title in names)),
        origin=escape(film_origin(runs, video)),
        elsewhere=escape(elsewhere),
        states=b64encode(packed).decode(),
        style=source("style.css") + source("film.css"),
        script=bundle(*FILM),
    )
    write_text(path, text)
    progress("render", len(runs), len(runs))


def _packed(
    states: Sequence[Recording],
    words: Sequence[Shots],
    video: VideoSection,
    names: Sequence[Lines],
    rate: float,
    again: Message | None,
    progress: Progress,
) -> bytes:
    """Return the compressed head, in JSON, and the arrays of all runs.

    `again`: the disk that the page throws itself, instead of recorded states.
    """
    common = Scales.of(states, video.magnify)
    video = replace(video, magnify=common.magnify)
    shared = {"view": common.view, "full_force": common.full_force}
    data = b""
    runs = []
    for k, (one, title, shots) in enumerate(zip(states, names, words, strict=True)):
        progress("render", k, len(states))
        arrays: dict[str, Array] = {}
        facts: Message = {}
        if not again:
            arrays, facts = _recorded(one, common.limits)
        places = {}
        for name, array in arrays.items():
            data += bytes(_padding(data))
            places[name] = len(data), array.size
            data += array.tobytes()
        scene = scene_message(one.run.scenario, video, one.largest_force)
        runs.append(
            {
                "scene": scene | shared | {"title": title},
                "states": len(one.times),
                "captions": [_words(each) for each in shots],
                "strengths": [each.ringing for each in shots],
                "full_speed": one.full_speed,
                "arrays": places,
                **facts,
            }
        )
    times = [caption.t for caption in words[0]]
    labels = states[0].run.scenario.words
    head = {
        "fps": rate,
        "cues": np.searchsorted(states[0].times, times).tolist(),
        "marks": _marks(states[0].run, times),
        "titles": [label.replace("  ", " ") for label in axis_labels(labels)],
        "times": [float(f"{t:.5g}") for t in states[0].times],
        "end": max(curve_span(one.run)[1] for one in states),
        "unit": labels.time.split()[-1].strip("[]"),
        "curves": _curves(states),
        "runs": runs,
        "again": again,
    }
    text = json.dumps(head).encode()
    text += b" " * _padding(text)
    length = np.array([len(text)], "<u4").tobytes()
    return zlib.compress(length + text + data, 9)


def _padding(data: bytes) -> int:
    """Return the number of bytes to add to `data` before a typed array of JavaScript,
    with four bytes an item, can begin."""
    return -len(data) % 4


def _words(caption: Caption) -> list[str]:
    """Return the lines of a caption: time, motion (`+`) or result (`*`), …, note, pace
    and remark."""
    time, *others = caption.lines
    motion = [f"+{one}" for one in others[:1]]
    if caption.result:
        motion = [f"*{caption.result}"]
    return [
        time,
        *motion,
        *others[1:],
        caption.note,
        "    ".join(caption.pace),
        " ".join(caption.remarks[:2]),
    ]


def _marks(run: Run, times: Sequence[float]) -> list[list[Any]]:
    """Return each mark of the time line: the number of its cue, and the bounce or the
    moment that it stands for."""
    moments = {MOMENTS[one]: time_of(one, run) for one in ("contact", "greatest")}
    if run.scenario.falls_back:
        contacts = enumerate(contacts_of(run.series), 1)
        moments = {f"{number}": one.greatest for number, one in contacts}
    return [
        [int(np.searchsorted(times, t)), name]
        for name, t in moments.items()
        if times[0] < t < times[-1]
    ]


def _curves(states: Sequence[Recording]) -> list[Message]:
    """Return the curves of the runs at the times of the states: panel, name, colours on
    a light and a dark ground, values."""
    found = []
    for number, one in enumerate(states):
        columns = one.run.series
        for curve in curves(one.run.scenario, columns):
            values = np.interp(one.times, columns["t"], curve.values)
            found.append(
                {
                    "panel": curve.look.panel,
                    "run": number,
                    "name": curve.name,
                    "colours": curve.look.colours,
                    "values": [float(f"{value:.4g}") for value in values],
                }
            )
    return found


def _recorded(
    states: Recording, limits: dict[str, float]
) -> tuple[dict[str, Array], Message]:
    """Return the arrays to pack, by name, and what the page has to know about them.

    centres and velocities (T, 2) belong to the centre of mass [R], [c]; forces are the
    `contact_forces` of the states, one after the other. Integers hold changes between
    states: displacements, with all low bytes before the high ones, and each quantity.
    """
    scenario = states.run.scenario
    lattice = scenario.lattice
    triangles = Triangles(lattice)
    moved = []
    forces = []
    centres = []
    velocities = []
    values: dict[str, list[NDArray[np.float32]]] = {name: [] for name in QUANTITIES}
    for _, x, v in states.states():
        raise_if_interrupted()
        moved.append(x - lattice.positions)
        forces.append(contact_forces(scenario, x, v))
        centres.append(lattice.mean(x))
        velocities.append(lattice.mean(v))
        for name, each in values.items():
            each.append(colour_values(name, triangles, scenario.model.springs, x, v))
    unit = max(float(np.abs(moved).max()), 1e-9) / _LEVELS
    levels = np.rint(np.array(moved) / unit).astype("<i2")
    steps = _differences(levels).view(np.uint8)
    arrays = {
        "centres": np.array(centres, dtype="<f4"),
        "velocities": np.array(velocities, dtype="<f4"),
        "forces": np.concatenate(forces).astype("<f4"),
        "displacements": np.stack([steps[..., 0::2], steps[..., 1::2]]),
    }
    scales = {}
    for name, kind in QUANTITIES.items():
        limit = limits[name]
        full = limit
        if name == "fringes":  # whose limit is the stress of one fringe
            full = float(np.max(values[name]))
        zero, highest = _AMOUNT
        if kind.signed:
            zero, highest = _SIGNED
        step = max(full, 1e-300) / (highest - zero)
        codes = np.clip(zero + np.array(values[name]) / step, 0.0, highest)
        arrays[name] = _differences(np.rint(codes).astype(np.uint8))
        scales[name] = {"limit": limit, "unit": step, "zero": zero}
    first = np.cumsum([0, *map(len, forces)]).tolist()
    return arrays, {"unit": unit, "first": first, "limits": scales}


def _differences(states: Array) -> Array:
    """Return the differences (T, ...) of successive states, which are small and so
    compress well; integers wrap."""
    return np.diff(states, axis=0, prepend=np.zeros_like(states[:1]))
