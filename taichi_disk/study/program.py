"""Which program computed a number: a fingerprint of the code and the libraries that a point's result follows from."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from taichi_disk.results import versions

PACKAGE = Path(__file__).parent.parent
START = "study/work.py"  # computes the points: what it imports, and what that imports, is the program


@lru_cache
def fingerprint(package: Path = PACKAGE) -> str:
    """Hash of every module that takes part, and of the versions of Python, Taichi, NumPy and SciPy.

    Drawing, fits, the window and the command line have no part in a number; comments and layout neither.
    """
    trees = _trees(package)
    known = [repr(sorted(versions().items())), *(f"{name} {ast.dump(trees[name])}" for name in sorted(trees))]
    return hashlib.sha256("\n".join(known).encode()).hexdigest()


def _trees(package: Path) -> dict[str, ast.Module]:
    """Syntax trees of the modules that START imports, at the top or inside a function, by file name."""
    found: dict[str, ast.Module] = {}
    todo = [START]
    while todo:
        name = todo.pop()
        if name not in found and (package / name).is_file():
            found[name] = ast.parse((package / name).read_bytes())
            todo += _imported(found[name])
    return found


def _imported(tree: ast.Module) -> Iterator[str]:
    """File names that the package's own imports in `tree` may stand for."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("taichi_disk"):
            # `from a.b import c`: c may be a module of the package b, or something that b holds.
            parts = str(node.module).split(".")[1:]
            for path in ("/".join(parts), *("/".join([*parts, alias.name]) for alias in node.names)):
                yield f"{path}.py"
                yield f"{path}/__init__.py"
