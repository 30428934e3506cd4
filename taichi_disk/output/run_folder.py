"""The folder of one run: it is chosen before anything is computed, and appears by one
rename when the run has ended.

Until then the run is built in a hidden folder beside it. docs/output.md says what may
be replaced.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from errno import EEXIST, ENOTEMPTY
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import NamedTuple

from taichi_disk.errors import InputError, SimulationError, reason
from taichi_disk.output import files
from taichi_disk.text_files import read_text

FILMS = ("video.mp4", "video.webm", "video.gif", "video.html", "frames")
RUN_FILES = re.compile(
    r"scene\.yaml|summary\.json|timeseries\.csv|(lattice|final|failure)\.npz|plot\.png"
)
# films, and default names of what `render` and `export` add to a run
PICTURES = re.compile(
    r"(video|render|comparison)\.(mp4|webm|gif|html|png)|frames|render|comparison"
    r"|trajectory(\.(xyz|gsd|pvd|npz))?"
)


class FolderContents(NamedTuple):
    names: list[str]
    foreign: list[str]  # names that no run has written
    # text of scene.yaml, and digest of a custom lattice or custom velocities
    run: tuple[str, str] = ("", "")
    status: str = ""  # of the run


def inspect(folder: Path) -> FolderContents:
    """Return the contents of `folder`, which are empty if it does not exist. Raises
    OSError if it cannot be listed."""
    if not folder.exists():
        return FolderContents([], [])
    names = files.listed(folder)
    summary = files.read_summary(folder)
    if "status" not in summary or "scene.yaml" not in names:
        return FolderContents(names, names)
    foreign = [name for name in names if not _is_of_a_run(folder / name)]
    if foreign:
        return FolderContents(names, foreign)
    try:
        scene = read_text(folder / "scene.yaml")
    except InputError:  # huge or not text, so no run wrote it
        return FolderContents(names, ["scene.yaml"])
    run = scene, str(summary.get("lattice_digest", ""))
    return FolderContents(names, [], run, str(summary["status"]))


def _is_of_a_run(path: Path) -> bool:
    # Its only folders hold pictures or the frames of a trajectory.
    if PICTURES.fullmatch(path.name):
        return path.is_file() or files.only_numbered(path)
    return RUN_FILES.fullmatch(path.name) is not None and path.is_file()


@dataclass
class RunFolder:
    """The folder of a run while the run is computed.

    Attributes:
        path: hidden folder, into which the files are written.
        out: folder in which they appear; another one if it has become unsuitable.
        replaceable: the runs that may be replaced, this one first.
        say: receives a sentence if another folder is used.
    """

    path: Path
    out: Path
    replaceable: list[tuple[str, str]]
    say: Callable[[str], None]

    def take_over(self) -> str | None:
        """Copy earlier films and trajectories of the same run, and return the name of
        a film, or None."""
        earlier = inspect(self.out)
        if earlier.run == self.replaceable[0]:
            for name in filter(PICTURES.fullmatch, earlier.names):
                if not (self.path / name).exists():
                    files.atomic_write(
                        self.path / name, partial(_copy, self.out / name)
                    )
        for name in FILMS:
            if (self.path / name).exists():
                return name
        return None

    def choose(self, folders: Iterable[Path], status: str, advice: str = "") -> Path:
        """Return the first of `folders` that a run with `status` may become. Raises
        InputError if there is none; `advice` follows "holds another run"."""
        refusal = ""
        for folder in folders:
            files.restore(folder)
            obstacle = self._obstacle(folder, status, advice)
            if not obstacle:
                if refusal:
                    self.say(f"{refusal}; this run goes into {folder}")
                return folder
            refusal = refusal or f"{folder} {obstacle}"
        raise InputError(f"{refusal}; choose another folder as `out`")

    def _obstacle(self, folder: Path, status: str, advice: str) -> str:
        """Return why a run with `status` must not replace `folder`, or an empty
        string."""
        contents = inspect(folder)
        if contents.foreign:
            return f"holds {contents.foreign[0]}, which no run wrote"
        if contents.status == "done" and status != "done":
            return "holds a finished run"
        if contents.names and contents.run not in self.replaceable:
            return f"holds another run{advice}"
        try:
            # This never succeeds, because `path` is not empty. But a mount point, or a
            # folder of a container's image, fails for its own reason.
            os.rename(folder, self.path)
        except OSError as error:
            if folder.is_dir() and error.errno not in (EEXIST, ENOTEMPTY):
                return f"cannot be renamed ({reason(error)})"
        return ""

    def appear(self, status: str) -> None:
        """Rename `path` to `out`, or to another folder if `out` has become unsuitable.
        Raises SimulationError if that fails; the run then stays in `path`."""
        others = self.out
        if status != "done":
            others = others.with_name(f"{others.name}-{status}")
        try:
            self.out = self.choose(chain([self.out], _numbered(others)), status)
            files.replace(self.path, self.out)
        except OSError as error:
            raise SimulationError(
                f"cannot move the run into {self.out}: {reason(error)}; it stays in"
                f" {self.path}"
            ) from error


@contextmanager
def run_folder(
    out: Path | str,
    scene_yaml: str,
    count_on: bool,
    overwrite: bool = False,
    say: Callable[[str], None] = lambda text: None,
    lattice: str = "",
) -> Iterator[RunFolder]:
    """Use as `with run_folder(...) as folder:` and write the run's files and
    summary.json into `folder.path`.

    When the block ends, also by an error or Ctrl-C, `folder.path` becomes `folder.out`,
    or is removed if it has no summary.json.

    Args:
        out: folder of the run.
        scene_yaml: the resolved scene; written as scene.yaml.
        count_on: whether to use out-2, out-3, … if `out` is in use.
        overwrite: whether another run in `out` may be replaced.
        say: receives a sentence if another folder is used.
        lattice: digest of a custom lattice or custom velocities, lattice_digest in the
            summary.

    Raises InputError on entry, with nothing left behind, if the folder holds something
    else, cannot be renamed or cannot be written. Raises SimulationError on exit if
    `path` cannot be renamed; the run then stays there.
    """
    asked = Path(out).expanduser()
    with ExitStack() as cleanup:
        try:
            asked = _place(asked)
            cleanup.callback(files.remove_empty, files.prepare_output(asked.parent))
            path = files.hidden(asked)
            # left by a killed process: in a container all processes may have the same
            # number
            files.remove(path)
            cleanup.callback(files.remove, path)
            path.mkdir()
            files.write_text(path / "scene.yaml", scene_yaml)
            folder = RunFolder(path, asked, [(scene_yaml, lattice)], say)
            if overwrite:
                folder.replaceable.append(inspect(asked).run)
            if count_on:
                folder.out = folder.choose(_numbered(asked), "done")
            else:
                folder.choose([asked], "done", " (overwrite=True replaces it)")
        except (OSError, ValueError) as error:
            raise files.cannot_write(asked, error) from None
        try:
            yield folder
        finally:
            status = files.read_summary(path).get("status")
            if status:
                cleanup.pop_all()
                folder.appear(str(status))


def _place(out: Path) -> Path:
    """Return the path to which a run can be renamed. Raises InputError if `out` is a
    folder that no run can replace."""
    if out.name == ".." or out.is_symlink():
        out = out.resolve()
    home = Path(os.path.expanduser("~"))
    for name, place in (("your home", home), ("the current folder", Path.cwd())):
        if place.resolve().is_relative_to(out.resolve()):
            raise InputError(
                f"{out} is {name}, which no run can replace: name a folder in it as"
                " `out`"
            )
    return out


def _numbered(folder: Path) -> Iterator[Path]:
    yield folder
    for number in count(2):
        yield folder.with_name(f"{folder.name}-{number}")


def _copy(old: Path, new: Path) -> None:
    if old.is_dir():
        shutil.copytree(old, new)
    else:
        shutil.copy2(old, new)


def refuse_run(out: Path) -> None:
    """Raise InputError if `out` holds a run, or cannot be read."""
    try:
        if not out.is_dir():
            return
        contents = inspect(out)
    except OSError as error:
        raise files.cannot_write(out, error) from None
    if contents.status:
        raise InputError(f"{out} holds a run; choose another folder as `out`")
