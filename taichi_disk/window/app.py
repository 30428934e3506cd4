"""From a scene, or a folder of scenes, to its window, where there can be one; what two keys step through there."""

from __future__ import annotations

import csv
import os
import re
import sys
from ctypes import CDLL, c_void_p
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.render import film_problem
from taichi_disk.scenes import Scene, load_scene

if TYPE_CHECKING:
    from taichi_disk.window.controls import Entry

_X11 = sys.platform.startswith("linux")


def view(
    scene_or_folder: Scene | Path, out: Path, browser: bool = False, host: str = "127.0.0.1", port: int = 0
) -> None:
    """Open the sandbox; returns when its window has been closed. Files go into `out`.

    Where no window can be opened it is a page for a browser, served at `host` and `port` (0: one that is free), as it
    is where `browser` is asked for.
    Raises TaichiDiskError, with the remedy, where there is neither; InputError for a folder without scenes.
    """
    from taichi_disk import runtime

    playlist = folder(scene_or_folder) if isinstance(scene_or_folder, Path) else presets(scene_or_folder)
    problem = film_problem() if browser else window_problem()
    if film_problem():
        raise TaichiDiskError(f"no window: {film_problem()}")
    runtime.start()
    if browser or problem:
        from taichi_disk.window.browser import serve

        if problem:
            print(f"note: no window: {problem}; here is a page for a browser", file=sys.stderr)
        serve(playlist, out, host, port)
        return
    from taichi_disk.window.viewer import Viewer

    for _ in Viewer(playlist, out, screen()).pictures():
        pass


def presets(first: Scene) -> list[Entry]:
    """`first`, then the shipped scenes and changes to try: those of playlist.yaml."""
    entries: list[Entry] = [(first.title, lambda: first)]
    for name, *change in yaml.safe_load(Path(__file__).with_name("playlist.yaml").read_text(encoding="utf-8")):
        if change:
            setting, what = change
            entries.append((f"{setting}: {what}", partial(load_scene, name, [setting])))
        elif name != first.scene:
            entries.append((name, partial(load_scene, name)))
    return entries


def folder(path: Path) -> list[Entry]:
    """The scenes in a folder: a sweep's points in their order, a run's scene, or its YAML files but for sweeps.

    Raises InputError if there is none.
    """
    path = path.resolve()  # an open window works in another folder
    table = path / "points.csv"
    if table.is_file():
        rows = csv.DictReader(table.read_text(encoding="utf-8").splitlines())
        files = [path / "points" / f"{row.get('key')}.yaml" for row in rows]
    else:
        files = sorted(path.glob("[!.]*.yaml"))
    files = [file for file in files if file.is_file() and not re.search(rb"^sweep:", file.read_bytes(), re.MULTILINE)]
    entries: list[Entry] = [(file.stem, partial(load_scene, file)) for file in files]
    if not entries:
        raise InputError(f"{path}: there is no scene in this folder (*.yaml, or points.csv with points/*.yaml)")
    return entries


def window_problem() -> str | None:
    """Why no window can be opened on this machine, or None. Needs no `ti.init`.

    It is asked without opening one: GLFW ends the process where it cannot.
    """
    name = os.environ.get("DISPLAY")
    if not _X11:
        return film_problem()
    if name and ((problem := film_problem()) or screen()):
        return problem
    return f"the display {name} does not answer" if name else "there is no display (DISPLAY is not set)"


def screen() -> tuple[int, int] | None:
    """Width and height of the X display [px], None where there is none."""
    if not _X11:
        return None
    x11 = CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = c_void_p
    if not (display := c_void_p(x11.XOpenDisplay(None))):
        return None
    size = x11.XDisplayWidth(display, 0), x11.XDisplayHeight(display, 0)
    x11.XCloseDisplay(display)
    return size
