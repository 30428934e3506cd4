"""Fits of a sweep's curves as text, for the terminal and for notebooks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from taichi_disk.figures.curves import CURVE_KEYS, LAWS


def curve_rows(
    curves: Sequence[dict[str, Any]],
) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield for each of `curves`, results of `Curve.summary`, its label and a list of
    (law, parameters), as text."""
    for curve in curves:
        keys = []
        for name, value in curve.items():
            if name not in CURVE_KEYS:
                keys.append(f"{name}: {_as_text(value)}")
        keys.append(_counted(curve["lattices"]))
        laws = []
        for name, fit in curve["fits"].items():
            laws.append((LAWS[name].title, _fit_text(fit)))
        yield ", ".join(keys), laws


def _as_text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    return str(value)


def _counted(lattices: int) -> str:
    if lattices == 1:
        return "1 lattice"
    return f"{lattices} lattices"


def _fit_text(fit: dict[str, Any]) -> str:
    """Return the fitted parameters with their 95 % intervals, "none" if the law cannot
    be fitted, and whether it holds."""
    parts = []
    for name, value in fit["values"].items():
        if value is None:
            parts.append(f"{name} = none")
            continue
        part = f"{name} = {value:.4g}"
        low, high = fit["intervals_95"].get(name, (None, None))
        if low is not None and high is not None:
            part += f" [{low:.4g}, {high:.4g}]"
        parts.append(part)
    if not fit["holds"]:
        parts.append(
            f"rms {fit['rms_residual']:.2g}, chi square {fit['chi_square']:.3g} for 1:"
            " the law does not hold here"
        )
    return "   ".join(parts)
