"""Cores of a process, drivers that do not work, and applications with Python."""

import os
import subprocess
import sys
from math import inf
from types import SimpleNamespace

import pytest

from taichi_disk.base import machine
from taichi_disk.base.machine import can_start_python, cores, cpu_quota


@pytest.mark.parametrize(
    ("membership", "files", "quota"),
    [
        # version 2; the group's own limit, and a stricter one above it
        ("0::/a/b", {"a/b/cpu.max": "150000 100000"}, 2),
        ("0::/a/b", {"a/b/cpu.max": "max 100000", "a/cpu.max": "100000 100000"}, 1),
        ("0::/", {"cpu.max": "50000 100000"}, 1),
        # a container: the path of the host does not exist here
        ("0::/docker/a", {"cpu.max": "300000 100000"}, 3),
        ("2:cpu:/", {"cpu/cpu.cfs_quota_us": "100000"}, inf),  # version 1
        ("0::/", {}, inf),
        ("nonsense", {}, inf),
        (None, {}, inf),
    ],
)
def test_the_smallest_quota_of_all_groups_counts(tmp_path, membership, files, quota):
    root = tmp_path / "cgroup"
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"{text}\n")
    groups = tmp_path / "groups"
    if membership is not None:
        groups.write_text(f"{membership}\n")
    assert cpu_quota(groups, root) == quota


@pytest.mark.parametrize(("quota", "expected"), [(0.5, 1), (1, 1), (2, 2), (inf, 8)])
def test_cores_are_the_affinity_s_and_within_the_quota(monkeypatch, quota, expected):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(8), raising=False)
    monkeypatch.setattr("taichi_disk.base.machine.cpu_quota", lambda *_: quota)
    assert cores() == expected


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="needs Linux")
def test_an_affinity_is_respected():
    code = (
        "import os; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))]);"
        " from taichi_disk.base.machine import cores; print(cores())"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == "1\n"


PYTHONS = {"python": True, "Python3.13": True, "pypy3": True}
OTHERS = dict.fromkeys(["blender", "qgis-bin.exe", "", None], False)


@pytest.mark.parametrize(("name", "is_python"), [*PYTHONS.items(), *OTHERS.items()])
def test_an_application_with_python_is_no_python(
    name, is_python, tmp_path, monkeypatch
):
    program = name
    if name:
        (tmp_path / name).touch()
        program = str(tmp_path / name)
    monkeypatch.setattr(sys, "executable", program)
    assert can_start_python() == is_python
    monkeypatch.setattr(machine, "__file__", str(tmp_path / "app.zip" / "machine.py"))
    assert not can_start_python()


@pytest.mark.parametrize(
    ("created", "devices", "state"),
    [(-9, 0, "cannot be loaded"), (0, 0, "has no device"), (0, 1, "")],
)
def test_a_vulkan_driver_cannot_be_loaded_or_has_no_device_or_works(
    monkeypatch, created, devices, state
):
    def enumerate_devices(instance, count, no_list):
        count._obj.value = devices

    loader = SimpleNamespace(
        vkCreateInstance=lambda *_: created,
        vkEnumeratePhysicalDevices=enumerate_devices,
    )
    monkeypatch.setattr(machine, "CDLL", lambda name: loader)
    assert machine.driver_state() == state


def test_a_driver_that_fails_is_described_with_what_helps(monkeypatch):
    for name in machine.DRIVER_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    found = ["/icd.d/intel_icd.json", "/icd.d/lvp_icd.json"]
    monkeypatch.setattr(machine, "glob", lambda pattern: found)
    monkeypatch.setenv("LD_LIBRARY_PATH", "/opt/conda/lib")
    assert machine.driver_problem("crashed with SIGSEGV") == (
        "the Vulkan driver crashed with SIGSEGV, so no MP4, WebM, GIF or PNG: try again"
        " without LD_LIBRARY_PATH=/opt/conda/lib, or with"
        f" VK_DRIVER_FILES=/icd.d/lvp_icd.json, or after, as root: {machine.REMEDY}"
    )
    found.clear()
    missing = machine.driver_problem("cannot be loaded")
    assert missing.startswith("there is no Vulkan driver, so no MP4")
