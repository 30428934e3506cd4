"""The program needs nothing of POSIX, no Unicode console and no path without spaces."""

import os
import sys
from pathlib import Path

import pytest
from programs import command, printed_by

from taichi_disk import load_scene
from taichi_disk.base.engine import environment
from taichi_disk.base.errors import InputError

ROOT = Path(__file__).parents[2]
# Every Python with this file in its path, including workers and the process that draws
# the plot, lacks what Windows lacks. Parts of the standard library that differ on
# Windows are imported before the modules are removed.
BARE = """
import os, signal, sys

for name in ("SIGALRM", "SIGHUP", "SIGUSR1", "setitimer", "alarm"):
    delattr(signal, name)
for name in ("pthread_sigmask", "pthread_kill"):
    delattr(signal, name)
import asyncio, subprocess
import multiprocessing.popen_spawn_posix, multiprocessing.resource_tracker

for name in ("fcntl", "grp", "pwd", "resource", "termios"):
    sys.modules[name] = None
for name in ("fork", "forkpty", "getuid", "geteuid", "getgid", "killpg"):
    delattr(os, name)
delattr(os, "sched_getaffinity")
kill = os.kill


def gentle_kill(pid, number):
    inside = sys._getframe(1).f_globals["__name__"]
    may_send = inside in ("subprocess", "multiprocessing.popen_fork")
    assert not number or may_send, f"{inside} sends signal {number}"
    kill(pid, number)


os.kill = gentle_kill
multiprocessing.set_start_method("spawn")
"""
RUN = """
import importlib, pkgutil
import taichi_disk
from taichi_disk.cli import main

for module in pkgutil.walk_packages(taichi_disk.__path__, "taichi_disk."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
small = ["lattice.points=20", "video.size=64", "video.seconds=0.2"]
settings = [f"--set={setting}" for setting in small]
raise SystemExit(main(["run", "exponential_wall", "--out", "out/a run", *settings]))
"""
# A program that contains Python, such as Blender.
APPLICATION = """
import sys
from pathlib import Path

sys.executable = str(Path("application").resolve())
from taichi_disk import load_scene, load_sweep, run, run_sweep

small = {"scene": "exponential_wall", "lattice": {"points": 20}}
run(load_scene(small), "run", video=False, lattices=1)
done = run_sweep(load_sweep(small | {"sweep": {"seed": [0, 1]}}), "sweep", jobs=2)
assert len(done.rows) == 2 and not done.failed
assert Path("run", "plot.png").exists() and Path("sweep", "points.csv").exists()
"""


@pytest.fixture
def bare(tmp_path):
    """A folder with a space, and an environment that lacks what Windows lacks."""
    place = tmp_path / "my desk"
    (place / "site").mkdir(parents=True)
    (place / "site" / "sitecustomize.py").write_text(BARE, encoding="utf-8")
    known = [
        str(place / "site"),
        *filter(None, [os.environ.get("PYTHONPATH"), str(ROOT)]),
    ]
    return place, {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(known),
        "PYTHONIOENCODING": "cp1252",
    }


@pytest.mark.validate
def test_all_modules_and_an_impact_with_film_do_without_what_only_posix_has(bare):
    place, environment = bare
    (place / "script.py").write_text(RUN, encoding="utf-8")
    printed_by("script.py", cwd=place, env=environment, encoding="cp1252")
    made = {path.name for path in (place / "out" / "a run").iterdir()}
    assert {"video.mp4", "plot.png", "summary.json", "scene.yaml"} <= made


@pytest.mark.validate
@pytest.mark.skipif(os.name != "posix", reason="needs a shell")
def test_a_program_that_contains_python_does_not_start_itself(tmp_path):
    application = tmp_path / "application"
    application.write_text("#!/bin/sh\ntouch started\n")
    application.chmod(0o700)
    printed_by("-c", APPLICATION, cwd=tmp_path)
    assert not (tmp_path / "started").exists()


@pytest.mark.parametrize(("name", "status"), [("größer", 0), ("γ", 2)])
def test_a_console_of_code_page_1252_gets_a_scene_or_a_message(bare, name, status):
    place, environment = bare
    (place / "größer.yaml").write_text("scene: compression\n# ξ\n", encoding="utf-8")
    done = command("check", f"{name}.yaml", cwd=place, env=environment, text=False)
    assert done.returncode == status
    assert b"Traceback" not in done.stderr
    assert status == 0 or done.stderr.startswith(b"error: ?.yaml: no such file")


@pytest.mark.parametrize(
    "name", [r"C:\Users\me\a scene.yaml", r"\\server\share\scene.yaml", "D:scene.yaml"]
)
def test_a_path_with_a_drive_is_a_path(name):
    with pytest.raises(InputError, match="no such file"):
        load_scene(name)


def test_windows_keeps_kernels_in_the_user_s_own_folder(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    for name in ("HOME", environment.CACHE):
        monkeypatch.setenv(name, "")  # monkeypatch then restores it
        monkeypatch.delenv(name)
    environment.prepare()
    assert Path(os.environ[environment.CACHE]).is_relative_to(tmp_path)
    assert "HOME" not in os.environ
    assert capsys.readouterr().err == ""
