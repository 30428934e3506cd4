"""Start Taichi with settings that make results reproducible, lock it against other
threads, and end the process."""

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
        from taichi_disk.engine import ti

        if engine.program() is not None:
            _check_settings(ti)
            if threads is not None and number != (
                now := ti.lang.impl.current_cfg().cpu_max_num_threads
            ):
                text = (
                    f"threads: this process already computes with {now} threads and"
                    f" cannot change to {number}"
                )
                raise InputError(
                    f"{text}: set the number in its first run, or in {THREADS}"
                )
            return
        if (arch := os.environ.get("TI_ARCH")) not in (
            None,
            ti._lib.core.arch_name(ti.cpu),
        ):
            raise InputError(
                f"TI_ARCH={arch}: simulations need the CPU and double precision: unset"
                " TI_ARCH"
            )
        remove_stale_lock()
        try:
            # hides Taichi's banner, because stdout is for results
            with contextlib.redirect_stdout(io.StringIO()):
                ti.init(
                    arch=ti.cpu,
                    default_fp=ti.f64,
                    default_ip=ti.i32,
                    # True is no faster here, and results would depend on how a kernel
                    # is optimised
                    fast_math=False,
                    real_matrix_scalarize=False,  # see physics.law
                    # no limit: Taichi Forge would warn of long unrolled loops over the
                    # laws
                    unrolling_limit=0,
                    cpu_max_num_threads=number,
                )
        except RuntimeError as error:
            raise TaichiDiskError(
                f"Taichi cannot start: {error}; it reserves 1 GiB of memory, so raise"
                " `ulimit -v`"
            ) from None


def _check_settings(ti: Any) -> None:
    found, needed = (
        ti.lang.impl.current_cfg(),
        {"arch": ti.cpu, "default_fp": ti.f64, "fast_math": False},
    )
    other = [
        f"{name}={getattr(found, name)}"
        for name, value in needed.items()
        if getattr(found, name) != value
    ]
    if other:
        text = (
            f"Taichi runs with {', '.join(other)}, which makes results wrong".replace(
                "Arch.", ""
            )
        )
        line = "ti.init(arch=ti.cpu, default_fp=ti.f64, fast_math=False)"
        raise InputError(f"{text}: replace your ti.init by {line}, or remove it")


def _threads(asked: Any) -> int:
    name, most = "threads", cores()
    if asked is None:
        name, asked = THREADS, os.environ.get(THREADS, most)
        asked = int(asked) if isinstance(asked, str) and asked.isdecimal() else asked
    if not (isinstance(asked, Integral) and 1 <= int(asked) <= most):
        raise InputError(
            f"{name}: must be a whole number from 1 to {most}, the number of cores, not"
            f" {asked!r}"
        )
    return int(asked)


def leave(status: int) -> NoReturn:
    """End the process after Taichi has saved its kernels. Raises SystemExit."""
    # Flush first, because a damaged cache of kernels can crash the engine.
    for stream in (sys.stdout, sys.stderr):
        # the stream is closed, or its reader has ended
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    engine_module = engine.loaded()
    if engine_module:
        engine_module.reset()
    sys.exit(status)
