"""The environment that the engine reads while it is imported: where it keeps compiled
kernels, and what it prints."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from taichi_disk.errors import NOTICES

CACHE = "TI_OFFLINE_CACHE_FILE_PATH"
DEFAULTS = {
    "ENABLE_TAICHI_HEADER_PRINT": "0",
    "TI_LOG_LEVEL": "error",  # also silences the import
    # else it sends version, platform and a random identity to its makers once a day
    "TI_SKIP_VERSION_CHECK": "ON",
}

# a lock of this age is stale [s]; the engine holds the lock of its cache for less than
# 1 s
STALE = 60.0


def cache_folder() -> Path:
    home = os.environ.get("HOME") or os.environ.get("USERPROFILE") or "/nonexistent"
    return Path(os.environ.get(CACHE) or Path(home, ".cache/taichi/ticache"))


def is_writable(folder: Path) -> bool:
    """Whether `folder` can be made and written into. Tried out: permissions are not
    reliable (root, /proc)."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def keeps_kernels() -> bool:
    """Whether compiled kernels can be kept: in a writable folder and, except on
    Windows, with a writable home."""
    return ("HOME" in os.environ or sys.platform == "win32") and is_writable(
        cache_folder()
    )


def prepare() -> None:
    """Give the engine a writable home and cache, without which it aborts or crashes at
    the end."""
    # If the user has none (cron, systemd, a container's user), kernels go into a folder
    # in the temporary directory until this process ends, and a note on stderr says so.
    for name, value in DEFAULTS.items():
        os.environ.setdefault(name, value)
    if sys.platform == "win32":  # Taichi would use C:/taichi_cache for every user
        os.environ.setdefault(CACHE, str(cache_folder()))
    if keeps_kernels():
        return
    folder = tempfile.mkdtemp(prefix="taichi-disk-")
    # called after the engine, which is imported later, has written its cache
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    NOTICES.warning(
        "no writable home, so no later run can use this run's compiled kernels"
    )
    os.environ["HOME"] = folder


def remove_stale_lock() -> None:
    """Remove the lock that a killed process has left in the cache, because the engine
    would not use a locked cache."""
    lock = cache_folder() / "ticache.lock"
    with suppress(OSError):  # there is no lock, or another process has removed it
        if time.time() - lock.stat().st_mtime > STALE:
            lock.unlink()
