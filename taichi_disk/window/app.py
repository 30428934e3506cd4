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
from taichi_disk.window.controls import Entry
from taichi_disk.window.server import serve

_X11 = sys.platform.startswith("linux")


def view(
    scene_or_folder: Scene | Path,
    out: Path,
    window: bool,
    host: str,
    port: int,
    open_browser: bool,
) -> None:
    """Serve the sandbox as a page until Ctrl-C, or open it in a window until that has
    been closed.

    Args:
        scene_or_folder: the first scene of the list, or a folder of scenes.
        out: folder for the files that the window writes; the page writes none.
        window: whether to open a window.
        host, port: where to serve the page; 0: a port that is free.
        open_browser: whether to open the page in the user's browser, if there is one.

    Raises TaichiDiskError, with the remedy, if the page cannot be served or no window
    can be opened; InputError if a folder has no scenes.
    """
    if window and (problem := window_problem()):
        raise TaichiDiskError(
            f"no window: {problem}; `taichi-disk view` without --window serves a page"
            " instead"
        )
    playlist = (
        list_folder(scene_or_folder)
        if isinstance(scene_or_folder, Path)
        else list_presets(scene_or_folder)
    )
    runtime.start()
    if window:
        from taichi_disk.window.viewer import Viewer

        for _ in Viewer(playlist, out).pictures():
            pass
    else:
        serve(playlist, host, port, open_browser and has_browser())


def list_presets(first: Scene) -> list[Entry]:
    """Return `first`, then the other scenes of playlist.yaml, which also names and
    describes shipped scenes."""
    rows = yaml.safe_load(
        Path(__file__).with_name("playlist.yaml").read_text(encoding="utf-8")
    )
    entries = [
        Entry(name, text, partial(load_scene, scene, change.split()))
        for scene, change, name, text in rows
    ]
    same = [
        entry
        for entry, row in zip(entries, rows, strict=True)
        if not row[1] and entry.load() == first
    ]
    opened = same or [
        Entry(
            first.title[0].upper() + first.title[1:],
            "The scene that you opened.",
            lambda: first,
        )
    ]
    return opened + [entry for entry in entries if entry not in same]


def list_folder(path: Path) -> list[Entry]:
    """Return the scenes of a folder: the points of a sweep in their order, or else
    every scene in a YAML file.

    Raises InputError if there is no scene.
    """
    path = path.resolve()  # an open window works in another folder
    files = sorted(path.glob("[!.]*.yaml"))
    table = path / "points.csv"
    if table.is_file():
        files = [path / "points" / f"{key}.yaml" for key in _keys_of(table)]
    files = [
        file
        for file in files
        if file.is_file()
        and not re.search(rb"^sweep:", file.read_bytes(), re.MULTILINE)
    ]
    if not files:
        raise InputError(
            f"{path}: there is no scene in this folder (*.yaml, or points.csv with"
            " points/*.yaml)"
        )
    return [
        Entry(file.stem, f"From {path}.", partial(load_scene, file)) for file in files
    ]


def _keys_of(table: Path) -> list[str]:
    """Return the column `key` of points.csv. A table that another program has saved may
    have any encoding, but keys are plain letters."""
    rows = csv.DictReader(
        table.read_text(encoding="utf-8", errors="replace").splitlines()
    )
    try:
        return [str(row.get("key")) for row in rows]
    except csv.Error as error:
        raise InputError(f"{table}: not the table of a sweep: {error}") from None


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
    if (problem := film_problem()) or not _X11:
        return problem
    x11 = CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = c_void_p
    if not (display := x11.XOpenDisplay(None)):
        return f"the display {name} does not answer"
    x11.XCloseDisplay(c_void_p(display))
    return None
