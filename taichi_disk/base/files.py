"""Result files, which are written completely or not at all."""

from __future__ import annotations

import contextlib
import csv
import errno
import hashlib
import json
import os
import platform
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timezone
from functools import lru_cache
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from taichi_disk.base import engine
from taichi_disk.base.errors import InputError, SimulationError, reason
from taichi_disk.base.machine import processor
from taichi_disk.base.text_files import read_text
from taichi_disk.version import __version__

Summary = dict[str, Any]  # contents of summary.json
MARK = "summary.json"  # of a folder that holds a run
# after these errors a copy would fail, too
NO_ROOM = (errno.EACCES, errno.ENOSPC, errno.EROFS)
PROGRAM = f"taichi-disk {__version__}"
# files of a folder that holds a film's pictures, or a trajectory
NUMBERED = re.compile(r"\d+(_[a-z]+)?\.(png|vtu)")
# what operating systems, network file systems and office programs leave in folders
LITTER = re.compile(
    r"\.DS_Store|\._.*|Thumbs\.db|desktop\.ini|\.directory|@eaDir|\.nfs.*"
    r"|\.~lock\..*#",
    re.IGNORECASE,
)
# what other programs write while a run is computed, and which must stay
LOGS = re.compile(r".*\.log|slurm-.*\.out|\.snakemake_timestamp")
MAX_NAME = 150  # length of a name that leaves room for a prefix [bytes]


def prepare_output(out: Path) -> list[Path]:
    """Make the folder `out`, or check that the existing one is writable, and return the
    new folders, innermost first.

    Raises InputError, and leaves nothing behind, if a file is in the way or the place
    is not writable.
    """
    missing = []
    try:
        missing += [folder for folder in (out, *out.parents) if not folder.exists()]
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            return missing
    except (OSError, ValueError) as error:
        remove_empty(missing)
        raise cannot_write(out, error) from None


def remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.rmdir()


def cannot_write(out: Path, error: BaseException) -> InputError:
    blockers = [path for path in (out, *out.parents) if os.path.isfile(path)]
    why = reason(error)
    if blockers:
        why = f"{blockers[0]} is a file"
    return InputError(
        f"cannot write into the output folder {out}: {why}; choose another as `out`"
    )


# ---- atomic writing: files are written under a hidden name and then renamed


def hidden(path: Path) -> Path:
    """Return a hidden path beside `path`, unique to this process, with the same suffix
    (NumPy and encoders need it)."""
    return path.with_name(f".{platform.node()}-{os.getpid()}.new.{_short_name(path)}")


def _short_name(path: Path) -> str:
    """Return the name of `path`, or a hash of it if it is too long for a prefix."""
    name = os.fsencode(path.name)
    if len(name) <= MAX_NAME:
        return path.name
    return hashlib.sha256(name).hexdigest() + path.suffix[:MAX_NAME]


def atomic_write(path: Path, writer: Callable[[Path], object]) -> None:
    """Let `writer` fill a file (or a folder of numbered files) under a hidden name,
    then rename it to `path`.

    If the writer fails or is interrupted, what it wrote is removed and `path` stays as
    it was. Raises SimulationError if the disk is full or the folder has become
    read-only; the writer's other errors pass.
    """
    new = hidden(path)
    remove(new)  # left by a killed process with the same number
    try:
        writer(new)
        replace(new, path)
    except OSError as error:
        shown = str(path)
        # The user does not know the hidden folder in which a run is built.
        if path.parent.name.startswith("."):
            shown = path.name
        raise SimulationError(f"cannot write {shown}: {reason(error)}") from error
    finally:
        remove(new)


def replace(new: Path, path: Path) -> None:
    """Rename `new` to `path`. An existing folder is moved aside first and removed last.
    What cannot be renamed is copied, and so is a folder if `path` holds it, or logs."""
    if path.is_dir() and (
        path in new.parents or any(map(LOGS.fullmatch, os.listdir(path)))
    ):
        _copy_over(new, path)
        return
    try:
        if new.is_dir() and path.is_dir():
            remove(_displaced(path))
            os.rename(path, _displaced(path))
        os.replace(new, path)
    except OSError as error:
        restore(path)
        if error.errno in NO_ROOM:
            raise
        _copy_over(new, path)
    finally:
        restore(path)


def _copy_over(new: Path, path: Path) -> None:
    """Copy `new` to `path`, and remove it. Object stores, mount points and folders of a
    container's image cannot be renamed."""
    if new.is_file():
        shutil.copyfile(new, path)
    else:
        path.mkdir(exist_ok=True)
        # summary.json makes a folder a run: it goes first and comes last
        for name in sorted(listed(path), key=MARK.__ne__):
            if path / name != new:
                remove(path / name)
        for name in sorted(os.listdir(new), key=MARK.__eq__):
            copy(new / name, path / name)
    remove(new)


def copy(old: Path, new: Path) -> None:
    if old.is_dir():
        shutil.copytree(old, new)
    else:
        shutil.copyfile(old, new)


def restore(path: Path) -> None:
    """Put back the folder that a killed process had moved aside; remove it if its
    replacement exists."""
    if _displaced(path).is_dir() and not path.exists():
        os.rename(_displaced(path), path)
    remove(_displaced(path))


def _displaced(path: Path) -> Path:
    return path.with_name(f".taichi-disk.old.{_short_name(path)}")


def remove(path: Path) -> None:
    shutil.rmtree(path, ignore_errors=True)
    with contextlib.suppress(OSError):
        path.unlink()


# ---- reading


def listed(folder: Path) -> list[str]:
    """Return the sorted names in `folder`, without the litter of file systems and the
    logs of other programs."""
    names = sorted(os.listdir(folder))
    return [
        name for name in names if not (LITTER.fullmatch(name) or LOGS.fullmatch(name))
    ]


def read_summary(folder: Path) -> Summary:
    """Return the contents of summary.json, or {} if it is missing or damaged."""
    try:
        summary = json.loads(read_text(folder / "summary.json"))
    except (OSError, InputError, ValueError, RecursionError):
        return {}
    if not isinstance(summary, dict):
        return {}
    return summary


def check_pictures(folder: Path) -> None:
    """Raise InputError if `folder` exists and is write-protected, or holds anything but
    numbered files."""
    if os.path.lexists(folder) and not (
        os.access(folder, os.W_OK) and only_numbered(folder)
    ):
        raise InputError(
            f"{folder} is not a writable folder with only numbered pictures: remove it,"
            " or choose another"
        )


def only_numbered(folder: Path) -> bool:
    return folder.is_dir() and all(map(NUMBERED.fullmatch, listed(folder)))


def write_text(path: Path, text: str) -> None:
    atomic_write(path, lambda new: new.write_bytes(text.encode("utf-8")))


def write_summary(path: Path, summary: Summary) -> None:
    """Write summary.json; raises ValueError for NaN, which JSON lacks."""
    write_text(path, json.dumps(summary, indent=2, allow_nan=False) + "\n")


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    text = StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    write_text(path, text.getvalue())


def write_arrays(path: Path, **arrays: Any) -> None:
    atomic_write(path, lambda new: np.savez(new, **arrays))


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    own = {"python": platform.python_version(), "taichi-disk": __version__}
    libraries = {name: version(name) for name in ("numpy", "scipy")}
    return own | engine.versions() | libraries


def provenance() -> dict[str, str]:
    """Return date and processor for summary.json, the only file in which equal runs may
    differ."""
    return {
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "processor": processor(),
    }
