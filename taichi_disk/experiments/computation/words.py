"""The names of the quantities of a scenario, for films, plots, tables and messages."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

Numbers: TypeAlias = dict[str, float]  # results, errors or observables by name
Pair: TypeAlias = tuple[str, str]  # such as a name and its unit
Lines: TypeAlias = tuple[str, ...]  # texts, one below another


@dataclass(frozen=True, kw_only=True)
class Words:
    """What films, plots, tables and messages call the quantities of a scenario. Labels
    of axes end with the unit in brackets.

    Attributes:
        title: lines of films and plots: the scene and its parameters.
        symbol: of the primary result.
        labels: name and unit of each number of `result` that is shown.
        measured: how each number of `result` was measured.
        marks: texts for the end of `motion` and for the wall's force, in which the
            numbers of `result` are filled in.
        motion: label of the axis of `motion`.
        momentary: name and unit of `momentary_motion`.
        time: label of the axis of `t`.
        quality: label and scale, "linear" or "log", of the axis of `quality`.
        pace: the film's time scale, in which the time per second is filled in; "": `t`
            is no time.
        truncation_remedy: advice on how to make `end_truncation_error` smaller.
    """

    title: Lines
    symbol: str = ""
    labels: dict[str, Pair]
    measured: dict[str, str] = field(default_factory=dict)
    marks: Pair = ("", "")
    motion: str
    momentary: Pair = ("velocity upwards", "c")
    time: str = "time  [R/c]"
    quality: Pair = ("energy imbalance", "linear")
    pace: str = "1 s = {:g} R/c"
    truncation_remedy: str = ""
