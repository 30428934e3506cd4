"""Processor, cores and free memory of this machine."""

from __future__ import annotations

import os
import platform
from contextlib import suppress
from pathlib import Path


def cores() -> int:
    return (
        len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1
    )


def processor() -> str:
    with suppress(OSError, StopIteration):
        lines = (
            Path("/proc/cpuinfo")
            .read_text(encoding="utf-8", errors="replace")
            .splitlines()
        )
        return (
            next(line for line in lines if line.startswith("model name"))
            .partition(":")[2]
            .strip()
        )
    return platform.processor() or platform.machine()


def free_memory() -> float:
    """Return the free memory [bytes], or infinity if the operating system does not
    report it."""
    free = float("inf")
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        free = 1024.0 * float(
            next(line for line in lines if line.startswith("MemAvailable")).split()[1]
        )
    # the limit of a container; ValueError if it is "max", unlimited
    with suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        used = float((group / "memory.current").read_text())
        free = min(free, float((group / "memory.max").read_text()) - used)
    return free
