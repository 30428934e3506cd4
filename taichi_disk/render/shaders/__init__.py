"""Shaders that replace GGUI's for triangles: their sides are soft lines, and colours
have an opacity.

The .spv files are compiled from the GLSL beside them: `glslangValidator -V NAME.vert -o
NAME_vert.spv`.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from taichi_disk import engine


def fit_engine() -> bool:
    """Return whether the engine is the one whose shaders ours replace. Those of another
    version may have another interface, and a pipeline that does not fit aborts the
    process."""
    return engine.versions() == engine.WITH_KNOWN_SHADERS


def copy_into(folder: Path, ti: Any) -> None:
    """Copy the shaders of the engine `ti` into a new `folder`, with ours in place of
    two of them."""
    shutil.copytree(Path(ti.__file__).with_name("shaders"), folder)
    for path in Path(__file__).parent.glob("*.spv"):
        shutil.copyfile(path, folder / path.name)
