"""Choose the moments of a run for films and stills, and the text of each picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_disk.computation.contact import CONTACT_LEVEL, greatest_compression
from taichi_disk.computation.outcome import Outcome
from taichi_disk.computation.scenario import Scenario
from taichi_disk.errors import InputError
from taichi_disk.lattice import Array

Run = Outcome
# t [R/c] and the last line of text, or None to show the result
Cue = tuple[float, str | None]

MOMENTS = {"greatest": "greatest compression", "contact": "first contact", "end": None}
# fractions of a film that pause at the greatest compression and at the end
_PAUSE, _END = 0.06, 0.10
# number of times before the greatest compression that determine the colour scale
_SCALE_TIMES = 12
# samples of the pace of a whole film; a film of a part of the run keeps this pace
_PACE_TIMES = 1000


@dataclass(frozen=True)
class Span:
    """Part of a run: the moment `at` of a still, `start` and `end` of a film (by
    default the whole run).

    A moment is a time [R/c] (for quasi-static loading the fraction of the load), or one
    of MOMENTS.
    """

    at: float | str = "greatest"
    start: float | str | None = None
    end: float | str | None = None


WHOLE = Span()


def time_of(moment: Any, columns: dict[str, Array]) -> float:
    """Return the time [R/c] of a moment. Raises InputError for a time outside the run
    or an unknown word."""
    last, force = float(columns["t"][-1]), columns["wall_force"]
    if moment == "greatest":
        return greatest_compression(columns)
    if moment == "contact":
        return float(columns["t"][int((force >= CONTACT_LEVEL * force.max()).argmax())])
    try:
        t = last if moment == "end" else float(moment)
    except (TypeError, ValueError):
        t = np.nan
    if not 0.0 <= t <= last * (1.0 + 1e-12):
        raise InputError(
            f"no moment {moment}: write {', '.join(MOMENTS)}, or a time within the run,"
            f" 0 to {last:.6g} R/c"
        )
    return min(t, last)


def cues(runs: Sequence[Run], frames: int, fps: int, span: Span) -> list[Cue]:
    """Return the cues of a film, which follow the run that lasts longest. A pause is a
    repeated time.

    Raises InputError for an empty span.
    """
    count = max(3, frames)
    longest = max(runs, key=lambda run: float(run.columns["t"][-1]))
    scenario, columns = longest.scenario, longest.columns
    first = 0.0 if span.start is None else time_of(span.start, columns)
    last = time_of("end" if span.end is None else span.end, columns)
    if not first < last:
        raise InputError(
            f"a film must end after it begins; this one goes from {first:.6g} to"
            f" {last:.6g} R/c"
        )
    peak, whole = greatest_compression(columns), last == columns["t"][-1]
    has_peak = first <= peak <= last
    pause = round(_PAUSE * count) if has_peak else 0
    end = max(round(_END * count), 1) if whole else 0
    times = scenario.frame_times(columns, count - pause - end)
    if first > 0.0 or not whole:  # keep the pace of the whole film
        every, number = (
            scenario.frame_times(columns, _PACE_TIMES),
            np.arange(_PACE_TIMES),
        )
        begin, stop = np.interp([first, last], every, number)
        times = np.asarray(
            np.interp(np.linspace(begin, stop, count - pause - end), number, every)
        )
    greatest = int(np.abs(times - peak).argmin())
    if has_peak and greatest == len(times) - 1:
        pause, end = 0, pause + end
    elif has_peak and greatest > 0:
        times[greatest] = peak
    paces = [
        scenario.pace.format(float(f"{pace:.2g}")) for pace in fps * np.diff(times)
    ]
    found: list[Cue] = list(zip(times.tolist(), [*paces, *paces[-1:]], strict=True))
    still, result = (found[greatest][0], MOMENTS["greatest"]), (found[-1][0], None)
    return (
        found[: greatest + 1] + pause * [still] + found[greatest + 1 :] + end * [result]
    )


def still_cue(run: Run, span: Span) -> Cue:
    return time_of(span.at, run.columns), MOMENTS.get(str(span.at), "")


def lines(run: Run, cues: Sequence[Cue]) -> Iterator[tuple[str, ...]]:
    scenario, columns, times = run.scenario, run.columns, [t for t, _ in cues]
    peak = greatest_compression(columns)
    rows = {
        name: np.interp(times, columns["t"], values) for name, values in columns.items()
    } | {"t": times}
    for k, (t, note) in enumerate(cues):
        last = f"*{scenario.marks(columns)[0]}" if note is None else note
        if note == MOMENTS["greatest"] and abs(t - peak) > 0.01 * peak:
            last = ""  # the cue belongs to another run
        yield (
            *scenario.caption(
                {name: float(values[k]) for name, values in rows.items()}
            ),
            last,
        )


def scale_times(scenario: Scenario, columns: dict[str, Array]) -> list[float]:
    """Return the times [R/c], up to the greatest compression, that determine the scale
    of a film's colours."""
    peak = greatest_compression(columns)
    return [
        *[
            t
            for t in scenario.frame_times(columns, 2 * _SCALE_TIMES).tolist()
            if t < peak
        ][-_SCALE_TIMES:],
        peak,
    ]


# ---- comparisons of runs

_SYMBOLS = {
    "eta_star": "η*",
    "viscosity": "η",
    "velocity": "v",
    "friction": "μ",
    "points": "N",
    "pressure": "P",
}
MAX_RUNS = 4
_NOT_PHYSICAL = ("time", "video")  # sections that do not change the physics


def check_runs(runs: Sequence[Run]) -> None:
    if len(runs) > MAX_RUNS:
        raise InputError(f"{len(runs)} runs side by side: compare {MAX_RUNS} at most")
    if len({(run.scenario.time_label, *run.scenario.labels) for run in runs}) > 1:
        raise InputError(
            "these runs cannot be compared: they differ in the meaning of time or in"
            " their results"
        )


def titles(runs: Sequence[Run]) -> list[tuple[str, ...]]:
    scenes = [run.scenario.scene for run in runs]
    if len(runs) == 1 or len({scene.scene for scene in scenes}) > 1:
        return [run.scenario.title() for run in runs]
    parts: list[list[str]] = [[] for _ in runs]
    for name, section in scenes[0].sections().items():
        for one, key in section.schema().items():
            values = [getattr(getattr(scene, name), one) for scene in scenes]
            if name not in _NOT_PHYSICAL and len(set(values)) > 1:
                unit = (
                    key.unit[1:]
                    if key.unit.startswith("1/")
                    else f" {key.unit}"
                    if key.unit
                    else ""
                )
                for part, value in zip(parts, values, strict=True):
                    number = (
                        f"{value:g}{unit}" if isinstance(value, float) else f"{value}"
                    )
                    part.append(
                        f"{_SYMBOLS.get(one, one.replace('_', ' '))} = {number}"
                    )
    names = [run.scenario.title() for run in runs]
    return [
        ("    ".join(part) or name[0], *name[1:])
        for part, name in zip(parts, names, strict=True)
    ]
