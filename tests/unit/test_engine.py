"""The engine: selected in one file, imported in a suitable environment, and patched if
necessary."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

import pytest

from taichi_disk.engine import environment, patches

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("age", "stays"), [(patches.STALE - 30.0, True), (patches.STALE + 30.0, False)]
)
def test_the_lock_of_a_process_that_was_killed_goes_and_that_of_another_process_stays(
    tmp_path, monkeypatch, age, stays
):
    monkeypatch.setenv(environment.CACHE, str(tmp_path))
    lock = tmp_path / "ticache.lock"
    lock.touch()
    os.utime(lock, (time.time() - age,) * 2)
    patches.remove_stale_lock()
    assert lock.exists() == stays
    patches.remove_stale_lock()


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
