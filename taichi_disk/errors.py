"""What can go wrong, as values that carry their advice; the command line turns each into an exit status."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable
from typing import Any


class TaichiDiskError(Exception):
    """Base of every error that a user is meant to read."""

    exit_status = 1


class InputError(TaichiDiskError):
    """A scene, an option or a path that cannot be used. Nothing has been computed or written."""

    exit_status = 2


class SimulationError(TaichiDiskError):
    """The computation was begun and could not be finished: a blow-up, no convergence, no separation in time."""


def pip_install(what: str) -> str:
    """Return the command that installs `what`, in quotes, into the environment that runs this program."""
    return f"{sys.executable or 'python'} -m pip install '{what}'"


def nearest(word: Any, names: Iterable[str]) -> list[str]:
    """The nearest of `names`, whatever its case; empty if none is near."""
    by_lower = {name.lower(): name for name in names}
    near = difflib.get_close_matches(str(word).lower(), by_lower, n=1) if isinstance(word, str) else []
    return [by_lower[one] for one in near]


def did_you_mean(word: Any, names: Iterable[str]) -> str:
    """The end of a message: the nearest of `names`, or nothing."""
    return "".join(f"; did you mean {near}?" for near in nearest(word, names))


def either(names: Iterable[str]) -> str:
    """The names in words: a, b or c."""
    *first, last = names
    return f"{', '.join(first)} or {last}" if first else last
