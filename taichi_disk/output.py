"""Result files: a folder that can be written, and files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

from taichi_disk.errors import InputError, SimulationError


def prepare_output(out: Path) -> None:
    """Make the folder `out`, or prove that the one that exists can be written.

    Raises InputError, with nothing left behind, when a file is in the way or the place is not writable.
    """
    created: list[Path] = []
    try:
        missing = [folder for folder in (out, *out.parents) if not folder.exists()]
        for folder in reversed(missing):
            folder.mkdir()
            created.append(folder)
        probe = _beside(out / "probe")
        probe.touch(exist_ok=False)
        probe.unlink()
    except (OSError, ValueError) as error:
        for folder in reversed(created):
            folder.rmdir()
        blocker = next((path for path in (out, *out.parents) if path.is_file()), None)
        reason = f"{blocker} is a file" if blocker else _reason(error)
        raise InputError(f"cannot write into the output folder {out}: {reason}; choose another with --out") from None


def atomic_write(path: Path, writer: Callable[[Path], None]) -> None:
    """Let `writer` fill a file (or make a folder of pictures) beside `path`, same suffix, then rename it to `path`.

    If the writer fails or is interrupted, what is beside is removed and `path` stays as it was. Raises
    SimulationError when the disk is full or the folder has become read-only; the writer's other errors pass.
    """
    beside = _beside(path)
    try:
        writer(beside)
        if beside.is_dir():
            remove_pictures(path)
        os.replace(beside, path)
    except OSError as error:
        raise SimulationError(f"cannot write {path}: {_reason(error)}") from error
    finally:
        remove(beside)


def remove(path: Path) -> None:
    """Remove a file or folder if that can be done. Where its place has become out of reach, that was told already."""
    shutil.rmtree(path, ignore_errors=True)
    with contextlib.suppress(OSError):
        path.unlink()


def check_pictures(folder: Path) -> None:
    """Raise InputError if `folder` is there and is not a folder with nothing but numbered PNGs."""
    if not folder.exists():
        return
    if not folder.is_dir() or not all(re.fullmatch(r"\d+\.png", one.name) for one in folder.iterdir()):
        raise InputError(f"{folder} is not a folder of a film's pictures alone: remove it, or choose another")


def remove_pictures(folder: Path) -> None:
    """Remove a folder of numbered PNGs, if it is there; `check_pictures` says what may be raised."""
    check_pictures(folder)
    if folder.exists():
        shutil.rmtree(folder)


def _beside(path: Path) -> Path:
    # NumPy and ffmpeg go by the suffix, so that it has to stay at the end.
    return path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")


def _reason(error: BaseException) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)
