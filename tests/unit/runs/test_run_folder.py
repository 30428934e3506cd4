"""A run's folder holds one whole run; finished runs and the user's files are safe."""

import errno
import json
import os
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest

from taichi_disk.base.errors import InputError, SimulationError
from taichi_disk.base.files import check_pictures
from taichi_disk.experiments.config.tree import as_path
from taichi_disk.pictures.render.film import check_target
from taichi_disk.runs.output.run_folder import refuse_run, run_folder

SCENE = "scene: compression\nlattice:\n  points: 100         # number of points\n"
OTHER = SCENE.replace("100", "200")
RUN = {"scene.yaml", "timeseries.csv", "plot.png", "summary.json"}
FOREIGN = "thesis.tex .git/HEAD .profile scene.yaml plot.png summary.json frames/me.png"


def content(folder):
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_text() for path in files}


def marks(folder):
    """Return the mark of each run in a folder, by its plot's name."""
    files = content(folder)
    return {name: files[name] for name in files if name.endswith("plot.png")}


def end(folder, status="done"):
    """Write the summary of a run without other files."""
    (folder.path / "summary.json").write_text(json.dumps({"status": status}))


def refused(text=None):
    return pytest.raises(InputError, match=text)


def compute(
    out, scene=SCENE, status="done", count_on=False, mark="", files=(), **options
):
    """Write a run of a few files that contain `mark`, and return its folder."""
    with run_folder(as_path(out, "out"), scene, count_on, **options) as folder:
        if status == "done":
            folder.take_over()
        for name in ("timeseries.csv", "plot.png", *files):
            (folder.path / name).parent.mkdir(exist_ok=True)
            (folder.path / name).write_text(mark)
        summary = {"status": status, "lattice_digest": options.get("lattice", "")}
        (folder.path / "summary.json").write_text(json.dumps(summary))
        if status == "failed":
            (folder.path / "failure.npz").write_text(mark)
            with suppress(SimulationError):
                raise SimulationError
    return folder.out


@pytest.mark.parametrize("error", [None, SimulationError("bad"), KeyboardInterrupt()])
def test_a_run_appears_at_its_end_in_whole_whatever_ends_it(tmp_path, error):
    out = tmp_path / "a" / "run"
    with (
        suppress(SimulationError, KeyboardInterrupt),
        run_folder(out, SCENE, count_on=False) as folder,
    ):
        end(folder, "failed")
        assert all(name.startswith(".") for name in os.listdir(out.parent))
        if error:
            raise error
    assert content(tmp_path) == {
        "a/run/scene.yaml": SCENE,
        "a/run/summary.json": '{"status": "failed"}',
    }


def test_a_run_refused_while_it_is_prepared_leaves_nothing_not_even_folders(tmp_path):
    with refused(), run_folder(tmp_path / "a" / "b", SCENE, count_on=False):
        raise InputError
    assert list(tmp_path.iterdir()) == []


def test_the_same_scene_replaces_its_run(tmp_path):
    out = compute(tmp_path / "run", mark="first", status="failed")
    assert "failure.npz" in content(out)
    with run_folder(out, SCENE, count_on=False) as folder:
        end(folder)
        assert content(out)["plot.png"] == "first"
    assert set(content(tmp_path)) == {"run/scene.yaml", "run/summary.json"}
    with refused("run holds a run; choose another folder"):
        refuse_run(out)
    for other in (tmp_path, tmp_path / "new"):
        refuse_run(other)


def test_a_default_name_counts_on_past_other_runs_and_says_so(notices, tmp_path):
    for k, scene in enumerate((SCENE, OTHER, OTHER.replace("200", "300"), OTHER)):
        compute(tmp_path / "run", scene, count_on=True, mark=str(k))
    expected = {"run/plot.png": "0", "run-2/plot.png": "3", "run-3/plot.png": "2"}
    assert marks(tmp_path) == expected
    run = tmp_path / "run"
    message = f"{run} holds another run; this run goes into {run}-2"
    assert notices.messages[0] == message
    assert len(notices.messages) == 3


def test_a_named_folder_is_refused_if_it_holds_another_run_unless_overwriting(tmp_path):
    compute(tmp_path / "run", mark="first", files=("video.mp4",))
    before = content(tmp_path)
    text = r"run holds another run \(overwrite=True replaces it\); choose another fold"
    with refused(text):
        compute(tmp_path / "run", OTHER)
    assert content(tmp_path) == before
    compute(tmp_path / "run", OTHER, overwrite=True, mark="second")
    # no film of the first
    assert set(content(tmp_path)) == {f"run/{name}" for name in RUN}
    assert content(tmp_path)["run/plot.png"] == "second"
    assert content(tmp_path)["run/scene.yaml"] == OTHER


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("name", FOREIGN.split())
def test_files_that_no_run_wrote_are_never_touched(tmp_path, name, overwrite):
    text = SCENE if name == "scene.yaml" else "{}"
    path = tmp_path / "run" / name
    path.parent.mkdir(parents=True)
    path.write_text(text)
    part = Path(name).parts[0]
    with refused(f"holds {part}, which no run wrote; choose another folder"):
        compute(tmp_path / "run", overwrite=overwrite)
    assert content(tmp_path) == {f"run/{name}": text}


def test_a_run_s_folder_with_a_user_s_file_is_left(tmp_path):
    out = compute(tmp_path / "run")
    (out / "scene.yaml").write_text(f"# mine\n{SCENE}")
    with refused("holds another run"):
        compute(out)
    (out / "thesis.tex").write_text("mine")
    before = content(out)
    with refused("no run wrote"):
        compute(out, overwrite=True)
    assert compute(out, count_on=True) == tmp_path / "run-2"
    assert content(out) == before


def test_the_current_folder_is_refused_and_an_empty_one_is_taken(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for out in (".", "../" + tmp_path.name, tmp_path.parent):
        with refused("is the current folder, which no run can replace: name a folder"):
            compute(out)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "out" / "run").mkdir(parents=True)
    assert compute(Path("out/run"), count_on=True) == Path("out/run")
    # reported as a relative path
    assert compute(Path("out/run"), OTHER, count_on=True) == Path("out/run-2")


def test_a_home_is_refused_even_if_it_is_empty(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home").mkdir(mode=0o700)
    before = os.stat(tmp_path / "home")
    for out in ("~", tmp_path / "home", "~/../home"):
        with refused("is your home, which no run can replace: name a folder in it as"):
            compute(out)
    assert os.stat(tmp_path / "home") == before
    assert content(tmp_path) == {}
    assert compute("~/run") == tmp_path / "home" / "run"


def test_films_and_trajectories_made_from_a_run_stay_beside_it(tmp_path):
    out = compute(tmp_path / "run", files=("video.mp4",), mark="first")
    made = {"render.mp4", "trajectory.xyz"}
    for name in made:
        (out / name).write_text("x")
    with run_folder(out, SCENE, count_on=False) as folder:
        folder.take_over()
        assert folder.film() == "video.mp4"
        end(folder)
    assert set(content(out)) == {"scene.yaml", "summary.json", "video.mp4", *made}
    for mark in ("old", "new"):
        compute(out, mark=mark, files=("trajectory/0_springs.vtu", "trajectory.pvd"))
        assert content(out)["trajectory/0_springs.vtu"] == mark
    compute(out, OTHER, overwrite=True)
    assert set(content(out)) == RUN
    assert os.listdir(tmp_path) == ["run"]


def test_runs_that_began_with_arrays_of_a_person_are_not_of_the_same_scene(tmp_path):
    compute(tmp_path / "run", mark="own", lattice="a")
    for options in ({}, {"lattice": "b"}):
        with refused("holds another run"):
            compute(tmp_path / "run", **options)
    compute(tmp_path / "run", lattice="a", mark="again")
    compute(tmp_path / "run", overwrite=True)
    with refused("holds another run"):
        compute(tmp_path / "run", lattice="a")


@pytest.mark.parametrize("status", ["failed", "interrupted"])
@pytest.mark.parametrize("count_on", [False, True])
def test_a_run_without_end_replaces_no_whole_one(notices, tmp_path, status, count_on):
    compute(tmp_path / "run", mark="good")
    for mark in ("bad", "worse"):
        options = {"status": status, "count_on": count_on, "mark": mark}
        out = compute(tmp_path / "run", **options)
        assert out == tmp_path / f"run-{status}"
    expected = {"run/plot.png": "good", f"run-{status}/plot.png": "worse"}
    assert marks(tmp_path) == expected
    message = f"{tmp_path}/run holds a finished run; this run goes into {out}"
    assert notices.messages[0] == message


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("before", [None, SCENE])
def test_of_two_simultaneous_runs_the_later_to_finish_takes_another_folder_and_says_so(
    notices, tmp_path, monkeypatch, before, overwrite
):
    if before:
        compute(tmp_path / "run", before, mark="before")
    pid = os.getpid()
    third = OTHER.replace("200", "300")
    overwrite = overwrite or bool(before)
    with run_folder(tmp_path / "run", OTHER, False, overwrite) as first:
        end(first)
        with monkeypatch.context() as patch:
            patch.setattr(os, "getpid", lambda: pid + 1)
            out = compute(tmp_path / "run", third, mark="second", overwrite=overwrite)
            assert out == tmp_path / "run"
    assert first.out == tmp_path / "run-2"
    assert len(notices.messages) == 1
    assert f"goes into {tmp_path}/run-2" in notices.messages[0]
    assert content(tmp_path / "run")["plot.png"] == "second"
    assert set(content(first.out)) == {"scene.yaml", "summary.json"}
    assert set(os.listdir(tmp_path)) == {"run", "run-2"}


def test_a_file_that_comes_during_a_run_stays_and_the_run_is_kept(notices, tmp_path):
    with run_folder(tmp_path / "run", SCENE, count_on=False) as folder:
        end(folder)
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "notes").write_text("mine")
    assert folder.out == tmp_path / "run-2"
    assert len(notices.messages) == 1
    files = {"run/notes", "run-2/scene.yaml", "run-2/summary.json"}
    assert set(content(tmp_path)) == files


KILLED = """
import os, shutil, sys
from pathlib import Path
from taichi_disk.runs.output.run_folder import refuse_run, run_folder
moves = []
def counted(move):
    def moved(old, *new, **options):
        is_trial = new and Path(new[0]).exists()  # whether a folder can be renamed
        is_beside = Path(old).parent == Path(sys.argv[1]).parent
        if is_beside and Path(old).exists() and not is_trial:
            if len(moves) == int(sys.argv[3]):
                print("ready", flush=True)
                sys.stdin.read()
            moves.append(old)
        move(old, *new, **options)
    return moved
os.rename = counted(os.rename)
os.replace = counted(os.replace)
shutil.rmtree = counted(shutil.rmtree)
with run_folder(Path(sys.argv[1]), sys.argv[2], True, True) as folder:
    for name in ("timeseries.csv", "plot.png"):
        (folder.path / name).write_text("new")
    folder.take_over()
    (folder.path / "summary.json").write_text('{"status": "done"}')
"""


@pytest.mark.parametrize(
    ("scene", "moves"), [(SCENE, 0), (SCENE, 1), (SCENE, 2), (OTHER, 0), (OTHER, 1)]
)
def test_a_killed_run_leaves_the_old_or_the_new_one_whole_and_the_next_puts_it_right(
    tmp_path, scene, moves
):
    out = compute(tmp_path / "run", mark="old")
    (out / "render.mp4").write_text("made")
    command = [sys.executable, "-c", KILLED, str(out), scene, str(moves)]
    child = subprocess.Popen(command, stdin=-1, stdout=-1, text=True)
    assert child.stdout.readline() == "ready\n"
    child.kill()
    child.wait()
    mark = "new" if moves == 2 else "old"
    whole = {"scene.yaml": SCENE, "render.mp4": "made"}
    whole |= {"timeseries.csv": mark, "plot.png": mark}
    there = out if out.exists() else tmp_path / ".taichi-disk.old.run"
    assert content(there).items() >= whole.items()
    compute(out, mark="next")
    assert set(content(out)) == {*RUN, "render.mp4"}
    assert [name for name in os.listdir(tmp_path) if ".new." not in name] == ["run"]


@pytest.mark.parametrize(
    "code", [errno.EXDEV, errno.EBUSY, errno.ENOSYS, errno.EPERM, errno.EOPNOTSUPP]
)
def test_a_run_is_copied_if_folders_cannot_be_renamed(tmp_path, monkeypatch, code):
    # A mount point is busy, an overlay does not rename folders of a lower layer, and an
    # object store has no folders.
    def files_only(move):
        def moved(old, new):
            if Path(old).is_dir():
                raise OSError(code, os.strerror(code))
            move(old, new)

        return moved

    monkeypatch.setattr(os, "rename", files_only(os.rename))
    monkeypatch.setattr(os, "replace", files_only(os.replace))
    for mark in ("old", "new"):
        out = compute(tmp_path / "run", mark=mark, files=("frames/1.png",))
        assert out == tmp_path / "run"
        assert content(out)["plot.png"] == content(out)["frames/1.png"] == mark
        (out / "render.mp4").write_text("made")
    assert set(content(out)) == {*RUN, "frames/1.png", "render.mp4"}
    assert os.listdir(tmp_path) == ["run"]
    with refused("holds another run"):
        compute(out, OTHER)


@pytest.fixture
def foreign(tmp_path, monkeypatch):
    """Return a folder below one in which this user can make nothing."""

    def denying(function):
        def denied(*paths, **options):
            for path in (*paths, options.get("dir", "")):
                if Path(path) == tmp_path or Path(path).parent == tmp_path:
                    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            return function(*paths, **options)

        return denied

    (tmp_path / "run").mkdir()
    for name in ("rename", "replace"):
        monkeypatch.setattr(os, name, denying(getattr(os, name)))
    inside = tempfile.TemporaryFile
    monkeypatch.setattr(
        "taichi_disk.base.files.TemporaryFile",
        lambda dir: denying(inside)(dir=dir) if dir == tmp_path else inside(dir=dir),
    )
    return tmp_path / "run"


def test_a_folder_below_a_foreign_one_is_filled_and_replaced(foreign):
    for mark in ("old", "new"):
        assert compute(foreign, mark=mark, files=("frames/1.png",)) == foreign
        assert content(foreign)["plot.png"] == content(foreign)["frames/1.png"] == mark
        assert {one.name for one in foreign.iterdir()} == {*RUN, "frames"}
    with refused("holds another run"):
        compute(foreign, OTHER)
    assert compute(foreign, OTHER, overwrite=True, mark="third") == foreign
    assert {one.name for one in foreign.iterdir()} == RUN


def test_a_failed_run_that_finds_no_place_says_where_it_is(foreign, notices):
    compute(foreign)

    move = os.replace

    def replace(old, new):
        if Path(old).is_dir():
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        move(old, new)

    with pytest.MonkeyPatch.context() as patch, pytest.raises(SimulationError):
        patch.setattr(os, "replace", replace)
        with run_folder(foreign, SCENE, False) as folder:
            end(folder, "failed")
            raise SimulationError
    assert folder.out.parent == foreign
    assert notices.messages[-1].endswith(f"it stays in {folder.out}")


@pytest.mark.parametrize("letter", ["c", "\u00e9", "\u4e2d"])
def test_a_name_as_long_as_the_file_system_allows_is_taken(tmp_path, letter):
    name = letter * (240 // len(letter.encode()))
    for mark in ("old", "new"):
        out = compute(tmp_path / name, mark=mark)
        assert content(out)["plot.png"] == mark
    assert os.listdir(tmp_path) == [name]


LOGS = ("run.log", "slurm-1234.out", ".snakemake_timestamp")


def test_the_logs_of_other_programs_stay_in_a_folder_and_go_on(tmp_path):
    (tmp_path / "run").mkdir()
    logs = [(tmp_path / "run" / name).open("a") for name in LOGS]
    for mark in ("old", "new"):
        for log in logs:
            print(mark, file=log, flush=True)
        out = compute(tmp_path / "run", mark=mark)
        assert out == tmp_path / "run"
        assert content(out)["plot.png"] == mark
        assert all(content(out)[name].endswith(f"{mark}\n") for name in LOGS)
    assert {one.name for one in out.iterdir()} == {*RUN, *LOGS}
    assert os.listdir(tmp_path) == ["run"]


def test_what_is_write_protected_is_not_replaced(tmp_path, monkeypatch):
    out = compute(tmp_path / "run", files=("frames/00001.png",), mark="old")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with refused("run is write-protected or a link to nothing; choose another"):
        compute(out, overwrite=True)
    assert compute(out, count_on=True) == tmp_path / "run-2"
    with refused("frames is not a writable folder"):
        check_pictures(out / "frames")


LITTER = "Thumbs.db desktop.ini ._plot.png .nfs000000001 .directory @eaDir .DS_Store"


def test_the_litter_of_file_systems_is_no_file_of_a_person(tmp_path):
    out = compute(tmp_path / "run", files=("frames/00001.png",), mark="old")
    for name in (*LITTER.split(), ".~lock.timeseries.csv#"):
        (out / name).write_text("x")
        (out / "frames" / name).write_text("x")
    assert compute(out, mark="new") == out
    assert content(out)["plot.png"] == "new"
    check_pictures(out / "frames")


@pytest.mark.parametrize(
    "name",
    ["c" * 300, "a\0b", "a/" + "b" * 256 + "/c", "/", "/proc", "/proc/taichi/disk"],
)
def test_a_place_that_cannot_be_written_is_refused(tmp_path, name):
    with refused():
        compute(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_link_to_a_folder_is_followed_and_one_to_itself_refused(tmp_path):
    (tmp_path / "loop").symlink_to("loop")
    for use in (compute, check_target):
        with refused("loop is .*(link to nothing|not a writable)"):
            use(tmp_path / "loop")
    (tmp_path / "disk").mkdir()
    (tmp_path / "link").symlink_to("disk")
    compute(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert set(os.listdir(tmp_path / "disk")) == RUN
