"""The command `view`: the list of scenes to choose from, shown on a page."""

from __future__ import annotations

import os
import re
import sys
from functools import partial
from pathlib import Path

import yaml

from taichi_disk.base import runtime
from taichi_disk.base.errors import InputError
from taichi_disk.base.text_files import read_text
from taichi_disk.experiments.scenes import Scene, load_scene
from taichi_disk.sandbox.controls import Preset
from taichi_disk.sandbox.server import serve

# part of a file in which a sweep is looked for [bytes]
_START = 2**20


def view(
    scene_or_folder: Scene | Path | None,
    host: str,
    port: int,
    open_browser: bool,
) -> None:
    """Serve the sandbox as a page until Ctrl-C.

    Args:
        scene_or_folder: the first scene of the list, or a folder of scenes, or None
            for the list as it is.
        host, port: where to serve the page; 0: a port that is free.
        open_browser: whether to open the page in the user's browser, if there is one.

    Raises InputError if the page cannot be served, or if a folder has no scenes.
    """
    if isinstance(scene_or_folder, Path):
        playlist = list_folder(scene_or_folder)
    else:
        playlist = list_presets(scene_or_folder)
    runtime.start()
    serve(playlist, host, port, open_browser=open_browser and has_browser())


def list_presets(first: Scene | None) -> list[Preset]:
    """Return the scenes of playlist.yaml, `first` in front unless it is one of them."""
    path = Path(__file__).with_name("playlist.yaml")
    groups = yaml.safe_load(read_text(path))
    entries = []
    for group, rows in groups.items():
        for scene, change, name, question, *pace in rows:
            beside = f"outline={path.parent}/"
            changes = [one.replace("outline=", beside) for one in change.split()]
            load = partial(load_scene, scene, changes)
            entries.append(Preset(name, question, load, group, *pace))
    if first is None:
        return entries
    opened = [entry for entry in entries if entry.load() == first]
    if not opened:
        name = first.title[0].upper() + first.title[1:]
        opened = [Preset(name, "The scene that you opened.", lambda: first)]
    return opened + [entry for entry in entries if entry not in opened]


def list_folder(path: Path) -> list[Preset]:
    """Return the scenes in the YAML files of a folder, in the order of their names.

    Raises InputError if there is no scene.
    """
    scenes = [file for file in sorted(path.glob("[!.]*.yaml")) if _is_scene(file)]
    if not scenes:
        raise InputError(
            f"{path}: there is no scene in this folder (*.yaml); those of a sweep stand"
            " in its folder points"
        )
    return [
        Preset(one.stem, f"From {path}.", partial(load_scene, one)) for one in scenes
    ]


def _is_scene(path: Path) -> bool:
    """Whether a file is listed: it can be opened and is no sweep. If it is no scene,
    its message appears when it is chosen."""
    try:
        with path.open("rb") as file:
            start = file.read(_START)
    except OSError:
        return False
    return not re.search(rb"^sweep:", start, re.MULTILINE)


def has_browser() -> bool:
    """Return whether the user would see a browser: not over SSH, and on Linux not
    without a display."""
    if os.environ.get("SSH_CONNECTION"):
        return False
    has_display = any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    return has_display or not sys.platform.startswith("linux")
