"""The cores that a process may use, and Pythons that run no files of the user."""

from __future__ import annotations

import os
import subprocess
import sys
from math import inf

import pytest

from taichi_disk.machine import cores, cpu_quota, python_command


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
def test_cores_are_those_of_the_affinity_and_no_more_than_the_quota(
    monkeypatch, quota, expected
):
    monkeypatch.setattr(os, "process_cpu_count", lambda: 8, raising=False)
    monkeypatch.setattr("taichi_disk.machine.cpu_quota", lambda *_: quota)
    assert cores() == expected


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="needs Linux")
def test_an_affinity_is_respected():
    code = (
        "import os; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))]);"
        " from taichi_disk.machine import cores; print(cores())"
    )
    done = subprocess.run(python_command(code), capture_output=True, text=True)
    assert done.stdout == "1\n"


def test_another_python_runs_no_file_of_the_working_folder(tmp_path, monkeypatch):
    (tmp_path / "random.py").write_text("print('mine')")
    (tmp_path / "only_here.py").write_text("print('found')")
    monkeypatch.chdir(tmp_path)
    code = "import sys, random; print(sys.argv[1:]); import only_here"
    for path, output in (("/", ""), ("", "found\n")):
        monkeypatch.setattr(sys, "path", [path, *filter(None, sys.path)])
        done = subprocess.run(
            python_command(code, "a b", "c"), capture_output=True, text=True
        )
        assert done.stdout == f"['a b', 'c']\n{output}", done.stderr
