"""Starting the engine with the settings that make results reproducible, sharing it between threads, and ending it."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import threading
from collections.abc import Iterator
from numbers import Integral
from typing import Any, NoReturn

from taichi_disk import engine
from taichi_disk.engine.patches import remove_stale_lock
from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.machine import cores
from taichi_disk.signals import deferred_interrupts

THREADS = "TAICHI_DISK_THREADS"
_LOCK = threading.RLock()
_is_held = False  # by the thread that has the lock


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Within, this thread has the engine for itself: others wait, because two at once would crash the process.

    Ctrl-C comes out between kernel launches. Raises InputError if this thread is within already: a progress callback
    would take the compiled simulation, or the window of the film, that is in use.
    """
    global _is_held
    with _LOCK, deferred_interrupts():
        if _is_held:
            raise InputError("a progress callback cannot run, film or look at a result: do it when the run has ended")
        _is_held = True
        try:
            yield
        finally:
            _is_held = False


def start(threads: int | None = None) -> None:
    """Start the engine on the CPU in double precision, unless it runs already.

    Args:
        threads: of the loops that run in parallel, from 1 to `cores()`; by default what the environment variable
            TAICHI_DISK_THREADS says, else one for each core.

    fast_math stays off: it gains nothing here, and without it the bits of a result do not depend on how a kernel was
    optimised. The offline cache halves the compile time of the next run.
    Raises InputError for another number, also than the engine has already: to start it anew would free the fields of
    all simulations. Raises TaichiDiskError if there is not enough memory.
    """
    number = _threads(threads)
    with _LOCK, deferred_interrupts():
        from taichi_disk.engine import ti

        if engine.program() is not None:
            _check_settings(ti)
            if threads is not None and number != (now := ti.lang.impl.current_cfg().cpu_max_num_threads):
                text = f"threads: this process computes with {now} already, and cannot change to {number}"
                raise InputError(f"{text}; choose the number in its first run, or by {THREADS}")
            return
        if (arch := os.environ.get("TI_ARCH")) not in (None, ti._lib.core.arch_name(ti.cpu)):
            raise InputError(f"TI_ARCH={arch}: simulations run on the CPU, in double precision: unset TI_ARCH")
        remove_stale_lock()
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # it tells the arch where only results belong
                ti.init(
                    arch=ti.cpu,
                    default_fp=ti.f64,
                    default_ip=ti.i32,
                    fast_math=False,
                    real_matrix_scalarize=False,  # see physics.law
                    unrolling_limit=0,  # the fork warns of long loops over a scene's laws
                    cpu_max_num_threads=number,
                )
        except RuntimeError as error:
            raise TaichiDiskError(
                f"Taichi cannot start: {error}; it asks for 1 GiB of memory that it may never use: see ulimit -v"
            ) from None


def _check_settings(ti: Any) -> None:
    """Raise InputError if the user has started the engine in a way that makes results wrong or irreproducible."""
    found, needed = ti.lang.impl.current_cfg(), {"arch": ti.cpu, "default_fp": ti.f64, "fast_math": False}
    other = [f"{name}={getattr(found, name)}" for name, value in needed.items() if getattr(found, name) != value]
    if other:
        text = f"Taichi runs with {', '.join(other)}, and results would be wrong".replace("Arch.", "")
        line = "ti.init(arch=ti.cpu, default_fp=ti.f64, fast_math=False)"
        raise InputError(f"{text}: write {line} in place of your own ti.init, or leave it out")


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
    """End the process once the engine has kept its kernels: to take down all libraries one by one takes 0.2 s."""
    if module := engine.loaded():
        module.reset()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):  # closed, or its reader has gone
            stream.flush()
    os._exit(status)
