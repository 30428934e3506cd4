"""Files of results appear whole or not at all; closed folders are refused at once."""

import errno
import os
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from taichi_disk.base import files
from taichi_disk.base.errors import InputError, SimulationError
from taichi_disk.base.files import atomic_write, check_pictures, prepare_output
from taichi_disk.mechanics.simulation.observables import COLUMNS
from taichi_disk.runs.output import arrays

ABSENT = ("sliding", "friction")  # columns of zeros, which are left out


def everything(folder):
    return set(folder.rglob("*"))


def test_a_new_folder_is_made_with_its_parents_and_an_old_one_is_left_alone(tmp_path):
    out = tmp_path / "a" / "b"
    assert prepare_output(out) == [out, tmp_path / "a"]
    assert prepare_output(out) == []
    assert everything(tmp_path) == {tmp_path / "a", out}


@pytest.mark.parametrize("below", ["", "b/c"])
def test_a_file_in_the_way_is_named_and_nothing_is_left(tmp_path, below):
    blocker = tmp_path / "file"
    blocker.write_text("")
    text = rf"folder .*: {blocker} is a file; choose another as `out`"
    with pytest.raises(InputError, match=text):
        prepare_output(blocker / below)
    assert everything(tmp_path) == {blocker}


@pytest.mark.parametrize("failure", [None, KeyboardInterrupt, ValueError])
def test_a_file_is_replaced_by_a_whole_one_or_stays(tmp_path, failure):
    path = tmp_path / "lattice.npz"
    path.write_text("old")

    def write(new):
        new.write_text("new")
        assert path.read_text() == "old"
        assert new.suffix == ".npz"  # NumPy appends .npz to other names.
        assert new.parent == tmp_path
        if failure:
            raise failure

    with pytest.raises(failure) if failure else nullcontext():
        atomic_write(path, write)
    assert path.read_text() == ("old" if failure else "new")
    assert everything(tmp_path) == {path}


@pytest.mark.parametrize("code", [errno.EACCES, errno.ENOSPC, errno.EROFS, errno.EXDEV])
def test_what_cannot_be_renamed_is_copied_if_there_is_room(tmp_path, monkeypatch, code):
    def refuse(*_):
        raise OSError(code, "cannot rename")

    path = tmp_path / "plot.png"
    path.write_text("old")
    monkeypatch.setattr(os, "replace", refuse)
    is_copied = code == errno.EXDEV
    with nullcontext() if is_copied else pytest.raises(SimulationError):
        atomic_write(path, lambda new: new.write_text("new"))
    assert path.read_text() == ("new" if is_copied else "old")
    assert everything(tmp_path) == {path}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_a_failed_computation_that_names_the_file(tmp_path):
    def fail(new):
        Path("/dev/full").write_text("x" * 100_000)

    text = r"cannot write .*final\.npz: No space left on device"
    with pytest.raises(SimulationError, match=text):
        atomic_write(tmp_path / "final.npz", fail)
    assert everything(tmp_path) == set()


def test_only_a_folder_of_numbered_files_is_replaced(tmp_path):
    folder = tmp_path / "frames"

    def write(new):
        new.mkdir()
        (new / "0.png").touch()

    atomic_write(folder, write)
    (folder / "1.png").touch()
    atomic_write(folder, write)
    assert {path.name for path in folder.iterdir()} == {"0.png"}
    (folder / "me.png").touch()
    with pytest.raises(
        InputError, match="not a writable folder with only numbered pictures"
    ):
        check_pictures(folder)
    assert everything(tmp_path) == {folder, folder / "0.png", folder / "me.png"}


def test_the_time_series_reads_back_bitwise_and_is_thinned_on_request(tmp_path):
    rng = np.random.default_rng(0)
    columns = {one.name: rng.random(20) for one in COLUMNS}
    columns |= {"t": 0.1 * np.arange(20), **dict.fromkeys(ABSENT, np.zeros(20))}
    del columns["xi"]  # only a loading has this column
    arrays.write_timeseries(tmp_path / "a.csv", columns)
    table = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True)
    written = [one.name for one in COLUMNS if one.written != "never"]
    names = [name for name in written if name not in (*ABSENT, "xi")]
    assert table.dtype.names == tuple(names)
    assert all(np.array_equal(table[name], columns[name]) for name in names)
    arrays.write_timeseries(tmp_path / "b.csv", columns, 0.6)
    table = np.genfromtxt(tmp_path / "b.csv", delimiter=",", names=True)
    assert np.array_equal(table["t"], columns["t"][[0, 6, 12, 18, 19]])
    columns["sliding"] = np.where(np.arange(20) == 19, 1e-3, 0.0)  # begins at 0
    arrays.write_timeseries(tmp_path / "c.csv", columns)
    table = np.genfromtxt(tmp_path / "c.csv", delimiter=",", names=True)
    assert set(table.dtype.names) == {*names, "sliding"}


@pytest.mark.parametrize(
    "content", [b"", b"[]", b"[" * 100_000, b"{", b"\xff", b"{}" + b" " * 20_000_000]
)
def test_a_damaged_summary_is_none(tmp_path, content):
    (tmp_path / "summary.json").write_bytes(content)
    assert files.read_summary(tmp_path) == {}
    (tmp_path / "summary.json").unlink()
    (tmp_path / "summary.json").symlink_to("/dev/zero")  # a device is not read
    assert files.read_summary(tmp_path) == {}


def test_a_summary_has_no_numbers_that_json_lacks(tmp_path):
    with pytest.raises(ValueError):
        files.write_summary(tmp_path / "summary.json", {"restitution": float("nan")})
