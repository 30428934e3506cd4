"""A resumed sweep keeps a point only if the program that computed it is the one that would compute it now."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from taichi_disk.study import program
from taichi_disk.study.program import PACKAGE, fingerprint


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    shutil.copytree(PACKAGE, tmp_path / "copy", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "copy"


def edited(package: Path, name: str, old: str, new: str) -> str:
    path = package / name
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    fingerprint.cache_clear()
    return fingerprint(package)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("model/springs.py", "0.25 * p.k_b", "0.26 * p.k_b"),
        ("lattice.py", "apothem - spacing", "apothem - 1.1 * spacing"),
        ("scenes/impact.py", "START_POTENTIAL = 1e-10", "START_POTENTIAL = 1e-9"),
        ("study/lanes.py", "WORLDS = ", "WORLDS = 1 + "),
        ("newton.py", "_MOST_ROLL = 0.1", "_MOST_ROLL = 0.2"),
    ],
)
def test_a_change_of_the_physics_changes_it(copy: Path, name: str, old: str, new: str) -> None:
    assert edited(copy, name, old, new) != fingerprint()


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("study/figures.py", '"osD^vPX"', '"osD"'),
        ("cli.py", "return 130", "return 131"),
        ("model/springs.py", "# x and y of a point", "# y and x of a point"),
    ],
)
def test_a_change_of_drawing_or_comment_does_not(copy: Path, name: str, old: str, new: str) -> None:
    assert edited(copy, name, old, new) == fingerprint()


def test_another_version_of_a_library_changes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    before = fingerprint()
    fingerprint.cache_clear()
    monkeypatch.setattr(program, "versions", lambda: {"numpy": "0"})
    assert fingerprint() != before
    fingerprint.cache_clear()


@pytest.mark.validate
def test_every_module_that_computing_a_point_loads_is_part_of_it(tmp_path: Path) -> None:
    code = """if True:
    import sys
    from taichi_disk.study.work import Computer
    loaded = set(sys.modules)
    from taichi_disk.scene_file import load_scene
    scenes = [load_scene(k, ["lattice.points=60"]) for k in ("exponential_wall", "compression")]
    scenes.append(load_scene("compression", ["lattice.points=60", "compression.method=newton"]))
    before = set(sys.modules) - loaded
    for scene in scenes:
        for _ in Computer().compute([scene]):
            pass
    print(*(name for name in set(sys.modules) - before if name.startswith("taichi_disk.")))
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    modules = {name.split(".", 1)[1].replace(".", "/") for name in done.stdout.split()}
    part = {name.removesuffix(".py").removesuffix("/__init__") for name in program._trees(PACKAGE)}
    empty = {name for name in modules if not (PACKAGE / f"{name}.py").is_file()}  # packages: what is in them counts
    assert modules - part - empty == set() and "model/world" in modules
