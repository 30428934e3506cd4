"""The command line: arguments, exit status, messages, imports."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from time import time

import numpy as np
import pytest
from programs import command, python, summary_in

from taichi_disk import __version__
from taichi_disk.base.errors import InputError, SimulationError
from taichi_disk.cli import main
from taichi_disk.experiments.config import tree
from taichi_disk.experiments.scenes import load_scene

SMALL = ("lattice.points=60", "material.eta_star=0")
WILD = (*SMALL, "time.dt=0.22")  # 1.5 times the limit


def arguments(out, *settings, scene="exponential_wall"):
    changes = [f"--set={setting}" for setting in settings]
    return ["run", scene, f"--out={out}", "--no-video", "--lattices=1", *changes]


def leave(words):
    """Return the exit status of a command that ends while it reads its arguments."""
    with pytest.raises(SystemExit) as leaving:
        main(words)
    return leaving.value.code


def names(folder):
    return {path.name for path in folder.iterdir()}


@pytest.mark.validate
def test_a_run_notes_where_eta_star_per_point_makes_another_body(tmp_path, capsys):
    few = (*SMALL, "material.eta_star=10")
    assert main(arguments(tmp_path / "few", *few)) == 0
    (note,) = summary_in(tmp_path / "few")["notes"]
    assert capsys.readouterr().err.count(f"note: {note}") == 1
    assert "18.3 times as viscous" in note
    assert "viscosity = 0.0091" in note
    for settings in ((*few, "material.viscosity=0.1"), SMALL):
        assert main([*arguments(tmp_path / "o", *settings), "--overwrite"]) == 0
        assert "note" not in capsys.readouterr().err
        assert "notes" not in summary_in(tmp_path / "o")
    assert not load_scene("exponential_wall").notes(1099)


def test_a_run_goes_into_out_and_the_name_of_the_scene_unless_a_folder_is_named(
    tmp_path, monkeypatch
):
    calls = []

    def run(scene, out, *, count_on, overwrite, **_):
        calls.append((str(out), count_on, overwrite))
        raise InputError("enough")

    monkeypatch.setattr("taichi_disk.runs.api.run", run)
    monkeypatch.setenv("HOME", "/home/me")
    for words in ((), ("--out", "o", "--overwrite"), ("--out=~/o",)):
        assert main(["run", "exponential_wall", *words]) == 2
    assert calls == [
        ("out/exponential_wall", True, False),
        ("o", False, True),
        ("/home/me/o", False, False),
    ]
    monkeypatch.chdir(tmp_path)
    for name in ["a.yaml", "b.yml", "v0.05", "...yaml", "..yaml", "....yml"]:
        (tmp_path / name).write_text("scene: exponential_wall\n")
        main(["run", name])
    folders = ["a", "b", "v0.05", "...yaml", "..yaml", "....yml"]
    assert [out for out, *_ in calls[3:]] == [f"out/{name}" for name in folders]


@pytest.mark.usefixtures("without_plots")
def test_messages_of_the_command_line_name_options(tmp_path, capsys):
    for velocity in (0.03, 0.04):
        thrown = ("lattice.points=30", f"impact.velocity={velocity}")
        status = main(arguments(tmp_path / "r", *thrown))
    assert status == 2
    again = "another run (--overwrite replaces it); choose another folder with --out\n"
    assert again in capsys.readouterr().err
    assert main(["view", str(tmp_path), "--set", "wall.a=30"]) == 2
    assert "--set cannot change the scenes of a folder" in capsys.readouterr().err


@pytest.mark.usefixtures("without_plots")
def test_numbers_are_printed_if_a_run_cannot_be_moved(tmp_path, capsys, monkeypatch):
    replace = os.replace

    def full(new, path):
        if os.path.isdir(new):
            raise OSError(errno.ENOSPC, "No space left on device")
        replace(new, path)

    monkeypatch.setattr(os, "replace", full)
    assert main(arguments(tmp_path / "r", "lattice.points=30")) == 1
    out, err = capsys.readouterr()
    assert out.startswith("restitution e ")
    assert "error: cannot move the run into" in err
    folder = Path(out.rpartition("files in ")[2].splitlines()[0])
    assert {"summary.json", "final.npz"} <= names(folder)


FAILURES = {
    "blow-up": ("exponential_wall", *WILD),
    "max_time": ("exponential_wall", "lattice.points=60", "impact.max_time=1.0"),
    "newton": ("compression", "lattice.points=60", "compression.max_time=5"),
}


@pytest.mark.parametrize(
    "word", ["blow-up", "max_time", pytest.param("newton", marks=pytest.mark.validate)]
)
def test_a_scene_that_does_not_end_is_a_failure_with_a_reason(tmp_path, capsys, word):
    out = tmp_path / "o"
    scene, *settings = FAILURES[word]
    assert main([*arguments(out, *settings, scene=scene), "--force"]) == 1
    assert word in capsys.readouterr().err
    summary = summary_in(out)
    assert summary["status"] == "failed"
    assert word in summary["reason"]
    assert not {"restitution", "xi"} & set(summary)
    if word != "blow-up":
        return
    assert "stability limit" in summary["reason"]
    assert names(out) == {"scene.yaml", "lattice.npz", "summary.json", "failure.npz"}
    last = np.load(out / "failure.npz")  # the last good state
    for name in ("positions", "velocities"):
        assert last[name].shape == (60, 2)
        assert np.isfinite(last[name]).all()


NO_MEMORY = (
    "error: not enough memory; take fewer points (lattice.points), or stop other"
    " programs\n"
)


@pytest.mark.parametrize(
    ("failure", "status", "message"),
    [
        (InputError("no such step"), 2, "error: no such step\n"),
        (SimulationError("blown up"), 1, "error: blown up\n"),
        (KeyboardInterrupt(), 130, "interrupted\n"),
        (MemoryError(), 1, NO_MEMORY),
        (RuntimeError("Cannot allocate memory"), 1, NO_MEMORY),  # of Taichi
        (OSError(28, "No space left"), 1, "error: No space left\n"),
    ],
)
def test_each_failure_has_its_status_and_message(
    monkeypatch, capsys, failure, status, message
):
    def fail(*_, **__):
        raise failure

    monkeypatch.setattr("taichi_disk.runs.api.run", fail)
    assert main(["run", "exponential_wall"]) == status
    assert capsys.readouterr() == ("", message)


def test_check_prints_a_scene_that_checks_as_the_same(tmp_path, capsys):
    assert main(["check", "absorbing_wall", "--set", "wall.boundary=pinned"]) == 0
    first = capsys.readouterr().out
    (tmp_path / "again.yaml").write_text(first)
    assert "boundary: pinned" in first
    assert first.endswith("\n# no fault found: this scene can be run\n")
    assert main(["check", str(tmp_path / "again.yaml")]) == 0
    assert capsys.readouterr().out == first


@pytest.mark.parametrize(
    ("scene", "settings"),
    [
        ("absorbing_wall", ["wall.points=60"]),
        ("exponential_wall", ["time.dt=0.05"]),
        ("exponential_wall", ["lattice.file=nowhere.csv"]),
    ],
)
def test_check_refuses_what_run_does_in_its_words(tmp_path, capsys, scene, settings):
    assert main(["check", scene, *(f"--set={setting}" for setting in settings)]) == 2
    message = capsys.readouterr().err
    assert main(arguments(tmp_path / "o", *settings, scene=scene)) == 2
    assert capsys.readouterr().err == message
    assert settings[0].partition(".")[0] in message
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("wrong", "advice"),
    [
        (["jump"], "usage: taichi-disk"),
        (["run", "a.yaml", "b.yaml"], "b.yaml; a command takes one scene"),
        (["run"], "usage: taichi-disk"),
        (["run", "a", "--threads", "0"], "whole number from 1"),
        (["run", "wall", "--eta", "30"], "--set material.eta_star=30"),
        (["run", "wall", "--set", "wall.a", "=", "30"], "--set material.eta_star=30"),
        (["run", "wall", "--out", "~no-such-user/x"], "there is no user of this name"),
    ],
)
def test_wrong_usage_exits_2_with_advice(wrong, advice, capsys):
    assert leave(wrong) == 2
    assert advice in capsys.readouterr().err


def test_the_bare_command_version_and_help_exit_0(capsys):
    for arguments, text in (
        ([], "usage: taichi-disk"),
        (["--version"], f"taichi-disk {__version__}\n"),
        (["--help"], "usage: taichi-disk"),
        (["render", "--help"], "[--theme light|dark]"),
    ):
        assert leave(arguments) == 0
        assert text in capsys.readouterr().out


def test_check_and_help_load_nothing_that_is_slow():
    # Imports determine the start-up time; a clock would fail on a busy machine.
    code = """
import sys
import taichi_disk.base.runtime  # as the entry point does
from taichi_disk.cli import main
SLOW = set("taichi taichi_forge scipy matplotlib rich imageio av PIL meshio".split())
checks = [["check", name] for name in ("exponential_wall", "figure3", "no-such-scene")]
for words in ["--help"], *checks:
    try:
        main(words)
    except SystemExit:
        pass
    slow = SLOW & set(sys.modules)
    if slow or words == ["--help"] and "numpy" in sys.modules:
        sys.exit(f"{words} loaded {slow or 'numpy'}")
import taichi_disk.pictures.render.palette  # names and colours of curves
if "matplotlib" in sys.modules:
    sys.exit("the colours of pictures loaded Matplotlib")
"""
    done = python("-c", code)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("redirection", "status"),
    # The first is `taichi-disk check ... | head -1`, whose reader has ended.
    [
        ("| true", 1),
        (">/dev/full", 1),
        (">&-", 0),
        ("2>&-", 0),
        pytest.param(">&- 2>&-", 0, marks=pytest.mark.validate),
        pytest.param("2>/dev/full", 0, marks=pytest.mark.validate),
    ],
)
def test_a_closed_or_full_output_ends_without_a_traceback(redirection, status):
    first = "exec"
    if redirection.startswith("|"):
        first = "sleep 0.2; exec"
    line = (
        f"set -o pipefail; ({first} {sys.executable} -m taichi_disk check"
        f" exponential_wall) {redirection}"
    )
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True)
    assert done.returncode == status
    assert "Traceback" not in done.stderr


def test_a_scene_may_come_through_a_pipe(tmp_path):
    scene = "scene: exponential_wall\nlattice: {points: 60, file: a.csv}\n"
    grid = [(x, y) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.1, 1.0)]
    np.savetxt(tmp_path / "a.csv", grid, delimiter=",")
    done = command("check", "/dev/stdin", input=scene, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"{tmp_path}/a.csv" in done.stdout


def test_labels_may_be_words_of_one_option_or_options_of_their_own(monkeypatch):
    received = []
    monkeypatch.setattr("taichi_disk.cli._render", received.append)
    for text in ("--label one two", "--label one --label two"):
        main(["render", "a", "--compare", "b", *text.split()])
    assert [one.label for one in received] == 2 * [["one", "two"]]


@pytest.mark.parametrize(
    "environment",
    [
        {"HOME": None, "MPLBACKEND": "bogus"},
        {"PYTHONWARNINGS": "error"},
        {"HOME": "/proc/no/home"},
        {"HOME": os.environ["HOME"], "TI_OFFLINE_CACHE_FILE_PATH": "/dev/null/x"},
    ],
)
@pytest.mark.validate
def test_in_a_strange_environment_a_run_and_its_clock_are_right(tmp_path, environment):
    (tmp_path / "matplotlibrc").write_text(
        "text.usetex: True\nsavefig.dpi: 900\naxes.facecolor: red\n"
    )
    (tmp_path / "t").mkdir()
    changed = os.environ | {"MATPLOTLIBRC": str(tmp_path / "matplotlibrc")}
    changed |= environment | {"TMPDIR": str(tmp_path / "t")}
    variables = {name: value for name, value in changed.items() if value is not None}
    began = time()
    done = command(*arguments(tmp_path / "o", *SMALL), env=variables)
    assert done.returncode == 0, done.stderr
    notes = done.stderr.splitlines()
    assert len(notes) == ("HOME" in environment)
    assert all("can use this run's compiled kernels" in line for line in notes)
    assert not list((tmp_path / "t").iterdir())  # no kernels that nobody finds
    path = tmp_path / "o" / "summary.json"
    summary = json.loads(path.read_text())
    assert summary["status"] == "done"
    # Only the start of the process is missing, which takes longer on a busy machine.
    # The clock of files ticks every few milliseconds.
    until_written = path.stat().st_mtime - began
    counted = sum(summary["wall_clock"].values())
    assert 0.6 * until_written <= counted <= until_written + 0.02
    assert main(arguments(tmp_path / "plain", *SMALL)) == 0
    strange, plain = (tmp_path / name / "plot.png" for name in ("o", "plain"))
    assert strange.read_bytes() == plain.read_bytes()


@pytest.mark.validate
def test_a_lock_that_a_killed_process_left_does_not_end_the_cache_of_kernels(tmp_path):
    lock = tmp_path / "ticache.lock"
    lock.touch()
    os.utime(lock, (0.0, 0.0))
    environment = os.environ | {"TI_OFFLINE_CACHE_FILE_PATH": str(tmp_path)}
    command(*arguments(tmp_path / "o", *SMALL), check=True, env=environment)
    assert not lock.exists()
    assert list(tmp_path.glob("*.tic"))


@pytest.mark.validate
def test_too_little_memory_is_reported_in_a_sentence(tmp_path):
    line = (
        f"ulimit -v 1500000; exec {sys.executable} -m taichi_disk"
        f" {' '.join(arguments(tmp_path / 'o', *SMALL))}"
    )
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True)
    assert done.returncode == 1
    assert "memory" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "o" / "timeseries.csv").exists()


def test_a_broken_cache_of_kernels_takes_no_printed_result_with_it():
    code = (
        "from types import SimpleNamespace; import os\n"
        "from taichi_disk.base import engine, runtime\n"
        "engine.loaded = lambda: SimpleNamespace(reset=os.abort)\n"
        "print('restitution')\n"
        "runtime.leave(0)"
    )
    done = python("-c", code)
    assert done.stdout == "restitution\n"
    assert done.returncode < 0


def test_nothing_among_the_shipped_scenes_ends_a_command(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "scenes"
    folder.mkdir()
    (folder / "latin.yaml").write_bytes(b"# \xe4\nscene: compression\n")
    (folder / "50%s.yaml").touch()
    (folder / "folder.yaml").mkdir()
    (folder / "link.yaml").symlink_to("nowhere")
    os.mkfifo(folder / "pipe.yaml")
    module = tmp_path / "package/experiments/config/tree.py"
    monkeypatch.setattr(tree, "__file__", str(module))
    for words in (["--version"], ["run", "--help"]):
        assert leave(words) == 0
    assert "shipped scene: 50%s, latin\n" in capsys.readouterr().out
    assert main(["check", "latin"]) == 2
    assert "latin.yaml:1: not UTF-8 text" in capsys.readouterr().err


@pytest.mark.parametrize("own", [{}, {"OPENBLAS_NUM_THREADS": "3"}])
def test_a_command_leaves_cores_to_the_simulation_unless_told_otherwise(own):
    code = (
        "import atexit, os, sys; sys.argv[1:] = ['--version']; atexit.register(lambda:"
        " print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['MPLBACKEND'],"
        " flush=True)); from taichi_disk.__main__ import process; process()"
    )
    others = {key: value for key, value in os.environ.items() if "OPENBLAS" not in key}
    ended = python("-c", code, env=others | own)
    used = own.get("OPENBLAS_NUM_THREADS", "1")
    assert ended.stdout.splitlines()[-1] == f"{used} agg"
