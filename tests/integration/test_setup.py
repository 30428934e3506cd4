"""The set-up script in a clone: line ends, a finished environment, machines without
browsers."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOLS = ("cat", "dirname", "find", "ldconfig", "rm", "seq", "sh", "sleep", "touch")
USED = "glslangValidator"  # stands for what the tests need from the system


def script(path: Path, text: str) -> None:
    path.unlink(missing_ok=True)  # never through a link to a tool of the system
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


@pytest.fixture
def clone(tmp_path):
    """Return a folder with the script, and a search path without browsers and sudo."""
    for folder in (".ci", ".venv/bin", "tools"):
        (tmp_path / folder).mkdir(parents=True)
    shutil.copy(ROOT / ".ci" / "setup", tmp_path / ".ci")
    (tmp_path / "pyproject.toml").touch()
    os.utime(tmp_path / "pyproject.toml", (0, 0))
    python = 'case "$*" in *pip*) echo pip >> calls ;; esac'
    script(tmp_path / ".venv/bin/python", python)
    script(tmp_path / "tools/python3", "")
    script(tmp_path / f"tools/{USED}", "")
    script(tmp_path / "tools/id", "echo 1000")
    script(tmp_path / "tools/apt-get", 'echo "apt-get $*" >> calls')
    for name in TOOLS:
        target = shutil.which(name) or shutil.which(name, path="/sbin:/usr/sbin")
        if target is None:
            pytest.skip(f"there is no {name}")
        (tmp_path / "tools" / name).symlink_to(target)
    return tmp_path


def set_up(clone):
    done = subprocess.run(
        ["sh", ".ci/setup", "test"],
        cwd=clone,
        env={"PATH": str(clone / "tools")},
        capture_output=True,
        text=True,
    )
    calls = clone / "calls"
    made = calls.read_text().split("\n")[:-1] if calls.exists() else []
    calls.unlink(missing_ok=True)
    if "please install" in done.stderr:
        pytest.skip("this machine lacks system libraries of the tests")
    return done, made


def test_without_sudo_browsers_are_left_out_and_a_second_time_nothing_is_asked(clone):
    done, made = set_up(clone)
    assert done.returncode == 0, done.stderr
    assert "there is no sudo" in done.stderr
    assert "no browsers here" in done.stdout
    assert made == ["pip"]
    done, made = set_up(clone)
    assert (done.returncode, done.stdout, made) == (0, "", [])
    os.utime(clone / "pyproject.toml")
    os.utime(clone / ".venv/ready-test", (0, 0))
    assert set_up(clone)[1] == ["pip"]


def test_it_waits_for_another_apt_get_and_says_why_a_package_is_missing(clone):
    script(clone / "tools/id", "echo 0")
    script(clone / "tools/sleep", "echo waited >> calls")
    locked = "E: Could not get lock /var/lib/apt/lists/lock. It is held by process 1"
    missing = "E: Unable to locate package chromium"
    script(
        clone / "tools/env",
        f"""[ -e calls ] || {{ echo "{locked}" >&2; echo locked > calls; exit 100; }}
case "$*" in *chromium) echo "{missing}" >&2; exit 100 ;; esac""",
    )
    done, made = set_up(clone)
    assert done.returncode == 0, done.stderr
    assert made == ["locked", "waited", "pip"]
    assert missing in done.stderr
    assert "setup: no chromium here: a test is left out\n" in done.stdout
    assert "no firefox-esr here" not in done.stdout


def test_scripts_keep_their_line_ends_where_git_writes_others(tmp_path):
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("this is no clone")
    names = (".gitattributes", ".ci/setup", "docs/images/view.png")
    clone = ["git", "clone", "--quiet", "--no-checkout", "--depth", "1"]
    # `git checkout` reads .gitattributes first
    write = ["git", "-c", "core.autocrlf=true", "checkout", "HEAD", "--", *names]
    try:
        subprocess.run([*clone, f"file://{ROOT}", "copy"], cwd=tmp_path, check=True)
        subprocess.run(write, cwd=tmp_path / "copy", check=True)
    except subprocess.CalledProcessError:
        pytest.skip("git does not clone this folder")
    assert b"\r" not in (tmp_path / "copy/.ci/setup").read_bytes()
    picture = (tmp_path / "copy/docs/images/view.png").read_bytes()
    assert picture == (ROOT / "docs/images/view.png").read_bytes()
