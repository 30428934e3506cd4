"""Processor and cores of this machine, and whether another Python can be started."""

from __future__ import annotations

import os
import platform
import sys
from contextlib import suppress
from math import ceil, inf
from pathlib import Path

# how to install what films need
REMEDY = (
    "apt-get update && apt-get install -y --no-install-recommends libx11-6"
    " mesa-vulkan-drivers"
)
if sys.platform != "linux":
    REMEDY = (
        "install the Vulkan driver of the graphics card's maker; `run --no-video` needs"
        " none"
    )


def cores() -> int:
    """Return the number of cores that this process may use, at least 1: those of its
    affinity, and no more than the CPU quota of its container, rounded up."""
    if hasattr(os, "process_cpu_count"):  # Python 3.13
        count = os.process_cpu_count()
    elif hasattr(os, "sched_getaffinity"):
        count = len(os.sched_getaffinity(0))
    else:
        count = os.cpu_count()
    quota = cpu_quota(Path("/proc/self/cgroup"), Path("/sys/fs/cgroup"))
    return int(max(1, min(count or 1, quota)))


def cpu_quota(membership: Path, root: Path) -> float:
    """Return the smallest CPU quota, in cores rounded up, of the control groups that
    this process is in; infinity if there is none.

    `membership`: file with the groups of the process; `root`: folder of all groups. See
    cgroups(7), version 2.
    """
    quotas = []
    with suppress(OSError):
        for line in membership.read_text().splitlines():
            if line.startswith("0::"):
                group = Path(os.path.normpath(f"{root}/{line[3:]}"))
                # A container sees its own group as `root`, but may have the host's
                # path.
                for folder in (group, *group.parents):
                    if folder.is_relative_to(root):
                        quotas.append(_quota_of(folder))
    return min(quotas, default=inf)


def _quota_of(group: Path) -> float:
    # OSError if the file is missing, ValueError if it says "max"
    with suppress(OSError, ValueError):
        quota, period = map(float, (group / "cpu.max").read_text().split())
        return ceil(quota / period)
    return inf


def processor() -> str:
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        for line in lines.splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def can_start_python() -> bool:
    """Return whether `sys.executable` is a Python. In an application that contains
    Python it may be the application, which would start itself again."""
    path = Path(sys.executable or "")
    is_frozen = getattr(sys, "frozen", False)  # by PyInstaller and its kind
    is_python = path.name.lower().startswith(("python", "pypy"))
    return is_python and path.is_file() and not is_frozen
