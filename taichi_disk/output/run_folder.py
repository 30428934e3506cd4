"""The folder of one run: it is chosen before anything is computed, and appears by one
rename when the run has ended.

Until then the run is built in a hidden folder beside it. docs/output.md says what may
be replaced.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.output import files
from taichi_disk.output.files import Contents, look


@dataclass
class RunFolder:
    """The folder `out` of a run, which is written at the hidden `path`. `made`: earlier
    films and exports to keep."""

    out: Path
    path: Path
    made: list[str]

    def take_over(self) -> str | None:
        """Copy earlier films and trajectories of the same run; return the name of a
        film, or None."""
        for name in self.made:
            old, new = self.out / name, self.path / name
            if not new.exists():
                shutil.copytree(old, new) if old.is_dir() else shutil.copy2(old, new)
        return next((name for name in files.FILMS if (self.path / name).exists()), None)


@contextmanager
def run_folder(
    out: Path | str,
    scene_yaml: str,
    explicit: bool,
    overwrite: bool = False,
    notify: Callable[[str], None] = lambda text: None,
    lattice: str = "",
) -> Iterator[RunFolder]:
    """Use as `with run_folder(...) as folder:` and write the run's files, summary.json
    last, into `folder.path`.

    When the block ends, also by an error or Ctrl-C, `folder.path` becomes `folder.out`,
    or is removed if it has no summary.json.

    Args:
        out: folder of the run.
        scene_yaml: the resolved scene; written as scene.yaml.
        explicit: whether the user named `out`. If not, and `out` is in use, out-2,
            out-3, … are tried.
        overwrite: whether another run in `out` may be replaced.
        notify: receives a sentence if another folder is used.
        lattice: digest of a custom lattice or custom velocities, lattice_digest in the
            summary.

    Raises InputError on entry, with nothing left behind, if the folder holds something
    else, cannot be renamed or cannot be written. Raises SimulationError on exit if
    `path` cannot be renamed; the run then stays there.
    """
    run = scene_yaml, lattice
    before: Contents | None = None  # contents of the folder when the run began

    def refusal(held: Contents, status: str) -> str:
        if held.foreign:
            return f"holds {held.foreign}, which no run wrote"
        if held.status == "done" and status != "done":
            return "holds a finished run"
        # `overwrite` does not permit replacing a run that appeared while this one was
        # computed.
        if not held.names or run == held.run or (overwrite and before in (None, held)):
            return ""
        return "holds another run" + " (overwrite=True replaces it)" * explicit

    def choose(folders: Iterable[Path], status: str) -> Path:
        why = ""
        for folder in folders:
            files.restore(folder)
            if not (no := refusal(look(folder), status)):
                if why:
                    notify(f"{why}; this run goes into {folder}")
                return folder
            why = why or f"{folder} {no}"
        raise InputError(f"{why}; choose another folder as `out`")

    asked, made = Path(out).expanduser(), list[Path]()
    try:
        # a folder cannot be renamed to such a path
        if asked.name == ".." or asked.is_symlink():
            asked = asked.resolve()
        refuse_place(asked)
        made = files.prepare_output(asked.parent)
        chosen = choose([asked] if explicit else _counted(asked), "done")
        before = look(chosen)
        kept = [
            name
            for name in before.names
            if name in files.FILMS or files.MADE.fullmatch(name)
        ]
        folder = RunFolder(
            chosen, files.hidden(chosen), kept if run == before.run else []
        )
        # left by a killed process: in a container all processes may have the same
        # number
        files.remove(folder.path)
        folder.path.mkdir()
    except (OSError, ValueError) as error:
        files.remove_empty(made)
        raise files.cannot_write(asked, error) from None
    try:
        files.write_text(folder.path / "scene.yaml", scene_yaml)
        yield folder
    finally:
        if status := str(files.read_summary(folder.path).get("status", "")):
            if status != "done":
                asked = chosen.with_name(f"{chosen.name}-{status}")
            try:
                folder.out = choose(chain([chosen], _counted(asked)), status)
                files.replace(folder.path, folder.out)
            except OSError as error:
                text = (
                    f"cannot move the run into {folder.out}: {files.reason(error)}; it"
                    f" stays in {folder.path}"
                )
                raise SimulationError(text) from error
        else:
            files.remove(folder.path)
            files.remove_empty(made)


def refuse_place(out: Path) -> None:
    """Raise InputError if `out` is a folder that no run can replace."""
    what = ""
    with suppress(RuntimeError):  # a user without a home
        if Path.home().resolve().is_relative_to(out.resolve()):
            what = "your home"
    if files.holds_working_directory(out):
        what = "the current folder"
    elif os.path.ismount(out):
        what = "the mount point of a file system"
    if what:
        raise InputError(
            f"{out} is {what}, which no run can replace: name a folder in it as `out`"
        )


def refuse_run(out: Path) -> None:
    try:
        held = out.is_dir() and look(out).status
    except OSError as error:
        raise files.cannot_write(out, error) from None
    if held:
        raise InputError(f"{out} holds a run; choose another folder as `out`")


def _counted(folder: Path) -> Iterator[Path]:
    yield folder
    for number in count(2):
        yield folder.with_name(f"{folder.name}-{number}")
