"""The folder of one run: chosen before anything is computed; it appears by one rename when the run has ended.

Until then the run is built in a hidden folder beside it. docs/output.md says what may be replaced.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from itertools import chain, count
from pathlib import Path
from types import TracebackType

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.output.files import (
    FILMS,
    Contents,
    beside,
    cannot_write,
    look,
    prepare_output,
    read_summary,
    reason,
    remove,
    remove_empty,
    replace,
    write_text,
)


def refuse_run(out: Path) -> None:
    """Raise InputError if `out` holds a run: other files would spoil it."""
    with suppress(OSError):  # what cannot be looked at cannot be written either
        if look(out).status:
            raise InputError(f"{out} holds a run; choose another folder with --out")


class RunFolder:
    """Use as `with RunFolder(...) as folder:` and write the run's files, summary.json last, into `folder.path`.

    When the block ends `folder.path` becomes `folder.out`, also if it ends with an error or Ctrl-C. If there is no
    summary.json by then, nothing remains.

    Args:
        out: where the run shall be; as an attribute, where it will be, or is.
        scene_yaml: the resolved scene; written as scene.yaml.
        explicit: whether a person has named `out`. If not, and it is taken, out-2, out-3, … are tried.
        overwrite: whether another run that is there now may be replaced.
        notify: called with a sentence if the run goes elsewhere.
        repeatable: whether scene.yaml alone repeats the run. (Else its summary has a key own_start.)
        lattice: digest of the file that the lattice is taken from. (The summary has it as lattice_digest.)

    Raises InputError on entry, with nothing left behind, if the folder holds something else, cannot be renamed or
    cannot be written; SimulationError on leaving if the run cannot be renamed: it stays in `path`.
    """

    path: Path  # the hidden folder in which the run is built
    film: str | None  # name of a film of the same scene that is there, and stays unless the run brings one

    def __init__(
        self,
        out: Path | str,
        scene_yaml: str,
        explicit: bool,
        overwrite: bool = False,
        notify: Callable[[str], None] = lambda text: None,
        repeatable: bool = True,
        lattice: str = "",
    ) -> None:
        self.out, self._explicit, self._overwrite, self._notify = Path(out).expanduser(), explicit, overwrite, notify
        self._scene_yaml, self._run = scene_yaml, (scene_yaml, lattice) if repeatable else None
        self._found: Contents | None = None  # in `out`, before the run

    def __enter__(self) -> RunFolder:
        try:
            with ExitStack() as undo:
                self._begin(undo)
                self._undo = undo.pop_all()
        except (OSError, ValueError) as error:
            raise cannot_write(self.out, error) from None
        return self

    def _begin(self, undo: ExitStack) -> None:
        if self.out.name in ("", "..") or self.out.is_symlink():  # a folder cannot be renamed to these
            self.out = self.out.resolve()
        if (here := Path.cwd().is_relative_to(self.out.resolve())) or os.path.ismount(self.out):
            what = "the folder you are in" if here else "where a file system is mounted"
            raise InputError(f"{self.out} is {what}, which no run can replace: name a folder in it with --out")
        undo.callback(remove_empty, prepare_output(self.out.parent))
        self._asked, self.out = self.out, self._choose(_counted(self.out) if not self._explicit else [self.out], "done")
        self._found = look(self.out)
        self.film = next((name for name in FILMS if name in self._found.names and self._same(self._found)), None)
        self.path = beside(self.out)
        undo.callback(remove, self.path)
        self.path.mkdir()
        write_text(self.path / "scene.yaml", self._scene_yaml)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._undo:
            if (status := read_summary(self.path).get("status")) is None:
                return
            try:
                asked = self._asked if status == "done" else self.out.with_name(f"{self.out.name}-{status}")
                self.out = self._choose(chain([self.out], _counted(asked)), status)
                replace(self.path, self.out)
            except OSError as problem:
                self._undo.pop_all()
                text = f"cannot move the run into {self.out}: {reason(problem)}; it stays in {self.path}"
                if error is None:
                    raise SimulationError(text) from problem
                self._notify(text)

    def _choose(self, folders: Iterable[Path], status: str) -> Path:
        """The first of `folders` that a run of this status may be written into; InputError if there is none."""
        why = ""
        for folder in folders:
            if not (refusal := self._refusal(look(folder), status)):
                if why:
                    self._notify(f"{why}; this run goes into {folder}")
                return folder
            why = why or f"{folder} {refusal}"
        raise InputError(f"{why}; choose another folder with --out")

    def _refusal(self, held: Contents, status: str) -> str:
        """Why a run of this status may not be written into a folder; empty if it may."""
        if held.foreign:
            return f"holds {held.foreign}, which no run wrote"
        if held.status == "done" and status != "done":
            return "holds a finished run"
        # What has come while the run was computed is not what a person wanted to be replaced.
        if not held.names or self._same(held) or (self._overwrite and self._found in (None, held)):
            return ""
        return "holds another run" + " (--overwrite replaces it)" * self._explicit

    def _same(self, held: Contents) -> bool:
        """Whether a folder holds a run of this scene."""
        return self._run is not None and held.run == self._run


def _counted(folder: Path) -> Iterator[Path]:
    yield folder
    for number in count(2):
        yield folder.with_name(f"{folder.name}-{number}")
