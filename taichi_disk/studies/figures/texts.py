"""Fits of a sweep's curves as text, for the terminal and for notebooks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from taichi_disk.base.files import Summary
from taichi_disk.studies.figures.curves import LAWS
from taichi_disk.studies.figures.theory import SIGNIFICANCE

# No sample of lattices says how their errors are distributed farther out.
LEAST_P_VALUE = 1e-6


def curve_rows(
    curves: Sequence[Summary],
) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield for each of `curves`, results of `Curve.summary`, its label and a list of
    (law, parameters), as text."""
    for curve in curves:
        keys = []
        for name, value in curve.items():
            if name == "lattices":  # numbers of the curve follow
                keys.append(f"lattices per point: {value}")
                break
            keys.append(f"{name}: {as_text(value)}")
        if curve["folded"]:
            keys.append(f"{curve['folded']} folded points in no fit")
        laws = []
        for name, fit in curve["fits"].items():
            parts = _parameters(fit)
            if fit["rms_residual"] is not None:  # it is a law that can be fitted
                parts.append(_verdict(fit, curve["lattices"]))
            laws.append((LAWS[name].title, "   ".join(parts)))
        yield ", ".join(keys), laws


def explanations(curves: Sequence[Summary]) -> Iterator[tuple[str, str]]:
    """Yield (law, meaning of its parameters) for each law of `curves`."""
    for name, law in LAWS.items():
        if any(name in curve["fits"] for curve in curves):
            yield law.title, law.meaning


def as_text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)


def _parameters(fit: Summary) -> list[str]:
    """Return each fitted parameter with its 95 % interval, or "none" if the law cannot
    be fitted."""
    parts = []
    for name, value in fit["values"].items():
        if value is None:
            parts.append(f"{name} = none")
            continue
        part = f"{name} = {value:.4g}"
        low, high = fit["intervals_95"].get(name, (None, None))
        if low is not None:
            part += f" [{low:.4g}, {high:.4g}]"
        parts.append(part)
    return parts


def _verdict(fit: Summary, lattices: int) -> str:
    p_value = fit["p_value"]
    if p_value is None:
        return "not tested: too few lattices or points, or no scatter"
    if p_value < SIGNIFICANCE:
        words = f"p = {p_value:.2g}"
        if p_value < LEAST_P_VALUE:
            words = f"p < {LEAST_P_VALUE:g}"
        return f"refuted ({words}): off by {fit['rms_residual']:.2g} (rms)"
    return f"not refuted by {lattices} lattices (p = {p_value:.2g})"
