"""The folder of one run: it is chosen before anything is computed, and appears with all
numbers of the run, by one rename if the storage can rename folders.

Until then the run is built in a hidden folder beside it, or in it if nothing can be
made beside it. Curves, film and trajectory join it later, each when it is complete.
docs/output.md says what may be replaced.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import NamedTuple

from taichi_disk.base import files
from taichi_disk.base.errors import NOTICES, InputError, reason
from taichi_disk.base.text_files import read_text

FILMS = ("video.mp4", "video.webm", "video.gif", "video.html", "frames")
RUN_FILES = re.compile(
    r"scene\.yaml|summary\.json|timeseries\.csv|(lattice|final|failure)\.npz|plot\.png"
    r"|outline\.\w+"
)
# what a process has not finished, or a killed one had not
UNFINISHED = re.compile(r"\..+-\d+\.new\..+")
# films, and default names of what `render` and `export` add to a run
PICTURES = re.compile(
    r"(video|render|comparison)\.(mp4|webm|gif|html|png)|frames|render|comparison"
    r"|trajectory(\.(xyz|gsd|pvd|npz))?"
)


class StoredRun(NamedTuple):
    """The run in a folder; all "" if the folder is empty or does not exist."""

    scene: str = ""  # text of scene.yaml
    lattice: str = ""  # digest of a custom lattice or custom velocities
    status: str = ""

    @property
    def identity(self) -> tuple[str, str]:
        """What tells two runs apart: scene and lattice."""
        return self.scene, self.lattice


def stored_run(folder: Path) -> StoredRun:
    """Return the run that `folder` holds and may be replaced. Raises InputError if the
    folder is write-protected or holds anything else, OSError if it cannot be listed."""
    names = []
    if os.path.lexists(folder):
        if not os.access(folder, os.W_OK):  # it could be moved aside, but not removed
            raise InputError(f"{folder} is write-protected or a link to nothing")
        names = files.listed(folder)
        names = [name for name in names if not UNFINISHED.fullmatch(name)]
    summary = files.read_summary(folder)
    is_run = "status" in summary and "scene.yaml" in names
    for name in names:
        if not (is_run and _is_of_a_run(folder / name)):
            raise InputError(f"{folder} holds {name}, which no run wrote")
    if not is_run:
        return StoredRun()
    return StoredRun(
        scene=read_text(folder / "scene.yaml"),
        lattice=str(summary.get("lattice_digest", "")),
        status=str(summary["status"]),
    )


def _is_of_a_run(path: Path) -> bool:
    # Its only folders hold pictures or the frames of a trajectory.
    if PICTURES.fullmatch(path.name):
        return path.is_file() or files.only_numbered(path)
    return RUN_FILES.fullmatch(path.name) is not None and path.is_file()


@dataclass
class RunFolder:
    """The folder of a run while the run is computed and drawn.

    Attributes:
        path: folder into which the files are written; hidden, until it appears.
        out: folder in which they appear; another one if it has become unsuitable.
        replaceable: identities of the runs that may be replaced, this run's first.
        failure: why the folder stays hidden.
    """

    path: Path
    out: Path
    replaceable: list[tuple[str, str]]
    failure: str = ""

    def take_over(self) -> None:
        """Copy earlier films and trajectories of the same run."""
        with suppress(InputError):  # something else has appeared there
            if stored_run(self.out).identity != self.replaceable[0]:
                return
            for one in filter(PICTURES.fullmatch, os.listdir(self.out)):
                files.atomic_write(self.path / one, partial(files.copy, self.out / one))

    def film(self) -> str | None:
        """Return the name of a film in the folder, or None."""
        for name in FILMS:
            if (self.path / name).exists():
                return name
        return None

    def choose(self, folders: Iterable[Path], status: str, advice: str = "") -> Path:
        """Return the first of `folders` that a run with `status` may become. Raises
        InputError if there is none; `advice` follows "holds another run"."""
        refusal = None
        for folder in folders:
            files.restore(folder)
            try:
                self._check(folder, status, advice)
            except InputError as error:
                refusal = refusal or error
                continue
            if refusal:
                NOTICES.info(f"{refusal}; this run goes into {folder}")
            return folder
        raise InputError(f"{refusal}; choose another folder as `out`")

    def _check(self, folder: Path, status: str, advice: str) -> None:
        """Raise InputError if a run with `status` must not replace `folder`."""
        stored = stored_run(folder)
        if stored.status == "done" and status != "done":
            raise InputError(f"{folder} holds a finished run")
        if stored.status and stored.identity not in self.replaceable:
            raise InputError(f"{folder} holds another run{advice}")

    def appear(self) -> None:
        """Move a run that is in `path` to `out`, or to another folder if `out` has
        become unsuitable. If that fails, `failure` says why, and the run stays where it
        is."""
        status = files.read_summary(self.path).get("status")
        if self.path == self.out or not status:
            return
        alternative = self.out
        if status != "done":
            alternative = self.out.with_name(f"{self.out.name}-{status}")
        try:
            self.out = self.choose(chain([self.out], _numbered(alternative)), status)
            files.replace(self.path, self.out)
            self.path = self.out
        except OSError as error:
            self.failure = (
                f"cannot move the run into {self.out}: {reason(error)}; it stays in"
                f" {self.path}"
            )
            self.out = self.path


@contextmanager
def run_folder(
    out: Path,
    scene_yaml: str,
    count_on: bool,
    overwrite: bool = False,
    lattice: str = "",
) -> Iterator[RunFolder]:
    """Use as `with run_folder(...) as folder:` and write the run's files and
    summary.json into `folder.path`.

    The folder appears by `folder.appear()`, or when the block ends, also by an error or
    Ctrl-C. If it has no summary.json, it is removed.

    Args:
        out: folder of the run.
        scene_yaml: the resolved scene; written as scene.yaml.
        count_on: whether to use out-2, out-3, … if `out` is in use.
        overwrite: whether another run in `out` may be replaced.
        lattice: digest of a custom lattice or custom velocities, lattice_digest in the
            summary.

    Raises InputError on entry, with nothing left behind, if the folder holds something
    else or cannot be written.
    """
    with ExitStack() as cleanup:
        try:
            out = _place(out)
            path = files.hidden(out)
            try:
                made = files.prepare_output(out.parent)
            except InputError:
                if not out.is_dir():
                    raise
                # The folder above may be another user's: the run is built in its own.
                made = files.prepare_output(out)
                path = out / path.name
            cleanup.callback(files.remove_empty, made)
            # A killed process may have left this folder: its name contains the number
            # of the process, which is often the same in every container.
            files.remove(path)
            cleanup.callback(files.remove, path)
            path.mkdir()
            files.write_text(path / "scene.yaml", scene_yaml)
            folder = RunFolder(path, out, [(scene_yaml, lattice)])
            if overwrite:
                with suppress(InputError):  # which `choose` raises again, with advice
                    folder.replaceable.append(stored_run(out).identity)
            if count_on:
                folder.out = folder.choose(_numbered(out), "done")
            else:
                folder.choose([out], "done", " (overwrite=True replaces it)")
        except (OSError, ValueError) as error:
            raise files.cannot_write(out, error) from None
        try:
            yield folder
        except BaseException:
            for unfinished in folder.path.glob(".*.new.*"):  # by the drawing process
                files.remove(unfinished)
            folder.appear()
            if folder.failure:
                NOTICES.error(folder.failure)
            raise
        finally:
            folder.appear()
            if folder.path == folder.out:
                cleanup.pop_all()


def _place(out: Path) -> Path:
    """Return the path to which a run can be renamed. Raises InputError if `out` is a
    folder that no run can replace."""
    target = os.path.realpath(out)
    if out.name == ".." or out.is_symlink():
        out = Path(target)
    home = Path(os.path.expanduser("~"))
    for name, place in (("your home", home), ("the current folder", Path.cwd())):
        if place.resolve().is_relative_to(target):
            raise InputError(
                f"{out} is {name}, which no run can replace: name a folder in it as"
                " `out`"
            )
    return out


def _numbered(folder: Path) -> Iterator[Path]:
    yield folder
    for number in count(2):
        yield folder.with_name(f"{folder.name}-{number}")


def refuse_run(out: Path) -> None:
    """Raise InputError if `out` holds a run, or cannot be read."""
    try:
        is_run = out.is_dir() and "summary.json" in files.listed(out)
    except OSError as error:
        raise files.cannot_write(out, error) from None
    if is_run and "status" in files.read_summary(out):
        raise InputError(f"{out} holds a run; choose another folder as `out`")
