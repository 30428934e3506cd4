"""The engine: selected in one file, imported in a suitable environment, and patched if
necessary."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from taichi_disk.engine import environment, internals, ti

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("age", "stays"),
    [(environment.STALE - 30.0, True), (environment.STALE + 30.0, False)],
)
def test_the_lock_of_a_process_that_was_killed_goes_and_that_of_another_process_stays(
    tmp_path, monkeypatch, age, stays
):
    monkeypatch.setenv(environment.CACHE, str(tmp_path))
    lock = tmp_path / "ticache.lock"
    lock.touch()
    os.utime(lock, (time.time() - age,) * 2)
    environment.remove_stale_lock()
    assert lock.exists() == stays
    environment.remove_stale_lock()


def test_one_file_alone_names_the_engines():
    naming = re.compile(
        r"^\s*(import|from) taichi(_forge)?\b|[\"']taichi(_forge|-forge)?[\"']",
        re.MULTILINE,
    )
    files = [*(ROOT / "taichi_disk").rglob("*.py"), *(ROOT / "docs").rglob("*.py")]
    assert [
        path.name for path in files if naming.search(path.read_text(encoding="utf-8"))
    ] == ["__init__.py"]
    assert naming.search(
        (ROOT / "taichi_disk/engine/__init__.py").read_text(encoding="utf-8")
    )


def test_one_file_alone_uses_what_the_engine_does_not_promise():
    private = re.compile(r"\bti\._|\bti\.lang\b|\.lang\.impl\b|\bui\.utils\b")
    files = (ROOT / "taichi_disk").rglob("*.py")
    assert [
        path.name for path in files if private.search(path.read_text(encoding="utf-8"))
    ] == ["internals.py"]


def test_another_version_of_taichi_is_left_as_it_is():
    internals.patch(SimpleNamespace(__version__=(1, 7, 3)))  # has nothing to change


@ti.kernel
def slip():
    print(unknown)  # noqa: F821


def test_a_slip_in_the_user_s_own_kernel_is_underlined(kernels):
    with pytest.raises(ti.TaichiNameError, match=r"print\(unknown\).*\n +\^+ *\n"):
        slip()
