"""The files of `python -m build`, installed elsewhere, do the main job."""

import os
import shutil
import subprocess
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
from programs import printed_by

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.validate


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Return the folder with the sdist, and the wheel that was built from it."""
    out = tmp_path_factory.mktemp("dist")
    printed_by("-m", "build", "--outdir", out, ROOT)
    return out


def test_the_source_has_all_that_a_reader_needs(built):
    with tarfile.open(next(built.glob("*.tar.gz"))) as source:
        names = {name.partition("/")[2] for name in source.getnames()}
    needed = "README.md LICENSE pyproject.toml scenes/exponential_wall.yaml .ci/test"
    needed += " taichi_disk/py.typed CITATION.cff docs/model.md mkdocs.yml"
    assert {*needed.split()} <= names


def test_a_wheel_from_a_clone_that_was_updated_has_no_old_module(tmp_path):
    clone = tmp_path / "clone"
    left_out = shutil.ignore_patterns(".*", "build", "docs", "tests")
    shutil.copytree(ROOT, clone, ignore=left_out)
    old = clone / "build/lib/taichi_disk/physics/__init__.py"
    old.parent.mkdir(parents=True)
    old.touch()
    pip = ("-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", tmp_path)
    printed_by(*pip, clone)
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        names = wheel.namelist()
    assert "taichi_disk/mechanics/physics/__init__.py" in names
    assert "taichi_disk/physics/__init__.py" not in names


def test_the_wheel_runs_an_impact_with_film_in_an_empty_environment(built, tmp_path):
    place = tmp_path / "an empty place"
    venv.create(place / "env", with_pip=True)
    programs = place / "env" / ("Scripts" if os.name == "nt" else "bin")
    clean = {
        name: value
        for name, value in os.environ.items()
        if name not in ("PYTHONPATH", "VIRTUAL_ENV")
    }

    def command(*words):
        done = subprocess.run(
            [str(programs / words[0]), *words[1:]],
            cwd=place,
            env=clean,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr[-3000:]
        return done.stdout

    command("python", "-m", "pip", "install", "--quiet", str(next(built.glob("*.whl"))))
    where = command("python", "-c", "import taichi_disk; print(taichi_disk.__file__)")
    assert str(place) in where
    assert str(ROOT) not in where
    output = command(
        "taichi-disk",
        "run",
        "exponential_wall",
        "--set=video.size=128",
        "--set=video.seconds=0.5",
    )
    assert output.startswith("restitution e")
    made = {path.name for path in (place / "out" / "exponential_wall").iterdir()}
    assert {"video.mp4", "plot.png", "summary.json"} <= made
    assert "wall" in command("taichi-disk", "check", "absorbing_wall")
