"""The structure of the code: imports go in one direction, and files and folders stay
small."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[2]
MAX_CONTENT = 3700  # nodes of a file


def test_imports_go_one_way():
    done = subprocess.run(
        [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"],
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    assert done.returncode == 0, done.stdout[-3000:]


def test_no_imports_go_in_a_circle():
    # Imports between files, including those within functions and for types only.
    files = (ROOT / "taichi_disk").rglob("*.py")
    names = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(
            ".__init__"
        ): path
        for path in files
    }
    graph = {}
    for name, path in names.items():
        imports = [
            node
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.ImportFrom)
        ]
        found = [
            (node.module, f"{node.module}.{alias.name}")
            for node in imports
            for alias in node.names
        ]
        graph[name] = {
            one if one in names else module for module, one in found
        } & names.keys()
    assert len(graph) > 50 and "taichi_disk.errors" in graph["taichi_disk.cli"]
    TopologicalSorter(graph).prepare()  # raises CycleError, with the circle


def content(path):
    """Return the number of nodes of a file's syntax tree: what a reader has to
    understand, however the lines are broken."""
    return sum(1 for _ in ast.walk(ast.parse(path.read_text())))


def test_files_and_the_top_folder_stay_small():
    files = (ROOT / "taichi_disk").rglob("*.py")
    large = {str(path): content(path) for path in files if content(path) > MAX_CONTENT}
    assert large == {}
    assert len(list((ROOT / "taichi_disk").glob("*.py"))) <= 11


def test_every_package_is_in_an_installation():
    # An editable installation has all packages, even if the list misses some. (The
    # scene files are a package without a folder.)
    folders = {
        path.parent.relative_to(ROOT)
        for path in (ROOT / "taichi_disk").rglob("__init__.py")
    }
    listed = (
        (ROOT / "pyproject.toml").read_text().split("\npackages = [")[1].split("]")[0]
    )
    names = set(re.findall(r"[\w.]+", listed))
    assert names == {".".join(folder.parts) for folder in folders} | {
        "taichi_disk.scene_library"
    }
