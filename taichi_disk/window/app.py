"""From a scene, or a folder of scenes, to its page or its window; the list of scenes to choose from."""

from __future__ import annotations

import csv
import os
import re
import sys
from ctypes import CDLL, c_void_p
from functools import partial
from pathlib import Path

import yaml

from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.render import film_problem
from taichi_disk.scenes import Scene, load_scene
from taichi_disk.window.controls import Entry

_X11 = sys.platform.startswith("linux")


def view(
    scene_or_folder: Scene | Path,
    out: Path,
    window: bool = False,
    host: str = "127.0.0.1",
    port: int = 0,
    open_browser: bool = True,
) -> None:
    """Serve the sandbox as a page until Ctrl-C, or open it in a window until that has been closed.

    Args:
        scene_or_folder: the first scene of the list, or a folder of scenes.
        out: folder for the files that the window writes; the page writes none.
        window: whether to open a window.
        host, port: where to serve the page; 0: a port that is free.
        open_browser: whether to open the page in the user's browser, if there is one.

    Raises TaichiDiskError, with the remedy, if the page cannot be served or no window can be opened; InputError for a
    folder without scenes.
    """
    from taichi_disk import runtime

    playlist = folder(scene_or_folder) if isinstance(scene_or_folder, Path) else presets(scene_or_folder)
    if not window:
        from taichi_disk.window.server import serve

        runtime.start()
        serve(playlist, host, port, open_browser and has_browser())
        return
    if problem := window_problem():
        raise TaichiDiskError(f"no window: {problem}; `taichi-disk view` without --window serves a page instead")
    from taichi_disk.window.viewer import Viewer

    runtime.start()
    for _ in Viewer(playlist, out, screen()).pictures():
        pass


def presets(first: Scene) -> list[Entry]:
    """Return `first`, then the scenes of playlist.yaml, which has name and sentence of `first` if it is shipped."""
    text = Path(__file__).with_name("playlist.yaml").read_text(encoding="utf-8")
    entries = []
    opened = Entry(first.title[0].upper() + first.title[1:], "The scene that you opened.", lambda: first)
    for shipped, change, name, sentence in yaml.safe_load(text):
        entry = Entry(name, sentence, partial(load_scene, shipped, [change] if change else []))
        if not change and entry.load() == first:
            opened = entry
        else:
            entries.append(entry)
    return [opened, *entries]


def folder(path: Path) -> list[Entry]:
    """The scenes in a folder: a sweep's points in their order, a run's scene, or its YAML files but for sweeps.

    Raises InputError if there is none.
    """
    path = path.resolve()  # an open window works in another folder
    table = path / "points.csv"
    if table.is_file():
        rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
        files = [path / "points" / f"{row.get('key')}.yaml" for row in rows]
    else:
        files = sorted(path.glob("[!.]*.yaml"))
    files = [file for file in files if file.is_file() and not re.search(rb"^sweep:", file.read_bytes(), re.MULTILINE)]
    entries = [Entry(file.stem, f"From {path}.", partial(load_scene, file)) for file in files]
    if not entries:
        raise InputError(f"{path}: there is no scene in this folder (*.yaml, or points.csv with points/*.yaml)")
    return entries


def has_browser() -> bool:
    """Whether a browser can be opened before the user's eyes: not over SSH, and on Linux not without a display."""
    if os.environ.get("SSH_CONNECTION") or os.environ.get("SSH_TTY"):
        return False
    return not _X11 or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


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
