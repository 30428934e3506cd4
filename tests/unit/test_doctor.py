"""The doctor tries a real run in a process, survives its crash, and names a remedy."""

import os
import re
import sys

import pytest
from programs import command, python

from taichi_disk import doctor
from taichi_disk.base import engine
from taichi_disk.base.machine import foreign_packages
from taichi_disk.cli import main


@pytest.mark.validate
def test_a_ready_machine_is_reported_and_nothing_left(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    assert main(["doctor"]) == 0
    message = capsys.readouterr().out
    assert message.endswith("\nReady: scenes can be run and filmed here.\n")
    assert re.search(
        rf"^engine +{engine.PACKAGE} \d+\.\d+\.\d+$", message, re.MULTILINE
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("script", "seconds", "message"),
    [
        ("kill -SEGV $$", 60.0, "crashed (SIGSEGV)"),
        ("exec sleep 60", 0.5, "no answer within 0.5 s"),
    ],
)
def test_crashes_and_hangs_are_reported(
    tmp_path, monkeypatch, capsys, script, seconds, message
):
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{script}\n")
    python.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(python))
    monkeypatch.setattr(doctor, "SECONDS", seconds)
    monkeypatch.setenv("TI_OFFLINE_CACHE_FILE_PATH", str(python / "cache"))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["doctor"]) == 1
    text = capsys.readouterr().out
    remedy = f"\nNot ready: {message}\n    {doctor.REMEDY}\n"
    if "crashed" in message:
        remedy += (
            "    If that is done, the cache of kernels may be damaged: "
            f"delete the folder {python}/cache\n"
        )
    assert text.endswith(remedy)
    assert f" in {os.path.dirname(doctor.__file__)}\n" in text
    assert f"none ({python}/cache: Not a directory): set TI_OFFLINE_CACHE" in text


def test_an_error_is_reported_with_the_remedy(monkeypatch, capsys):
    monkeypatch.setattr(doctor, "SETTINGS", ["lattice.points=1"])
    assert main(["doctor"]) == 1
    message = capsys.readouterr().out.partition("\nNot ready: ")[2]
    assert "lattice.points: must be" in message
    assert message.endswith(f"\n    {doctor.REMEDY}\n")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("numpy", "raise ImportError('of another\\n    Python')", "run compression"),
        ("numpy", "__version__ = '1.23'", "doctor"),
        ("kiwisolver", "raise ImportError", "doctor"),
        ("websockets", "", "view --no-open"),
    ],
)
def test_a_package_of_pythonpath_that_does_not_fit_is_named(
    tmp_path, name, content, words
):
    (tmp_path / name).mkdir()
    file = tmp_path / name / "__init__.py"
    file.write_text(content)
    folders = [str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(folders)}
    foreign = f"{name} is {file}; try again after: unset PYTHONPATH"
    done = command(*words.split(), cwd=tmp_path, env=environment)
    assert done.returncode == 1 and len(done.stderr.splitlines()) < 2
    printed = done.stderr or done.stdout
    assert foreign in printed.splitlines()[-1] and "libX11" not in printed


def test_a_file_of_the_user_with_the_name_of_the_engine_is_named(tmp_path):
    file = tmp_path / "taichi.py"
    file.write_text("")
    (tmp_path / "numpy").mkdir()  # holds no modules
    done = command("run", "compression", cwd=tmp_path)
    assert done.returncode == 1 and len(done.stderr.splitlines()) == 1
    assert f"; taichi is {file}; try again after: " in done.stderr


def test_a_file_of_the_user_with_the_name_of_yaml_is_named(tmp_path):
    file = tmp_path / "yaml.py"
    file.write_text("")
    program = "from taichi_disk import load_scene"
    for done in (python("-c", program, cwd=tmp_path), command("check", cwd=tmp_path)):
        assert f"'BaseLoader' from 'yaml' ({file})" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_an_environment_below_a_folder_of_pythonpath_is_not_foreign(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([sys.prefix, os.sep]))
    assert foreign_packages() == ""
