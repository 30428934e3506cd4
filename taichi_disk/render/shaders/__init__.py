"""Shaders that replace GGUI's for triangles: their sides are soft lines, and colours
have an opacity.

The .spv files are compiled from the GLSL beside them: `glslangValidator -V NAME.vert -o
NAME_vert.spv`.
"""

from __future__ import annotations

import hashlib
import shutil
from importlib.util import find_spec
from pathlib import Path

from taichi_disk import engine

# SHA-256 of the shaders that ours replace (Taichi 1.7.4). Others may have another
# interface, and a pipeline that does not fit aborts the process.
REPLACED = {
    "Triangles_vk_vert.spv": (
        "e4163b8e0b03735fd7fc1c16597bb99e1a57c9254e0f5eb38a99451154782f16"
    ),
    "Triangles_vk_frag.spv": (
        "c031368d560765f715330665c1e1421e1c4ec574f29c13cbe58279cf67a1f437"
    ),
}


def fit_engine() -> bool:
    """Return whether the engine has the shaders that ours replace, and no others."""
    if engine.IS_FORK:  # the fork's window holds more than Taichi's
        return False
    folder = _engine_folder()
    return all(_digest(folder / name) == digest for name, digest in REPLACED.items())


def copy_into(folder: Path) -> None:
    """Copy the engine's shaders into a new `folder`, with ours in place of two of
    them."""
    shutil.copytree(_engine_folder(), folder)
    for name in REPLACED:
        shutil.copyfile(Path(__file__).with_name(name), folder / name)


def _engine_folder() -> Path:
    found = find_spec(engine.NAME)
    if found is None or found.origin is None:
        return Path()
    return Path(found.origin).with_name("shaders")


def _digest(path: Path) -> str:
    if not path.is_file():
        return ""
    return hashlib.sha256(path.read_bytes()).hexdigest()
