"""The scripts that set up a clone, where something is missing, and run the tests."""

import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOLS = (
    *("cat", "cp", "dirname", "find", "grep", "ldd", "mkdir", "rm", "seq", "sh"),
    *("sleep", "touch", "uname"),
)
USED = "glslangValidator"  # stands for what the tests need from the system
NOBODY = 65534  # an ordinary user
# what stands for Python, and for pip as it installs the program
PYTHON = """
case "$*" in
    "-m venv "*) echo venv >> calls; mkdir -p .venv/bin; cp "$0" .venv/bin/python ;;
    "-m pip "*)
        echo "pip $PIP_USER" >> calls
        echo "#!$PWD/.venv/bin/python" > .venv/bin/taichi-disk ;;
esac"""


def script(path, text):
    path.unlink(missing_ok=True)  # never through a link to a tool of the system
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


@pytest.fixture
def clone(tmp_path):
    """Return a folder with the script, without browsers, sudo and sbin."""
    folder = tmp_path.resolve() / "Meine Übung"
    for name in (".ci", "tools"):
        (folder / name).mkdir(parents=True)
    shutil.copy(ROOT / ".ci" / "setup", folder / ".ci")
    (folder / "pyproject.toml").touch()
    os.utime(folder / "pyproject.toml", (0, 0))
    script(folder / "tools/python3", PYTHON)
    script(folder / f"tools/{USED}", "")
    script(folder / "tools/id", "echo 1000")
    script(folder / "tools/apt-get", 'echo "apt-get $*" >> calls')
    for name in TOOLS:
        target = shutil.which(name)
        if target is None:
            pytest.skip(f"there is no {name}")
        (folder / "tools" / name).symlink_to(target)
    return folder


def set_up(clone, what="test"):
    done = subprocess.run(
        ["sh", ".ci/setup", what],
        cwd=clone,
        env={"PATH": str(clone / "tools"), "PIP_USER": "1"},
        capture_output=True,
        text=True,
    )
    calls = clone / "calls"
    made = calls.read_text().split("\n")[:-1] if calls.exists() else []
    calls.unlink(missing_ok=True)
    if "please install" in done.stderr and what == "test":
        pytest.skip("this machine lacks system libraries of the tests")
    return done, made


def test_without_sudo_browsers_are_left_out_and_a_second_time_nothing_is_asked(clone):
    done, made = set_up(clone)
    assert done.returncode == 0, done.stderr
    assert "there is no sudo" in done.stderr
    assert "no chromium here: a test is left out" in done.stdout
    assert made == ["venv", "pip 0"]
    done, made = set_up(clone)
    assert (done.returncode, done.stdout, made) == (0, "", [])
    os.utime(clone / "pyproject.toml")
    os.utime(clone / ".venv/ready-test", (0, 0))
    assert set_up(clone)[1] == ["pip 0"]
    # what `pip install .` makes, and what hides a later change of this folder
    (clone / ".venv/lib/python3.11/site-packages/taichi_disk").mkdir(parents=True)
    assert set_up(clone)[1] == ["pip 0"]


def test_without_sudo_and_a_vulkan_driver_films_are_pages(clone):
    found = shutil.which("find")
    script(
        clone / "tools/find", f'case "$*" in *icd.d*) ;; *) exec {found} "$@" ;; esac'
    )
    done, made = set_up(clone, "run")
    assert done.returncode == 0, done.stderr
    assert "setup: no mesa-vulkan-drivers here: films are pages\n" in done.stdout
    assert made == ["venv", "pip 0"]


def test_of_two_at_the_same_time_one_waits(clone):
    flock = shutil.which("flock") or pytest.skip("a system without flock")
    (clone / "tools/flock").symlink_to(flock)
    script(clone / "tools/python3", PYTHON.replace("echo venv", "sleep 1; echo venv"))
    with ThreadPoolExecutor() as pool:
        both = [done for done, _ in pool.map(set_up, [clone] * 2, ["run"] * 2)]
    assert [done.returncode for done in both] == [0, 0]
    assert sum("waiting for another" in done.stdout for done in both) == 1


def test_a_copied_or_moved_folder_gets_an_environment_of_its_own(clone):
    set_up(clone, "run")
    copy = clone.with_name("Kopie")
    shutil.copytree(clone, copy, symlinks=True)
    assert set_up(copy, "run")[1] == ["venv", "pip 0"]
    assert set_up(copy, "run")[1] == set_up(clone, "run")[1] == []


@pytest.mark.parametrize(
    ("tool", "line", "name"),
    [("uname", "echo aarch64", "aarch64"), ("ldd", "echo musl libc >&2", "musl")],
)
def test_a_machine_without_wheels_is_named_before_all_else(clone, tool, line, name):
    script(clone / "tools" / tool, line)
    done, made = set_up(clone, "run")
    assert (done.returncode, made) == (1, [])
    assert done.stderr.startswith("setup: Taichi has no wheels for ")
    assert name in done.stderr


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
    assert made == ["locked", "waited", "venv", "pip 0"]
    assert missing in done.stderr
    assert "setup: no chromium here: a test is left out\n" in done.stdout
    assert "no firefox-esr here" not in done.stdout


@pytest.mark.parametrize(
    "bad", ["ruff", "mypy", "lint-imports", "mkdocs", "python", ""]
)
def test_checks_run_beside_the_tests_and_speak_only_if_they_fail(clone, bad):
    shutil.copy(ROOT / ".ci/test", clone / ".ci")
    script(clone / ".ci/setup", "")
    (clone / ".venv/bin").mkdir(parents=True)
    for name in ("ruff", "mypy", "lint-imports", "mkdocs", "python"):
        line = f'echo "{name} $*"; exit {3 * (name == bad)}'
        script(clone / ".venv/bin" / name, line)
    command = ["sh", ".ci/test", "tests/physics", "-k", "two words"]
    path = {"PATH": str(clone / "tools")}
    done = subprocess.run(
        command, cwd=clone, env=path, capture_output=True, text=True, timeout=60
    )
    expected = "python -m pytest -n 2 --dist worksteal tests/physics -k two words\n"
    assert done.stdout == expected
    assert done.returncode == {"": 0, "python": 3}.get(bad, 1)
    is_check = bad not in ("", "python")
    assert (f"\n{bad} " in f"\n{done.stderr}") == is_check


def test_scripts_keep_their_line_ends_where_git_writes_others(tmp_path):
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("this is no clone")
    names = (".ci/setup", "docs/images/view.png")
    write = ["git", "-c", "core.autocrlf=true", "checkout-index"]
    try:
        subprocess.run(
            [*write, f"--prefix={tmp_path}/", "--", *names], cwd=ROOT, check=True
        )
    except subprocess.CalledProcessError:
        pytest.skip("git does not read this folder")
    assert b"\r" not in (tmp_path / ".ci/setup").read_bytes()
    picture = (tmp_path / "docs/images/view.png").read_bytes()
    assert picture == (ROOT / "docs/images/view.png").read_bytes()


@pytest.mark.validate
@pytest.mark.skipif(
    not hasattr(os, "getuid") or os.getuid() != 0,
    reason="only root can be another user",
)
def test_an_ordinary_user_makes_a_film_and_a_copy_of_the_folder_does_not_run_the_first(
    ordinary,
):
    folder, shell = ordinary
    small = "--lattices 1 --set lattice.points=60 --set video.size=64"
    command = ".venv/bin/taichi-disk run exponential_wall --set video.seconds=0.2"
    shell(f"sh .ci/setup && {command} {small}")
    assert [one.name for one in folder.glob("out/*/video.*")]
    paths = [one.read_text() for one in folder.glob(".venv/lib/*/*/*taichi_disk*.pth")]
    assert paths == [f"{folder}\n"]  # which editors read
    made = (folder / ".venv/ready-run").stat().st_mtime_ns
    shell("sh .ci/setup")
    assert (folder / ".venv/ready-run").stat().st_mtime_ns == made
    copy = folder.with_name("Kopie")
    shell(f"cp -a . {copy}")
    done = shell(f"cd {copy} && .venv/bin/taichi-disk check exponential_wall", 2)
    assert f"`sh .ci/setup` in {copy}" in done.stderr
    os.chown(folder / ".venv", 0, 0)
    os.utime(folder / "pyproject.toml")
    assert ".venv belongs to another user" in shell("sh .ci/setup", 1).stderr


@pytest.fixture
def ordinary():
    """Return a copy of this tree that belongs to an ordinary user of Debian, and a
    function that runs a line of a shell there as this user.

    Packages of the tests serve if the user's Python can read them; pip downloads the
    others.
    """
    path = "/usr/local/bin:/usr/bin:/bin"
    if shutil.which("python3", path=path) is None:
        pytest.skip("an ordinary user has no Python here")
    home = Path(tempfile.mkdtemp())
    folder = home / "Meine Übung"
    for name in (".ci", "scenes", "taichi_disk"):
        shutil.copytree(ROOT / name, folder / name)
    for name in ("LICENSE", "README.md", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    for one in (home, *home.rglob("*")):
        os.chown(one, NOBODY, NOBODY)
    user = {name: value for name, value in os.environ.items() if "PIP_" in name}
    user |= {"HOME": str(home), "PATH": path, "PIP_USER": "1"}

    def shell(line, status=0):
        options = {"user": NOBODY, "group": NOBODY, "extra_groups": []}
        options |= {"cwd": folder, "capture_output": True, "text": True, "env": user}
        done = subprocess.run(["sh", "-c", line], **options)
        assert done.returncode == status, done.stderr[-3000:]
        return done

    version = "import sys; print(sys.version_info[:2])"
    if shell(f"python3 -c '{version}'").stdout == f"{sys.version_info[:2]}\n":
        installed = [one for one in sys.path if one.endswith("-packages")]
        user["PYTHONPATH"] = os.pathsep.join(installed)
    yield folder, shell
    shutil.rmtree(home)
