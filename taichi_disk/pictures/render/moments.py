"""Choose the moments of runs for films and stills, and the words of each picture."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import repeat
from typing import Any

import numpy as np

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.computation.contact import contacts_of
from taichi_disk.experiments.computation.outcome import Outcome
from taichi_disk.experiments.computation.words import Lines
from taichi_disk.mechanics.lattice import Array
from taichi_disk.pictures.plot import last_motion

Run = Outcome
Runs = Sequence[Run]

BEFORE = "before t = 0"
AFTER = "after t = {:.1f} R/c"
# the remarks on motion that is not shown, see `plot.AT_REST`
NEARLY_AT_REST = ("less than 1 %", "of the speed is left", "speed < 1 %")
MOMENTS = {"greatest": "greatest compression", "contact": "first contact", "end": ""}
# fractions of a film: still pictures at the start, at the greatest compression and at
# the end
_START = 0.035
_PAUSE = 0.05
_END = 0.15
BESIDE_CONTACT = (
    0.32  # time of the curves before and after a contact, over its duration
)
_AROUND_CONTACT = 0.06  # shown in slow motion, too; over the duration of the contact
_FLIGHT = 0.12  # film time of a flight over that of the contact
_FLYING_END = 0.05  # the end of an impact, whose result is shown since the contact
_RINGING_FLIGHT = 0.28  # a second flight in which a ringing is shown
# time in which the pace of several bounces doubles, over the duration of a contact
_RAMP = 0.15
LOWERED = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_CHANGE = 0.2  # fraction of a flight in which the pace changes
# samples of the pace of a whole film; a film of a part of the run keeps this pace
_PACE_TIMES = 1000
# A pace up to this factor above the slowest is called slow motion, if the flights are
# this many times faster.
SLOW = 1.1
MUCH_SLOWER = 1.5
# A ringing is shown so strong that it stores this fraction, as an amplitude, of the
# greatest compression, but at most MAX_RINGING times as strong as it is. It is not
# shown stronger if it would have to be more than FAINT times, or if dashpots take more
# than the fraction DAMPED of its energy from the end of the contact to the run's end.
RINGING = 0.5
MAX_RINGING = 6
FAINT = 10
DAMPED = 0.1
EASE = 0.7  # until a ringing is as strong [s]
_NEAR_PEAK = 0.01  # relative distance of times that count as the same moment


@dataclass(frozen=True)
class Caption:
    """A picture of one run: its time [R/c] and all of its changing words. `lines` begin
    with the time and the number that stands for the main curve. `pace`: of the film;
    `ringing`: factor by which it is shown stronger, which grows to that of the
    `remarks`, a long one in two lines and a short one."""

    t: float
    note: str = ""
    pace: Lines = ()
    lines: Lines = ()
    result: str = ""
    ringing: float = 1.0
    remarks: Lines = ()


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
Shots = Sequence[Caption]  # the pictures of one run


def time_of(moment: Any, run: Run) -> float:
    """Return the time [R/c] of a moment. Raises InputError for a time outside the run
    or an unknown word."""
    last = run.end
    named = {
        "greatest": run.contact.greatest,
        "contact": run.contact.first_sample,
        "end": last,
    }
    t = np.nan
    with suppress(TypeError, ValueError, OverflowError):
        t = float(named.get(moment, moment))
    if not 0.0 <= t <= last * (1.0 + 1e-12):
        raise InputError(
            f"no moment {moment}: write {', '.join(MOMENTS)}, or a time within the run,"
            f" 0 to {last:.6g} R/c; a larger impact.gap ends an impact later"
        )
    return min(t, last)


# ---- the pace of a film


def curve_span(run: Run) -> tuple[float, float]:
    """Return the first and last time of the curves beside a film [R/c]."""
    last = film_end(run)
    if not run.scenario.is_thrown or run.scenario.falls_back:
        return float(run.series["t"][0]), last
    contact = run.contact
    beside = BESIDE_CONTACT * (contact.end - contact.start)
    return contact.start - beside, min(contact.end + beside, last)


def film_end(run: Run) -> float:
    """Return the end of a film without a flight [R/c]."""
    if run.scenario.is_thrown:
        return run.end
    return last_motion(run.series)


def film_times(
    whole: tuple[float, float], runs: Runs, longest: Run, second_flight: float
) -> Array:
    """Return the times (_PACE_TIMES,) [R/c] of a film over the times `whole`, at a pace
    that changes smoothly from the flights to the slow motion of the contact.
    `second_flight`: its film time over that of the contact."""
    if longest.scenario.falls_back:
        return _times_of_bounces(longest)
    if not longest.scenario.is_thrown:
        return np.linspace(*whole, _PACE_TIMES)
    first = min(run.contact.start for run in runs)
    second = max(run.contact.end for run in runs)
    beside = _AROUND_CONTACT * (second - first)
    first, second = np.clip([first - beside, second + beside], *whole)
    t = np.linspace(*whole, _PACE_TIMES)
    flight = np.where(t < first, first - whole[0], whole[1] - second)
    away = np.abs(t - np.clip(t, first, second))
    part = np.minimum(away / np.maximum(_CHANGE * flight, 1e-9), 1.0)
    # The pace, over the slowest, grows up to `fastest` evenly in the film's time, so
    # its square does in the run's.
    film_time = np.where(t < first, _FLIGHT, second_flight) * (second - first)
    fastest = np.maximum((1.0 + _CHANGE) * flight / film_time, 1.0)
    return _at_pace(t, np.sqrt(1.0 + part * (fastest**2 - 1.0)))


def _times_of_bounces(run: Run) -> Array:
    """Return the times (_PACE_TIMES,) [R/c] of a film of several bounces, whose pace
    grows with the time to the nearest contact."""
    t = np.linspace(0.0, run.end, 20 * _PACE_TIMES)
    contacts = contacts_of(run.series)
    away = [np.abs(t - np.clip(t, one.start, one.end)) for one in contacts]
    quicker = np.min(away, axis=0) / (_RAMP * (run.contact.end - run.contact.start))
    return _at_pace(t, 1.0 + quicker)


def _at_pace(t: Array, pace: Array) -> Array:
    """Return the times (_PACE_TIMES,) [R/c] of a film that passes the times `t` with a
    `pace`, over the slowest."""
    number = np.cumsum(1.0 / pace)
    return np.interp(np.linspace(number[0], number[-1], _PACE_TIMES), number, t)


def cues(
    runs: Runs,
    whole: tuple[float, float],
    frames: int,
    rate: float,
    span: Span,
    rings: bool,
) -> list[Caption]:
    """Return times, notes and paces of the pictures of a film, of which `rate` are
    shown in a second. Still pictures are repeated times.

    `whole`: first and last time of the whole film [R/c]; `rings`: whether a ringing is
    shown stronger. Raises InputError for an empty span.
    """
    second_flight = _FLIGHT
    if rings:
        second_flight = _RINGING_FLIGHT
    longest = max(runs, key=lambda run: run.end)
    first, last = whole
    if span.start is not None:
        first = time_of(span.start, longest)
    if span.end is not None:
        last = time_of(span.end, longest)
    if not first < last:
        raise InputError(
            f"a film must end after it begins; this one goes from {first:.6g} to"
            f" {last:.6g} R/c"
        )
    whole = whole[0], max(whole[1], last)
    last_part = _END
    if longest.scenario.is_thrown:
        last_part = _FLYING_END
    peak = longest.contact.greatest
    start = round(_START * frames) if first == whole[0] else 0
    pause = round(_PAUSE * frames) if first <= peak <= last else 0
    end = 0
    if last >= film_end(longest):
        end = max(round(last_part * frames), 1)
    moving = frames - start - pause - end
    # A part of a film keeps the pace of the whole.
    every = film_times(whole, runs, longest, second_flight)
    number = np.arange(_PACE_TIMES)
    begin, stop = np.interp([first, last], every, number)
    places = np.linspace(begin, stop, moving)
    times = np.interp(places, number, every)
    steps = np.gradient(every)
    slowest = steps.min()
    factor = float(steps.max() / slowest)
    greatest = int(np.abs(times - peak).argmin())
    if 0 < greatest < moving - 1:
        times[greatest] = peak
    held = np.zeros(moving, dtype=int)
    held[0] += start
    held[greatest] += pause
    held[-1] += end
    in_a_second = rate * (stop - begin) / max(moving - 1, 1)
    found = []
    paces = np.interp(places, number, steps)
    for t, step, stills in zip(times, paces, held, strict=True):
        pace: Lines = ()
        if longest.scenario.words.pace:
            rounded = float(f"{in_a_second * step:.2g}")
            pace = (longest.scenario.words.pace.format(rounded),)
            if step <= SLOW * slowest and factor > MUCH_SLOWER:
                pace += (f"slowed {factor:.0f} times",)
        found.append(Caption(t, pace=pace))
        note = MOMENTS["greatest"] if t == peak else ""
        found += repeat(Caption(t, note), stills)
    return found


def ringing(run: Run) -> float:
    """Return how many times stronger the vibration after an impact must be shown to be
    seen; 1 if it is strong enough, if dashpots have taken it, or if an elastic wall
    rings, too."""
    if not run.scenario.is_thrown or len(run.scenario.lattice.wall_surface):
        return 1.0
    if run.scenario.falls_back:
        return 1.0
    columns = run.series
    elastic = columns["elastic"]
    dissipated = columns["dissipated"]
    left = max(columns["vibration"][-1] + elastic[-1], 1e-300)
    lost = dissipated[-1] - np.interp(run.contact.end, columns["t"], dissipated)
    # half of the energy of a vibration is elastic
    factor = round(RINGING * math.sqrt(2.0 * elastic.max() / left))
    if factor > FAINT or lost > DAMPED * left:
        return 1.0
    return float(max(min(factor, MAX_RINGING), 1))


def captions(
    run: Run, shots: Shots, stronger: float = 1.0, ease: float = 1.0
) -> list[Caption]:
    """Return the pictures `shots` with the words of `run`. `stronger`: factor of its
    `ringing`, which grows from 1 over `ease` pictures."""
    columns = run.series
    scenario: Any = run.scenario
    peak = run.contact.greatest
    _, curves_end = curve_span(run)
    results = [scenario.words.marks[0].format(**scenario.result(columns))]
    ends = [curves_end]
    if scenario.is_thrown:
        ends = [one.end for one in contacts_of(columns)]
    if scenario.falls_back:
        results = []
        for number, e in enumerate(scenario.restitutions(columns), 1):
            results.append(f"e{number} = ".translate(LOWERED) + f"{e:.3f}")
    times = [shot.t for shot in shots]
    rows = {name: np.interp(times, columns["t"], columns[name]) for name in columns}
    found = []
    after = 0  # number of pictures since the result
    for k, shot in enumerate(shots):
        row = {name: values[k] for name, values in rows.items()}
        time, *lines = scenario.caption(row | {"t": shot.t})
        note = shot.note
        shown_result = ""
        remarks: Lines = ()
        if shot.t < 0.0:
            time = BEFORE
        if scenario.is_thrown and shot.t > curves_end:
            time = AFTER.format(curves_end)
        if shot.t >= ends[0]:
            known = bisect_right(ends, shot.t)
            shown_result = results[:known][-1]
            after += 1
            if film_end(run) < run.end:
                remarks = NEARLY_AT_REST
            if len(lines) == 1 and not scenario.falls_back:
                lines = []  # the result is the same number with more digits
            if stronger > 1.0:
                long = f"shown {stronger:g} times stronger"
                remarks = "the ringing,", long, f"ringing × {stronger:g}"
        if note == MOMENTS["greatest"] and abs(shot.t - peak) > _NEAR_PEAK * peak:
            note = ""  # the moment of another run
        part = min(after / ease, 1.0)
        found.append(
            replace(
                shot,
                note=note,
                lines=(time, *lines),
                result=shown_result,
                ringing=stronger ** (part * part * (3.0 - 2.0 * part)),
                remarks=remarks,
            )
        )
    return found


# ---- comparisons of runs

MAX_RUNS = 4


def titles(runs: Runs, labels: Sequence[str]) -> list[Lines]:
    """Return the title lines of each run. The first line of compared runs is one of
    `labels`, or else names the parameters in which the runs differ.

    Raises InputError for wrong labels, or for runs that cannot be compared.
    """
    for label in labels:
        if not isinstance(label, str) or not label.strip() or not label.isprintable():
            raise InputError(f"label {label!r:.60}: must be text that can be printed")
    if labels and len(labels) != len(runs):
        raise InputError(
            f"{len(labels)} labels for {len(runs)} runs: give one for each run"
        )
    if len(runs) > MAX_RUNS:
        raise InputError(f"{len(runs)} runs side by side: compare {MAX_RUNS} at most")
    words = [run.scenario.words for run in runs]
    if len({(one.time, *one.labels) for one in words}) > 1:
        raise InputError(
            "these runs cannot be compared: they differ in the meaning of time or in"
            " their results"
        )
    names = list(labels) or [one.title[0] for one in words]
    if not labels and len(set(names)) == 1:
        parameters = ["    ".join(one.title[1:]).split("    ") for one in words]
        common = set(parameters[0]).intersection(*parameters)
        for k, parts in enumerate(parameters):
            differing = [part for part in parts if part not in common]
            names[k] = "    ".join(differing) or names[k]
    return [(name, *one.title[1:]) for name, one in zip(names, words, strict=True)]
