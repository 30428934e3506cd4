"""Shaders that replace GGUI's for triangles: their sides are soft lines, and colours
have an opacity.

The .spv files are compiled from the GLSL beside them: `glslangValidator -V NAME.vert -o
NAME_vert.spv`.
"""

from __future__ import annotations

import shutil
from importlib.resources import files
from pathlib import Path

from taichi_disk.base import engine


def fit_engine() -> bool:
    """Return whether these shaders can replace those of the installed engine. Another
    version may expect another interface, and a pipeline that does not fit aborts the
    process."""
    return engine.versions() == engine.WITH_KNOWN_SHADERS


def copy_into(folder: Path) -> None:
    """Copy the engine's shaders into a new `folder`, with ours in place of two of
    them."""
    folder.mkdir()
    for source in (Path(str(files(engine.NAME) / "shaders")), Path(__file__).parent):
        for path in source.glob("*.spv"):
            shutil.copyfile(path, folder / path.name)
