"""Messages for the user: exceptions, which the command line turns into an exit status,
and notices."""

from __future__ import annotations

import difflib
import logging
import os
import re
import sys
from collections.abc import Iterable
from importlib.util import find_spec
from numbers import Integral
from typing import Any

from taichi_disk.base.machine import foreign_packages

# The command line prints all notices. Python prints warnings to stderr, and the others
# after `logging.basicConfig(level="INFO")`.
NOTICES = logging.getLogger("taichi_disk")


class TaichiDiskError(Exception):
    """Base class of all errors with a message for the user."""

    exit_status = 1


class InputError(TaichiDiskError):
    """A scene, option or path is invalid. Nothing has been computed or written."""

    exit_status = 2


class SimulationError(TaichiDiskError):
    """The computation could not be finished: a blow-up, no convergence, or no
    separation within the time limit."""


class NoPictures(TaichiDiskError):
    """This machine cannot draw pictures. It can still write pages."""


def by_kind(texts: Iterable[str]) -> list[tuple[str, int]]:
    """Return the first of the `texts` that differ only in numbers, and how many there
    are, for each kind."""
    kinds: dict[str, list[str]] = {}
    for text in texts:
        kind = re.sub(r"[-+]?\d[-+.e\d]*", "", text)
        kinds.setdefault(kind, []).append(text)
    return [(alike[0], len(alike)) for alike in kinds.values()]


def pip_install(what: str) -> str:
    """Return the command that installs `what`, in quotes, into the environment that
    runs this program: by uv if that environment has no pip, as uv makes it."""
    python = sys.executable or "python"
    if find_spec("pip") is None:
        return f"uv pip install --python {python} '{what}'"
    return f"{python} -m pip install '{what}'"


def nearest(word: Any, names: Iterable[str]) -> list[str]:
    if not isinstance(word, str):
        return []
    by_lower = {name.lower(): name for name in names}
    matches = difflib.get_close_matches(word.lower(), by_lower, n=1)
    return [by_lower[match] for match in matches]


def did_you_mean(word: Any, names: Iterable[str]) -> str:
    return "".join(f"; did you mean {name}?" for name in nearest(word, names))


def either(names: Iterable[str]) -> str:
    """Join names to "a, b or c"."""
    *first, last = names
    if not first:
        return last
    return f"{', '.join(first)} or {last}"


def printable(text: str, width: int = 40) -> str:
    """Escape characters that a terminal cannot show, and cut the text at `width`
    characters."""
    if not text.isprintable():
        text = ascii(text)[1:-1]
    if len(text) > width:
        return text[: width - 3] + "..."
    return text


def whole_number(
    value: Any, name: str, most: int, least: int = 1, meaning: str = ""
) -> int:
    """Return an integer of Python or NumPy from `least` to `most` as an int. Raises
    InputError with its `name`, and the `meaning` of `most`."""
    is_whole = isinstance(value, Integral) and not isinstance(value, bool)
    if is_whole and least <= int(value) <= most:
        return int(value)
    raise InputError(
        f"{name}: must be a whole number from {least} to {most:,}{meaning}, not"
        f" {value!r}"
    )


def check_flags(**flags: Any) -> None:
    for name, flag in flags.items():
        if not isinstance(flag, bool):
            raise InputError(f"{name}: must be True or False, not {flag!r:.60}")


def shown_path(path: object) -> str:
    """Return a path for a message, whole unless it is absurdly long."""
    return printable(str(path), width=1000)


def reason(error: BaseException) -> str:
    """Return the message of `error`; for an OSError only the system's words, because
    the caller names the file. That of an ImportError names packages from elsewhere."""
    # If a part of a package is missing, a file of the user's may hide the package.
    if isinstance(error, ModuleNotFoundError) and "." not in str(error.name):
        return f"it needs {error.name}: {pip_install(str(error.name))}"
    if isinstance(error, ImportError) and foreign_packages():
        return f"{' '.join(str(error).split())} ({foreign_packages()})"
    if not isinstance(error, OSError):
        return str(error)
    if isinstance(error, FileNotFoundError) and not _has_working_folder():
        return "the working folder has been deleted: change to another one"
    text = error.strerror or str(error)
    if "temporary directory" in text:  # a container whose disk is read-only has none
        text += "; TMPDIR names another folder"
    return text


def described(error: BaseException) -> str:
    """Return the message of an error of this package, and of another error the kind and
    the message."""
    if isinstance(error, TaichiDiskError):
        return str(error)
    return f"{type(error).__name__}: {error}"


def system_message(error: Exception) -> str:
    """Return `reason(error)` with the file, if the system names one."""
    file = getattr(error, "filename", None)
    if file is None:
        return reason(error)
    return f"{file}: {reason(error)}"


def _has_working_folder() -> bool:
    try:
        os.getcwd()
    except OSError:
        return False
    return True
