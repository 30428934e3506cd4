"""Messages of the operating system name a file."""

import os
import sys
import tempfile

import pytest

from taichi_disk.base import errors
from taichi_disk.base.errors import pip_install, reason, system_message
from taichi_disk.cli import main


def caught(function, *arguments):
    with pytest.raises(OSError) as info:
        function(*arguments)
    return info.value


def fail():
    raise OSError(28, "No space left on device")


def test_a_message_names_the_file_if_there_is_one(monkeypatch):
    assert reason(caught(open, "/nowhere/a")) == "No such file or directory"
    message = system_message(caught(open, "/nowhere/a"))
    assert message == "/nowhere/a: No such file or directory"
    assert system_message(caught(fail)) == "No space left on device"
    assert system_message(OSError("no words")) == "no words"
    assert reason(ValueError("a")) == "a"
    hidden = "No module named 'xml.etree'; 'xml' is not a package"
    assert reason(ModuleNotFoundError(hidden, name="xml.etree")) == hidden
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", list)
    assert "; TMPDIR" in reason(caught(tempfile._get_default_tempdir))


@pytest.mark.parametrize("command", ["run", "accuracy", "check"])
def test_a_deleted_working_folder_is_named(tmp_path, monkeypatch, capsys, command):
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    main([command, "exponential_wall"])
    error = capsys.readouterr().err
    assert "No such file" not in error
    if command != "check":
        assert "the working folder has been deleted: change to another one" in error
    os.chdir(tmp_path)


@pytest.mark.parametrize(
    ("pip", "command"), [("pip", "/p -m pip install"), (None, "uv pip install")]
)
def test_a_missing_extra_is_installed_by_a_command_at_hand(monkeypatch, pip, command):
    monkeypatch.setattr(sys, "executable", "/p")
    monkeypatch.setattr(errors, "find_spec", {"pip": pip}.get)
    advice = pip_install("meshio")
    assert advice.startswith(command)
    assert "/p" in advice
    assert advice.endswith("'meshio'")
