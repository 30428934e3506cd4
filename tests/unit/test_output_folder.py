"""A run's folder holds one run, whole; what was finished, and what belongs to a person, is never lost."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.output.run_folder import RunFolder
from taichi_disk.signals import interrupts

SCENE = "scene: compression\nlattice:\n  points: 100                    # number of points\n"
OTHER = SCENE.replace("100", "200")
RUN = {"scene.yaml", "timeseries.csv", "plot.png", "summary.json"}


def content(folder):
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def compute(out, scene=SCENE, status="done", explicit=True, mark="", files=(), own_start=False, **options):
    """A run that leaves a few files which hold `mark`; returns where."""
    with RunFolder(out, scene, explicit, **options) as folder:
        for name in ("timeseries.csv", "plot.png", *files):
            (folder.path / name).parent.mkdir(exist_ok=True)
            (folder.path / name).write_text(mark)
        summary = {"status": status, "mark": mark} | ({"own_start": ""} if own_start else {})
        (folder.path / "summary.json").write_text(json.dumps(summary))
        if status == "failed":
            (folder.path / "failure.npz").write_text(mark)
            with suppress(SimulationError):
                raise SimulationError
    return folder.out


@pytest.mark.parametrize("end", [None, SimulationError("bad"), KeyboardInterrupt()])
def test_a_run_appears_at_its_end_in_whole_whatever_ends_it(tmp_path, end):
    out = tmp_path / "a" / "run"
    with suppress(SimulationError, KeyboardInterrupt), RunFolder(out, SCENE, explicit=True) as folder:
        (folder.path / "summary.json").write_text('{"status": "failed"}')
        assert all(name.startswith(".") for name in os.listdir(out))
        if end:
            raise end
    assert content(tmp_path) == {"a/run/scene.yaml": SCENE, "a/run/summary.json": '{"status": "failed"}'}


def test_a_run_refused_while_it_is_prepared_leaves_nothing_not_even_folders(tmp_path):
    with pytest.raises(InputError), RunFolder(tmp_path / "a" / "b", SCENE, explicit=True):
        raise InputError
    assert list(tmp_path.iterdir()) == []


def test_the_same_scene_replaces_its_run(tmp_path):
    out = compute(tmp_path / "run", mark="first", status="failed")
    assert "failure.npz" in content(out)
    inode = out.stat().st_ino
    with RunFolder(out, SCENE, explicit=True) as folder:
        (folder.path / "summary.json").write_text('{"status": "done"}')
        assert content(out)["plot.png"] == "first"
    assert set(content(tmp_path)) == {"run/scene.yaml", "run/summary.json"}
    assert out.stat().st_ino == inode  # a shell that stands in it still does


def test_a_default_name_counts_on_past_other_runs_and_says_so(tmp_path):
    said = []
    for k, scene in enumerate((SCENE, OTHER, OTHER.replace("200", "300"), OTHER)):
        compute(tmp_path / "run", scene, explicit=False, mark=str(k), say=said.append)
    marks = {name: text for name, text in content(tmp_path).items() if name.endswith("plot.png")}
    assert marks == {"run/plot.png": "0", "run-2/plot.png": "3", "run-3/plot.png": "2"}
    assert said[0] == f"{tmp_path}/run holds another run; this run goes into {tmp_path}/run-2" and len(said) == 3


def test_a_folder_that_was_named_is_refused_if_it_holds_another_run_unless_overwriting(tmp_path):
    compute(tmp_path / "run", mark="first", files=("video.mp4",))
    before = content(tmp_path)
    with pytest.raises(InputError, match=r"run holds another run \(--overwrite replaces it\); choose another folder"):
        compute(tmp_path / "run", OTHER)
    assert content(tmp_path) == before
    compute(tmp_path / "run", OTHER, overwrite=True, mark="second")
    assert set(content(tmp_path)) == {f"run/{name}" for name in RUN}  # no film of the first
    assert content(tmp_path)["run/plot.png"] == "second" and content(tmp_path)["run/scene.yaml"] == OTHER


MINE = [("thesis.tex", "x"), ("scene.yaml", "# mine\n" + SCENE)]


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize(
    ("name", "text"),
    [*MINE, ("scene.yaml", SCENE), ("plot.png", "x"), ("summary.json", "{}"), ("frames/portrait.png", "x")],
)
def test_what_no_run_wrote_is_never_touched(tmp_path, name, text, overwrite):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    with pytest.raises(InputError, match=f"holds {Path(name).parts[0]}, which no run wrote; choose another folder"):
        compute(tmp_path, overwrite=overwrite)
    assert content(tmp_path) == {name: text}


@pytest.mark.parametrize(("name", "text"), MINE)
def test_a_run_s_folder_with_a_person_s_file_is_left_as_it_is(tmp_path, name, text):
    out = compute(tmp_path / "run")
    (out / name).write_text(text)
    before = content(out)
    with pytest.raises(InputError, match="no run wrote"):
        compute(out, overwrite=True)
    assert compute(out, explicit=False) == tmp_path / "run-2"
    assert content(out) == before


def test_the_working_directory_may_be_the_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    compute(Path("."), mark="first")
    assert set(os.listdir()) == RUN
    compute(Path("out/run"), explicit=False)
    assert compute(Path("out/run"), OTHER, explicit=False) == Path("out/run-2")  # told as a relative name


def test_films_and_trajectories_made_from_a_run_stay_beside_it(tmp_path):
    out = compute(tmp_path / "run", files=("video.mp4",), mark="first")
    made = {"render.mp4", "trajectory.xyz", ".DS_Store"}
    for name in made:
        (out / name).write_text("x")
    with RunFolder(out, SCENE, explicit=True) as folder:
        assert folder.film == "video.mp4"
        (folder.path / "summary.json").write_text('{"status": "done"}')
    assert set(content(out)) == {"scene.yaml", "summary.json", "video.mp4", *made}
    for mark in ("old", "new"):
        compute(out, mark=mark, files=("trajectory/0_springs.vtu", "trajectory.pvd"))
        assert content(out)["trajectory/0_springs.vtu"] == mark
    compute(out, OTHER, overwrite=True)
    assert set(content(out)) == {*RUN, ".DS_Store"}


def test_runs_that_began_with_arrays_of_a_person_are_no_runs_of_the_same_scene(tmp_path):
    own = {"repeatable": False, "own_start": True}
    compute(tmp_path / "run", mark="own", **own)
    for options in ({}, own):
        with pytest.raises(InputError, match="holds another run"):
            compute(tmp_path / "run", **options)
    compute(tmp_path / "run", overwrite=True)
    with pytest.raises(InputError, match="holds another run"):
        compute(tmp_path / "run", **own)


@pytest.mark.parametrize("status", ["failed", "interrupted"])
@pytest.mark.parametrize("explicit", [False, True])
def test_a_run_without_end_never_replaces_a_finished_one(tmp_path, status, explicit):
    said = []
    compute(tmp_path / "run", mark="good")
    for mark in ("bad", "worse"):
        out = compute(tmp_path / "run", status=status, explicit=explicit, mark=mark, say=said.append)
        assert out == tmp_path / f"run-{status}"
    marks = {name: text for name, text in content(tmp_path).items() if name.endswith("plot.png")}
    assert marks == {"run/plot.png": "good", f"run-{status}/plot.png": "worse"}
    assert said[0] == f"{tmp_path}/run holds a finished run; this run goes into {tmp_path}/run-{status}"


def test_of_two_runs_at_once_the_second_is_refused_or_counts_on(tmp_path):
    with RunFolder(tmp_path / "run", SCENE, explicit=True) as first:
        with pytest.raises(InputError, match="run is being written by another run; choose another folder with --out"):
            compute(tmp_path / "run")
        assert compute(tmp_path / "run", explicit=False) == tmp_path / "run-2"
        (first.path / "summary.json").write_text('{"status": "done"}')
    assert sorted(os.listdir(tmp_path)) == ["run", "run-2"]


def test_a_file_that_comes_while_the_run_computes_stays_and_the_run_is_not_lost(tmp_path):
    said = []
    with RunFolder(tmp_path / "run", SCENE, explicit=True, say=said.append) as folder:
        (folder.path / "summary.json").write_text('{"status": "done"}')
        (tmp_path / "run" / "notes").write_text("mine")
    assert folder.out == tmp_path / "run-2" and len(said) == 1
    assert set(content(tmp_path)) == {"run/notes", "run-2/scene.yaml", "run-2/summary.json"}


def test_a_run_that_cannot_be_moved_is_kept_where_it_is(tmp_path, monkeypatch):
    def full(stage, folder):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "rename", full)
    with pytest.raises(SimulationError, match=r"cannot move the run into .*: No space left on device; it stays in "):
        compute(tmp_path / "run")
    assert len(content(tmp_path)) == len(RUN)


@pytest.mark.parametrize("before", [None, SCENE, OTHER])
def test_a_move_that_was_cut_short_is_finished_by_the_next_run(tmp_path, monkeypatch, before):
    out = tmp_path / "run"
    if before:
        compute(out, before, files=("failure.npz",), mark="old")
    moves = []

    def replace(source, target):
        moves.append(target)
        if len(moves) == 3:
            raise OSError(5, "power cut")
        os.rename(source, target)

    with monkeypatch.context() as patch, pytest.raises(SimulationError):
        patch.setattr(os, "replace", replace)
        compute(out, overwrite=True, mark="new")
    assert "summary.json" not in os.listdir(out)  # nobody takes this for a run
    with pytest.raises(InputError, match="other"), RunFolder(out, SCENE, explicit=True):
        assert {name for name in os.listdir(out) if name[0] != "."} == RUN
        assert content(out)["plot.png"] == "new"
        raise InputError("other")


KILLED = """
import sys
from taichi_disk.output.run_folder import RunFolder
from taichi_disk.signals import interrupts
with RunFolder(sys.argv[1], sys.argv[2], True) as folder:
    print("ready", flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("there", [False, True])
def test_what_a_killed_run_leaves_is_cleared_by_the_next(tmp_path, there):
    out = tmp_path / "run"
    if there:
        compute(out)
    child = subprocess.Popen([sys.executable, "-c", KILLED, str(out), SCENE], stdin=-1, stdout=-1, text=True)
    assert child.stdout.readline() == "ready\n"
    with pytest.raises(InputError, match="being written by another run"):
        compute(out)
    child.kill()
    child.wait()
    assert any("partial" in name for name in os.listdir(out))
    compute(out)
    assert set(os.listdir(out)) == RUN and os.listdir(tmp_path) == ["run"]


def test_a_signal_waits_until_the_run_is_moved(tmp_path, monkeypatch):
    move = os.rename

    def interrupted(stage, folder):
        signal.raise_signal(signal.SIGINT)
        move(stage, folder)

    monkeypatch.setattr(os, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt), interrupts():
        compute(tmp_path / "run")
    assert set(os.listdir(tmp_path / "run")) == RUN and os.listdir(tmp_path) == ["run"]


@pytest.mark.parametrize("name", ["c" * 300, "a\0b", "a/" + "b" * 256 + "/c", "/", "/proc", "/proc/taichi/disk"])
def test_a_place_that_cannot_be_written_is_refused(tmp_path, name):
    with pytest.raises(InputError):
        compute(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_link_to_a_folder_is_followed(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "link").symlink_to("disk")
    compute(tmp_path / "link")
    assert (tmp_path / "link").is_symlink() and set(os.listdir(tmp_path / "disk")) == RUN
