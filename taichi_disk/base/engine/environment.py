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

from taichi_disk.base.errors import NOTICES, reason

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


def cache_problem() -> str:
    """Return why compiled kernels cannot be kept, or "". Tried out: permissions are not
    reliable (root, /proc), and a disk may be full."""
    folder = cache_folder()
    if "HOME" not in os.environ and sys.platform != "win32":
        return "HOME is not set"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
            file.write(bytes(4096))
        for path in folder.glob("*.tcb"):  # which the engine reads and writes
            path.open("r+b").close()
    except OSError as error:
        return f"{folder}: {reason(error)}"
    return ""


def prepare() -> bool:
    """Give the engine a home and a cache that it can use; without them it aborts or
    crashes at the end. Return whether the cache is removed with this process."""
    # If the user has none (cron, systemd, a container's user), kernels go into a folder
    # in the temporary directory until this process ends, and a note on stderr says so.
    for name, value in DEFAULTS.items():
        os.environ.setdefault(name, value)
    if sys.platform == "win32":  # Taichi would use C:/taichi_cache for every user
        os.environ.setdefault(CACHE, str(cache_folder()))
    problem = cache_problem()
    if not problem:
        return False
    folder = tempfile.mkdtemp(prefix="taichi-disk-")
    # called after what is registered later
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    NOTICES.warning(
        f"no later run can use this run's compiled kernels ({problem}); {CACHE} names"
        " another folder for them"
    )
    os.environ["HOME"] = folder
    os.environ[CACHE] = folder
    return True


def remove_stale_lock() -> None:
    """Remove the lock that a killed process has left in the cache, because the engine
    would not use a locked cache."""
    lock = cache_folder() / "ticache.lock"
    with suppress(OSError):  # there is no lock, or another process has removed it
        if time.time() - lock.stat().st_mtime > STALE:
            lock.unlink()
