"""Result files appear whole or not at all, and a folder that cannot be written is refused without a trace."""

from __future__ import annotations

from pathlib import Path

import pytest

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.output import atomic_write, prepare_output


def everything(folder: Path) -> set[Path]:
    return set(folder.rglob("*"))


def test_a_new_folder_is_made_with_its_parents_and_is_empty(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    prepare_output(out)
    assert out.is_dir() and everything(out) == set()


def test_an_existing_folder_keeps_what_it_holds(tmp_path: Path) -> None:
    (tmp_path / "old.txt").write_text("old")
    prepare_output(tmp_path)
    assert everything(tmp_path) == {tmp_path / "old.txt"}


@pytest.mark.parametrize("below", ["", "b", "b/c"])
def test_a_file_in_the_way_is_named_and_nothing_is_left(tmp_path: Path, below: str) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(InputError, match=rf"folder .*: {blocker} is a file; choose another with --out"):
        prepare_output(blocker / below)
    assert everything(tmp_path) == {blocker}


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a file system that nobody can write to")
def test_a_place_that_cannot_be_written_is_refused() -> None:
    # Not even root may make a folder there.
    with pytest.raises(InputError, match="cannot write into the output folder /proc/taichi"):
        prepare_output(Path("/proc/taichi/disk"))
    with pytest.raises(InputError, match="cannot write into the output folder /proc:"):
        prepare_output(Path("/proc"))


def test_folders_made_on_the_way_are_removed_on_failure(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        prepare_output(tmp_path / "a" / "b" / ("c" * 300))
    assert everything(tmp_path) == set()


def test_a_name_with_a_nul_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        prepare_output(tmp_path / "a\0b")


def test_a_written_file_replaces_the_old_one_and_nothing_else_remains(tmp_path: Path) -> None:
    path = tmp_path / "lattice.npz"
    path.write_text("old")
    seen: list[Path] = []

    def write(beside: Path) -> None:
        seen.append(beside)
        assert path.read_text() == "old"
        beside.write_text("new")

    atomic_write(path, write)
    assert path.read_text() == "new" and everything(tmp_path) == {path}
    # NumPy appends .npz to other names, ffmpeg guesses the format by the suffix.
    assert seen[0].suffix == ".npz" and seen[0].parent == tmp_path


@pytest.mark.parametrize("failure", [KeyboardInterrupt, ValueError, SystemExit])
def test_a_failed_writer_leaves_the_old_file_and_no_other(tmp_path: Path, failure: type[BaseException]) -> None:
    path = tmp_path / "summary.json"
    path.write_text("old")

    def write(beside: Path) -> None:
        beside.write_text("half")
        raise failure

    with pytest.raises(failure):
        atomic_write(path, write)
    assert path.read_text() == "old" and everything(tmp_path) == {path}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_a_failed_computation_that_names_the_file(tmp_path: Path) -> None:
    def write(beside: Path) -> None:
        Path("/dev/full").write_text("x" * 100_000)

    with pytest.raises(SimulationError, match=r"cannot write .*final\.npz: No space left on device"):
        atomic_write(tmp_path / "final.npz", write)
    assert everything(tmp_path) == set()


def test_a_folder_that_has_become_a_file_is_told_and_no_more(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.write_text("")
    with pytest.raises(SimulationError, match=f"cannot write {folder}/scene.yaml: Not a directory"):
        atomic_write(folder / "scene.yaml", lambda beside: beside.touch())
    assert everything(tmp_path) == {folder}
