"""Start Taichi with settings that make results reproducible, lock it against other
threads, and end the process."""

from __future__ import annotations

import atexit
import contextlib
import io
import os
import sys
import threading
from collections.abc import Iterator
from functools import partial
from typing import Any, NoReturn

from taichi_disk.base import engine
from taichi_disk.base.engine import internals, owner
from taichi_disk.base.engine.environment import remove_stale_lock
from taichi_disk.base.errors import InputError, TaichiDiskError, whole_number
from taichi_disk.base.machine import cores
from taichi_disk.base.signals import deferred_interrupts

THREADS = "TAICHI_DISK_THREADS"
_LOCK = threading.RLock()
_is_held = False  # whether a computation of the thread with the lock is in progress


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Hold the Taichi lock, because two threads in Taichi at once crash the process,
    and handle Ctrl-C between kernels.

    Raises InputError if this thread already holds the lock: a progress callback that
    runs a scene or makes a film would reuse the compiled simulation, or the window, of
    the computation that called it.
    """
    global _is_held
    with _LOCK, deferred_interrupts():
        if _is_held:
            raise InputError(
                "a progress callback cannot run a scene or use a result: do it after"
                " the run"
            )
        _is_held = True
        try:
            yield
        finally:
            _is_held = False


def start(threads: int | None = None) -> None:
    """Start Taichi on the CPU in double precision, unless it is running.

    `threads`: from 1 to `cores()`; default: the environment variable
    TAICHI_DISK_THREADS, or all cores. Raises InputError if it is out of range, or if
    Taichi runs with another number, because a restart would free the fields of all
    simulations. Raises TaichiDiskError if there is not enough memory.
    """
    number = _threads(threads)
    with _LOCK, deferred_interrupts():
        from taichi_disk.base.engine import ti

        if engine.program() is not None:
            number = _present_threads(ti, threads)
        if engine.program() is None or owner.must_move():
            _init(ti, number)


def _init(ti: Any, threads: int) -> None:
    init = partial(
        ti.init,
        arch=ti.cpu,
        # no limit: the fork would warn of long unrolled loops over the laws
        unrolling_limit=0,
        cpu_max_num_threads=threads,
    )
    remove_stale_lock()
    # TI_ARCH would replace the CPU, and other processors lack double precision.
    arch = os.environ.pop("TI_ARCH", None)
    try:
        # hides Taichi's banner, because stdout is for results
        with contextlib.redirect_stdout(io.StringIO()):
            owner.start(init)
    except RuntimeError as error:
        advice = "it reserves 1 GiB of memory, so raise `ulimit -v`"
        if "temporarily unavailable" in str(error):  # another thread
            advice = "raise `ulimit -u`, the number of threads and processes"
        raise TaichiDiskError(f"Taichi cannot start: {error}; {advice}") from None
    finally:
        if arch is not None:
            os.environ["TI_ARCH"] = arch


def _present_threads(ti: Any, threads: int | None) -> int:
    """Return the number of threads of the running Taichi. Raises InputError if
    `threads` is another one, or if Taichi does not run on the CPU."""
    settings = internals.settings(ti)
    present = settings.cpu_max_num_threads
    if settings.arch != ti.cpu:
        raise InputError(
            f"Taichi runs with arch={settings.arch.name}, and a run needs the CPU:"
            " write ti.init(arch=ti.cpu), or remove your ti.init"
        )
    if threads not in (None, present):
        raise InputError(
            f"threads: this process already computes with {present} threads and cannot"
            f" change to {threads}: set the number in its first run, or in {THREADS}"
        )
    return present


def _threads(threads: Any) -> int:
    name = "threads"
    most = cores()
    if threads is None:
        name = THREADS
        threads = os.environ.get(THREADS, most)
        if isinstance(threads, str) and threads.isdecimal():
            threads = int(threads)
    return whole_number(threads, name, most, meaning=", the number of cores")


def leave(status: int) -> NoReturn:
    """End the process after Taichi has saved its kernels."""
    # Flush first, because a damaged cache of kernels can crash the engine.
    for stream in (sys.stdout, sys.stderr):
        # the stream is closed, or its reader has ended
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    engine_module = engine.loaded()
    if engine_module:
        engine_module.reset()
    # Exit without Python's own shutdown: it first restores the default handlers of
    # signals and then needs 0.2 s to delete the modules. A signal in that time would
    # change the exit status of a finished run.
    atexit._run_exitfuncs()
    os._exit(status)
