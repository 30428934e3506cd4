"""Starting Taichi: the environment that it needs, the settings that make its results reproducible, its workarounds.

Nothing here imports Taichi before `prepare_environment` has been called: Taichi 1.7.4 reads the environment when it is
imported. What it does without each workaround stands where that is; `physics.points` and `signals` have one more each.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import os
import platform
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from functools import lru_cache
from numbers import Integral
from pathlib import Path
from typing import Any, NoReturn

from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.signals import deferred_interrupts

CACHE = "TI_OFFLINE_CACHE_FILE_PATH"
THREADS = "TAICHI_DISK_THREADS"
_LOCK = threading.RLock()
_taken = False  # by the thread that holds the lock
_STALE = 60.0  # [s] Taichi holds the lock of its cache for less than one


def cache_folder() -> Path:
    """Where Taichi keeps compiled kernels."""
    home = os.environ.get("HOME") or os.environ.get("USERPROFILE") or "/nonexistent"
    return Path(os.environ.get(CACHE) or Path(home, ".cache", "taichi", "ticache"))


def writable(folder: Path) -> bool:
    """Whether `folder` can be made and written into; tried, because permissions alone do not tell (root, /proc)."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def keeps_kernels() -> bool:
    """Whether Taichi can keep compiled kernels: in a folder that can be written, and, but on Windows, in a home."""
    return ("HOME" in os.environ or sys.platform == "win32") and writable(cache_folder())


def prepare_environment() -> None:
    """Give Taichi a home and a cache that it can write; without them it aborts, or crashes at the end.

    Where there are none (cron, systemd, a container's user), kernels go into a folder in the temporary directory, which
    is said once on stderr. On POSIX it is this user's own, and stays for the next run.
    """
    os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
    os.environ.setdefault("TI_LOG_LEVEL", "error")  # also of what it tells while it is imported
    _spare_searches()
    if sys.platform == "win32":  # where Taichi would take C:/taichi_cache, whoever the user is
        os.environ.setdefault(CACHE, str(cache_folder()))
    if keeps_kernels():
        return
    try:
        user = os.getuid()
        folder = Path(tempfile.gettempdir(), f"taichi-disk-{user}")
        folder.mkdir(mode=0o700, exist_ok=True)
        if folder.is_symlink() or folder.stat().st_uid != user:
            raise PermissionError
    except (AttributeError, OSError):  # Windows has no getuid
        folder = Path(tempfile.mkdtemp(prefix="taichi-disk-"))
    print(f"note: no writable home; compiled kernels are kept in {folder}", file=sys.stderr)
    os.environ["HOME"] = str(folder)


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Within, this thread has Taichi for itself: others wait, because two at once would crash the process.

    Ctrl-C comes out between kernel launches. Raises InputError where this thread is within already: a progress callback
    would take the compiled simulation, or the window of the film, that is in use.
    """
    global _taken
    with _LOCK, deferred_interrupts():
        if _taken:
            raise InputError("a progress callback cannot run, film or look at a result: do it when the run has ended")
        _taken = True
        try:
            yield
        finally:
            _taken = False


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processor() -> str:
    """The processor's name, as far as the system tells."""
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        return next(line for line in lines if line.startswith("model name")).partition(":")[2].strip()
    return platform.processor() or platform.machine()


def free_memory() -> float:
    """Bytes that a process may still take; infinite where the system does not tell."""
    free = float("inf")
    with contextlib.suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        free = 1024.0 * float(next(line for line in lines if line.startswith("MemAvailable")).split()[1])
    with contextlib.suppress(OSError, ValueError):  # in a container the limit of its control group counts ("max": none)
        group = Path("/sys/fs/cgroup")
        used = float((group / "memory.current").read_text())
        free = min(free, float((group / "memory.max").read_text()) - used)
    return free


def start(threads: int | None = None) -> None:
    """Start Taichi on the CPU in double precision, unless it runs already.

    Args:
        threads: of the loops that run in parallel, from 1 to `cores()`; by default what the environment variable
            TAICHI_DISK_THREADS says, else one for each core.

    fast_math stays off: it gains nothing here, and without it the bits of a result do not depend on how a kernel was
    optimised. The offline cache halves the compile time of the next run.
    Raises InputError for another number, also than Taichi has already: to start it anew would free the fields of all
    simulations. Raises TaichiDiskError where there is not enough memory.
    """
    number = _threads(threads)
    with _LOCK, deferred_interrupts():
        prepare_environment()
        import taichi as ti

        if ti.lang.impl.get_runtime().prog is not None:
            if threads is not None and number != (now := ti.lang.impl.current_cfg().cpu_max_num_threads):
                text = f"threads: this process computes with {now} already, and cannot change to {number}"
                raise InputError(f"{text}; choose the number in its first run, or by {THREADS}")
            return
        _drop_stale_lock()
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # it tells the arch where only results belong
                ti.init(
                    arch=ti.cpu,
                    default_fp=ti.f64,
                    default_ip=ti.i32,
                    fast_math=False,
                    real_matrix_scalarize=False,  # see physics.law
                    cpu_max_num_threads=number,
                )
        except RuntimeError as error:
            raise TaichiDiskError(
                f"Taichi cannot start: {error}; it asks for 1 GiB of memory that it may never use: see ulimit -v"
            ) from None


def _threads(asked: Any) -> int:
    """How many are asked for, here or in the environment."""
    name, most = "threads", cores()
    if asked is None:
        name, asked = THREADS, os.environ.get(THREADS, most)
        asked = int(asked) if isinstance(asked, str) and asked.isdecimal() else asked
    if not (isinstance(asked, Integral) and 1 <= int(asked) <= most):
        raise InputError(f"{name}: must be a whole number from 1 to {most}, the cores of this machine, not {asked!r}")
    return int(asked)


def leave(status: int) -> NoReturn:
    """End the process once Taichi has kept its kernels: to take down all libraries one by one takes 0.2 s."""
    if "taichi" in sys.modules:
        sys.modules["taichi"].reset()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):  # closed, or its reader has gone
            stream.flush()
    os._exit(status)


def _drop_stale_lock() -> None:
    """Remove the lock that a killed process left: Taichi 1.7.4 would compile every kernel anew, for ever."""
    lock = cache_folder() / "ticache.lock"
    with contextlib.suppress(OSError):  # there is none, or another process has removed it
        if time.time() - lock.stat().st_mtime > _STALE:
            lock.unlink()


def _spare_searches() -> None:
    """Spare 0.07 s of searches through all modules, while Taichi 1.7.4 is imported and functions are decorated.

    It asks for the source of the frame outside, which is the import system's own, and `inspect` does not know that.
    """
    with contextlib.suppress(OSError):  # the working directory has been deleted
        inspect.modulesbyfile[os.path.abspath("<frozen importlib._bootstrap>")] = "importlib._bootstrap"


def lighten_taichi() -> None:
    """Take away what Taichi 1.7.4 spends half of its Python time on before a kernel is compiled, or found compiled.

    For every node of every function that it inlines it breaks and underlines the source lines for an error message that
    is not needed, and reads a function's source anew each time. Its messages now show a node's first line. Whether a
    function is a method it asks of the source outside, which it looks for in all modules.
    """
    from taichi.lang import kernel_impl
    from taichi.lang.ast.ast_transformer_utils import ASTTransformerContext

    def place(context: Any, node: Any) -> str:
        where = f'File "{context.file}", line {node.lineno + context.lineno_offset}, in {context.func.func.__name__}'
        return f"{where}:\n{context.src[node.lineno - 1]}\n"

    def in_class(level_of_class_stackframe: int) -> bool:
        return "__qualname__" in sys._getframe(level_of_class_stackframe - 1).f_locals

    ASTTransformerContext.get_pos_info, kernel_impl._inside_class = place, in_class
    kernel_impl.getsourcelines = lru_cache(maxsize=None)(kernel_impl.getsourcelines)
