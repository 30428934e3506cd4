"""Shaders that replace GGUI's for triangles: their sides are soft lines, and colours
have an opacity.

The .spv files are compiled from the GLSL beside them: `glslangValidator -V NAME.vert -o
NAME_vert.spv`.
"""

from __future__ import annotations

import shutil
from importlib.util import find_spec
from pathlib import Path

from taichi_disk import engine

# whose shaders ours replace; those of another version may have another interface, and a
# pipeline that does not fit aborts the process
FITTING = {"taichi": "1.7.4"}


def fit_engine() -> bool:
    """Return whether the engine is the one whose shaders ours replace."""
    return engine.versions() == FITTING


def copy_into(folder: Path) -> None:
    """Copy the engine's shaders into a new `folder`, with ours in place of two of
    them."""
    spec = find_spec(engine.NAME)
    assert spec and spec.origin
    shutil.copytree(Path(spec.origin).with_name("shaders"), folder)
    for path in Path(__file__).parent.glob("*.spv"):
        shutil.copyfile(path, folder / path.name)
