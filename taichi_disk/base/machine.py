"""Processor, cores and Vulkan drivers of this machine, and whether another Python can
be started."""

from __future__ import annotations

import os
import platform
import sys
from contextlib import suppress
from ctypes import CDLL, byref, c_uint32, c_uint64, c_void_p
from glob import glob
from importlib.machinery import PathFinder
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
# packages that another Python or a file of the user's may hide
NEEDED = (
    "numpy scipy yaml taichi taichi_forge matplotlib kiwisolver PIL av shapely rich"
    " websockets"
)
# variables that choose drivers of Vulkan, or replace libraries that drivers need
DRIVER_VARIABLES = ("VK_DRIVER_FILES", "VK_ICD_FILENAMES", "LD_LIBRARY_PATH")


def cores() -> int:
    """Return the number of cores that this process may use, at least 1: those of its
    affinity, and no more than the CPU quota of its container, rounded up."""
    count = os.cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        count = len(os.sched_getaffinity(0))
    quota = cpu_quota(Path("/proc/self/cgroup"), Path("/sys/fs/cgroup"))
    return int(max(1, min(count, quota)))


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
    """Return whether `sys.executable` is a Python that can run files of this package.

    In an application that contains Python it may be the application, which would start
    itself again. PyInstaller and its kind keep modules in an archive, as zip files do.
    """
    path = Path(sys.executable or "")
    is_python = path.name.lower().startswith(("python", "pypy"))
    return is_python and path.is_file() and Path(__file__).is_file()


def foreign_packages() -> str:
    """Return which packages come from folders in PYTHONPATH, as modules of a cluster
    and ROS set it, or from a file beside the user's program, with what helps; "" if
    there are none."""
    folders = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    first = [sys.path[0], *folders]
    found = []
    for name in NEEDED.split():
        # A folder that is no package has no origin, and hides none.
        origin = getattr(PathFinder.find_spec(name, first), "origin", None)
        if origin:
            found.append(f"{name} is {origin}")
    if not found:
        return ""
    return f"{', '.join(found)}; try again after: unset PYTHONPATH, or rename that file"


def driver_state() -> str:
    """Return what is wrong with the Vulkan drivers, or "" if one has a device, or if
    Vulkan's loader is not found under Linux' name.

    A driver may crash or hang: call this in another process.
    """
    try:
        vulkan = CDLL("libvulkan.so.1")
    except OSError:
        return ""
    # VkInstanceCreateInfo: its type is 1, and everything else is empty
    settings = (c_uint64 * 8)(1)
    instance = c_void_p()
    if vulkan.vkCreateInstance(byref(settings), None, byref(instance)) != 0:
        return "cannot be loaded"
    count = c_uint32()
    vulkan.vkEnumeratePhysicalDevices(instance, byref(count), None)
    if count.value == 0:
        return "has no device"
    return ""


def driver_problem(state: str) -> str:
    """Return a message that says what is wrong with the Vulkan driver, and what helps.
    `state`: what `driver_state` returns."""
    drivers = glob("/usr/share/vulkan/icd.d/*.json")
    values = os.environ.items()
    remedies = [f"without {k}={v}" for k, v in values if k in DRIVER_VARIABLES]
    remedies += [f"with VK_DRIVER_FILES={path}" for path in drivers if "lvp" in path]
    remedies.append(f"after, as root: {REMEDY}")
    what = f"the Vulkan driver {state}"
    if not drivers:
        what = "there is no Vulkan driver"
    return f"{what}, so no MP4, WebM, GIF or PNG: try again {', or '.join(remedies)}"
