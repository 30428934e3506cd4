"""The folder of one run: chosen before anything is computed, filled at once when the run has ended.

A run is built in a hidden folder within its own. From there its files are moved out, scene.yaml first and summary.json
last, so that the next run can see a move that was cut short, and finish it. docs/output.md says what may be replaced.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Any

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.output.files import (
    cannot_write,
    only_numbered,
    prepare_output,
    reason,
    remove,
    remove_empty,
    write_text,
)
from taichi_disk.signals import signals_wait

FILMS = ("video.mp4", "video.webm", "video.gif", "frames")
RESULTS = ("timeseries.csv", "lattice.npz", "final.npz", "failure.npz", "plot.png")
# What `render` and `export` put beside a run if nobody says where.
_MADE = re.compile(r"(render|comparison)(\.(mp4|webm|gif|png))?|trajectory(\.(xyz|gsd|pvd|npz))?")
# A line of a resolved scene. What a person writes has empty lines, comments or another layout.
_RESOLVED = re.compile(r"\w+:( \w+)?|  \w+: .+")


@dataclass(frozen=True)
class Held:
    """What a folder holds; hidden files do not count. Text is empty where there is no such thing."""

    names: tuple[str, ...] = ()  # of files and folders
    foreign: str = ""  # the first name that no run wrote
    scene: str = ""  # scene.yaml of the run, if that alone repeats it
    lattice: str = ""  # digest of the file that its lattice came from
    status: str = ""  # of the run


def look(folder: Path) -> Held:
    """What `folder` holds; nothing if it does not exist. Raises OSError if it cannot be read or is no folder."""
    if not os.path.lexists(folder):
        return Held()
    names = tuple(sorted(name for name in os.listdir(folder) if not name.startswith(".")))
    # A run's folders hold nothing but pictures or frames of a trajectory.
    plain = [name for name in names if (folder / name).is_file() or only_numbered(folder / name)]
    known = {"scene.yaml", "summary.json", *RESULTS, *FILMS}
    foreign = [name for name in names if name not in plain or not (name in known or _MADE.fullmatch(name))]
    text, summary = _read(folder / "scene.yaml"), read_summary(folder)
    scene = text if all(map(_RESOLVED.fullmatch, text.splitlines())) else ""
    if names and not foreign and not (scene and summary.get("status")):
        foreign = [name for name in names if name == "scene.yaml"] or [names[0]]
    if foreign:
        return Held(names, foreign[0])
    digest, status = (str(summary.get(key, "")) for key in ("lattice_digest", "status"))
    return Held(names, "", "" if "own_start" in summary else scene, digest, status)


def refuse_run(out: Path) -> None:
    """Raise InputError if `out` holds a run: other files would spoil it."""
    with suppress(OSError):  # what cannot be looked at cannot be written either
        if look(out).status:
            raise InputError(f"{out} holds a run; choose another folder with --out")


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ""


def read_summary(folder: Path) -> dict[str, Any]:
    """The summary.json of a run; empty where there is none that can be read."""
    try:
        summary = json.loads(_read(folder / "summary.json"))
    except (ValueError, RecursionError):
        return {}
    return summary if isinstance(summary, dict) else {}


class RunFolder:
    """Use as `with RunFolder(...) as folder:` and write the run's files, summary.json last, into `folder.path`.

    When the block ends all files appear in `folder.out`, also if it ends with an error or Ctrl-C. If there is no
    summary.json by then, nothing remains.

    Args:
        out: where the run shall be; as an attribute, where it will be, or is.
        scene_yaml: the resolved scene; written as scene.yaml.
        explicit: whether a person has named `out`. If not, and it is taken, out-2, out-3, … are tried.
        overwrite: whether another run may be replaced.
        say: told that the run goes elsewhere, and why.
        repeatable: whether scene.yaml alone repeats the run. (Else its summary has a key own_start.)
        lattice: digest of the file that the lattice is taken from. (The summary has it as lattice_digest.)

    Raises InputError on entry, with nothing left behind, if the folder holds something else, is in use or cannot be
    written; SimulationError on leaving if the files cannot be moved: they stay in `path`.
    """

    path: Path  # the hidden folder in which the run is built
    film: str | None  # name of a film of the same scene that is there, and stays unless the run brings one

    def __init__(
        self,
        out: Path | str,
        scene_yaml: str,
        explicit: bool,
        overwrite: bool = False,
        say: Callable[[str], None] = lambda text: None,
        repeatable: bool = True,
        lattice: str = "",
    ) -> None:
        self.out, self._scene_yaml, self._explicit = Path(out).expanduser(), scene_yaml, explicit
        self._overwrite, self._say, self._repeatable, self._lattice = overwrite, say, repeatable, lattice
        self._held = ExitStack()  # locks, and folders that go again if nothing is in them

    def __enter__(self) -> RunFolder:
        try:
            with ExitStack() as undo:
                undo.callback(self._held.close)
                if self.out.name in ("", ".."):  # such a name cannot be counted on
                    self.out = self.out.resolve()
                self.out = self._choose([self.out] if self._explicit else _counted(self.out))
                there = look(self.out)
                self.film = next((name for name in FILMS if name in there.names and self._same(there)), None)
                self.path = self.out / f".{os.getpid()}.partial"
                undo.callback(remove, self.path)
                self.path.mkdir()
                write_text(self.path / "scene.yaml", self._scene_yaml)
                undo.pop_all()
        except (OSError, ValueError) as error:
            raise cannot_write(self.out, error) from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with signals_wait(), self._held:
            self._settle(failed=error is not None)

    def _settle(self, failed: bool) -> None:
        """Move the run to its folder, or remove it if it has come to nothing."""
        try:
            if (status := read_summary(self.path).get("status")) is not None:
                self._keep(str(status))
            else:
                remove(self.path)
        except OSError as problem:
            text = f"cannot move the run into {self.out}: {reason(problem)}; it stays in {self.path}"
            if not failed:
                raise SimulationError(text) from problem
            self._say(text)

    def _choose(self, folders: Iterable[Path], status: str = "done", why: str = "") -> Path:
        """The first of `folders` that a run of this status may be written into, locked; InputError if there is none.

        `why` says what was wrong with the folder that the run should have gone to; empty if it has not been tried.
        """
        for folder in folders:
            with ExitStack() as held:
                held.callback(remove_empty, prepare_output(folder))
                try:
                    if _lock(folder, held):
                        _clear(folder)
                    refusal = self._refusal(folder, status)
                except BlockingIOError:
                    refusal = "is being written by another run"
                if not refusal:
                    self._held.push(held.pop_all())
                    if why:
                        self._say(f"{why}; this run goes into {folder}")
                    return folder
            why = why or f"{folder} {refusal}"
        raise InputError(f"{why}; choose another folder with --out")

    def _refusal(self, folder: Path, status: str) -> str:
        """Why a run of this status may not be written into `folder`; empty if it may."""
        held = look(folder)
        if held.foreign:
            return f"holds {held.foreign}, which no run wrote"
        if held.status == "done" and status != "done":
            return "holds a finished run"
        if not held.names or self._overwrite or self._same(held):
            return ""
        return "holds another run" + " (--overwrite replaces it)" * self._explicit

    def _same(self, held: Held) -> bool:
        """Whether a folder holds a run of this scene."""
        return self._repeatable and (held.scene, held.lattice) == (self._scene_yaml, self._lattice)

    def _keep(self, status: str) -> None:
        """Move the run to its folder, or to another one if that may not be, or may no longer be, replaced."""
        if refusal := self._refusal(self.out, status):
            name = self.out.name if status == "done" else f"{self.out.name}-{status}"
            self.out = self._choose(_counted(self.out.with_name(name)), status, f"{self.out} {refusal}")
        moving = self.out / f".{os.getpid()}.moving"
        os.rename(self.path, moving)
        _move_files(moving, self.out)


def _counted(folder: Path) -> Iterator[Path]:
    yield folder
    for number in count(2):
        yield folder.with_name(f"{folder.name}-{number}")


def _lock(folder: Path, held: ExitStack) -> bool:
    """Lock a folder until `held` is closed, or the process ends, however it ends; False where no locks are known.

    Raises BlockingIOError while another run holds it.
    """
    place, known = folder / ".lock", True
    handle = os.open(place, os.O_RDWR | os.O_CREAT, 0o666)
    held.callback(os.close, handle)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:
        known = False
    if not os.fstat(handle).st_nlink:  # the run that held it has ended since the file was opened, and removed it
        raise BlockingIOError
    held.callback(remove, place)
    return known


def _clear(folder: Path) -> None:
    """Finish what a killed run was moving, and remove what others had begun to build."""
    for left in folder.glob(".*"):
        if re.fullmatch(r"\.\d+\.partial", left.name):
            remove(left)
        elif re.fullmatch(r"\.\d+\.moving", left.name):
            _move_files(left, folder)


def _move_files(stage: Path, folder: Path) -> None:
    """Move the files of a run out of `stage` into its folder. Raises OSError."""
    names = set(os.listdir(stage))
    if "scene.yaml" in names:  # nothing has been moved yet
        new, old = look(stage), look(folder)
        another = not new.scene or (new.scene, new.lattice) != (old.scene, old.lattice)
        outdated = ["summary.json", "scene.yaml", *RESULTS, *names]
        if another or names.intersection(FILMS):
            outdated += FILMS
        if another:
            outdated += filter(_MADE.fullmatch, old.names)
        for name in outdated:
            remove(folder / name)
    for name in sorted(names, key=lambda name: (name != "scene.yaml", name == "summary.json")):
        os.replace(stage / name, folder / name)
    stage.rmdir()
