"""The command `view`: the list of scenes to choose from, shown on a page or in a
window."""

from __future__ import annotations

import csv
import os
import re
import sys
from ctypes import CDLL, c_void_p
from functools import partial
from pathlib import Path

import yaml

from taichi_disk import runtime
from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.render import film_problem
from taichi_disk.scenes import Scene, load_scene
from taichi_disk.text_files import read_text
from taichi_disk.window.controls import Preset
from taichi_disk.window.server import serve

# part of a file in which a sweep is looked for [bytes]
_START = 2**20
_TABLE_LIMIT = 2**28  # largest table of a sweep: 500,000 points [bytes]
_X11 = sys.platform.startswith("linux")


def view(
    scene_or_folder: Scene | Path | None,
    out: Path,
    window: bool,
    host: str,
    port: int,
    open_browser: bool,
    origin: str = "",
) -> None:
    """Serve the sandbox as a page until Ctrl-C, or open it in a window until that has
    been closed.

    Args:
        scene_or_folder: the first scene of the list, or a folder of scenes, or None
            for the list as it is.
        out: folder for the files that the window writes; the page writes none.
        window: whether to open a window.
        host, port: where to serve the page; 0: a port that is free.
        open_browser: whether to open the page in the user's browser, if there is one.
        origin: public address of the page behind a reverse proxy, "" for none.

    Raises TaichiDiskError, with the remedy, if the page cannot be served or no window
    can be opened; InputError if a folder has no scenes.
    """
    problem = window_problem() if window else None
    if problem:
        raise TaichiDiskError(
            f"no window: {problem}; `taichi-disk view` without --window serves a page"
            " instead"
        )
    if isinstance(scene_or_folder, Path):
        playlist = list_folder(scene_or_folder)
    else:
        playlist = list_presets(scene_or_folder)
    runtime.start()
    if window:
        from taichi_disk.window.viewer import Viewer

        for _ in Viewer(playlist, out).pictures():
            pass
    else:
        opens = open_browser and has_browser()
        serve(playlist, host, port, open_browser=opens, origin=origin)


def list_presets(first: Scene | None) -> list[Preset]:
    """Return the scenes of playlist.yaml, `first` in front unless it is one of them."""
    path = Path(__file__).with_name("playlist.yaml")
    groups = yaml.safe_load(read_text(path))
    entries = []
    for group, rows in groups.items():
        for scene, change, name, sentence, *pace in rows:
            load = partial(load_scene, scene, change.split())
            options = pace[0] if pace else {}
            entries.append(Preset(name, sentence, load, group, **options))
    if first is None:
        return entries
    opened = [entry for entry in entries if entry.load() == first]
    if not opened:
        name = first.title[0].upper() + first.title[1:]
        opened = [Preset(name, "The scene that you opened.", lambda: first)]
    return opened + [entry for entry in entries if entry not in opened]


def list_folder(path: Path) -> list[Preset]:
    """Return the scenes of a folder: the points of a sweep in their order, or else
    every scene in a YAML file.

    Raises InputError if there is no scene, or if points.csv is no table.
    """
    path = path.resolve()  # an open window works in another folder
    scenes = [file for file in _files(path) if _is_scene(file)]
    if not scenes:
        raise InputError(
            f"{path}: there is no scene in this folder (*.yaml, or points.csv with"
            " points/*.yaml)"
        )
    return [
        Preset(one.stem, f"From {path}.", partial(load_scene, one)) for one in scenes
    ]


def _files(folder: Path) -> list[Path]:
    """Return the files that may be listed: those of a sweep's points, or all of the
    folder."""
    table = folder / "points.csv"
    if not table.is_file():
        return sorted(folder.glob("[!.]*.yaml"))
    try:
        rows = list(csv.DictReader(read_text(table, limit=_TABLE_LIMIT).splitlines()))
    except (OSError, csv.Error) as error:
        raise InputError(f"{table}: is not the table of a sweep: {error}") from None
    return [folder / "points" / f"{row.get('key')}.yaml" for row in rows]


def _is_scene(path: Path) -> bool:
    """Whether a file is listed: it can be opened and is no sweep. If it is no scene,
    its message appears when it is chosen."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            start = file.read(_START)
    except OSError:
        return False
    return not re.search(rb"^sweep:", start, re.MULTILINE)


def has_browser() -> bool:
    """Return whether the user would see a browser: not over SSH, and on Linux not
    without a display."""
    has_display = (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or not _X11
    )
    return bool(has_display) and not (
        os.environ.get("SSH_CONNECTION") or os.environ.get("SSH_TTY")
    )


def window_problem() -> str | None:
    """Return why no window can be opened on this machine, or None. Needs no `ti.init`.

    No window is opened to find out, because GLFW ends the process if it cannot open
    one.
    """
    name = os.environ.get("DISPLAY")
    if _X11 and not name:
        return "there is no display (DISPLAY is not set)"
    problem = film_problem()
    if problem or not _X11:
        return problem
    x11 = CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = c_void_p
    display = x11.XOpenDisplay(None)
    if not display:
        return f"the display {name} does not answer"
    x11.XCloseDisplay(c_void_p(display))
    return None
