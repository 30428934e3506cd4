"""Files say where results come from: scene, version, date and machine."""

import re

import av
import numpy as np
import pytest
from PIL import Image

from taichi_disk import __version__, load_scene, run

SCENE = load_scene(
    "exponential_wall",
    ["lattice.points=20", "video.size=64", "video.seconds=0.2", "material.eta_star=1"],
)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return run(
        SCENE, tmp_path_factory.mktemp("it's") / "a run", video=False, lattices=1
    )


def streamed(path):
    with av.open(str(path)) as film:
        return {name.lower(): text for name, text in film.metadata.items()}["comment"]


def pictured(path):
    info = Image.open(path).info
    return info["comment"].decode() if "comment" in info else info["Description"]


@pytest.mark.usefixtures("one_artist")
@pytest.mark.parametrize(
    ("name", "read"),
    [
        pytest.param("a.mp4", streamed, marks=pytest.mark.validate),
        pytest.param("a.webm", streamed, marks=pytest.mark.validate),
        pytest.param("a.gif", pictured, marks=pytest.mark.validate),
        pytest.param("a.png", pictured, marks=pytest.mark.validate),
        ("a", pictured),
    ],
)
def test_a_film_carries_the_scene_that_it_shows_and_the_version_and_no_date(
    result, tmp_path, name, read
):
    path = result.film(tmp_path / name, colour="speed")
    text = read(path / "00002.png" if path.is_dir() else path)
    assert text.startswith(f"# taichi-disk {__version__}\n")
    assert load_scene(text) == SCENE.with_({"video.colour": "speed"})
    assert not re.search(r"20\d\d-\d\d", text)


def test_the_plot_carries_the_scene(result):
    assert load_scene(pictured(result.out / "plot.png")) == SCENE


def in_xyz(path):
    from ase.io import read

    info = read(path, index=0).info
    assert info["Program"] == f"taichi-disk {__version__}"
    return info["Scene"]


def in_pvd(path):
    return re.search(
        rf"<!-- taichi-disk {__version__}: (.*) -->", path.read_text("utf-8")
    )[1]


def in_npz(path):
    return str(np.load(path)["scene"])


@pytest.mark.parametrize(
    ("suffix", "read"), [(".xyz", in_xyz), (".pvd", in_pvd), (".npz", in_npz)]
)
def test_a_trajectory_carries_the_scene_in_equal_bytes(result, tmp_path, suffix, read):
    first, second = (
        result.export(tmp_path / f"{name}{suffix}", frames=2) for name in "ab"
    )
    assert load_scene(read(first)) == SCENE
    if suffix != ".pvd":  # a .pvd file contains the name of its folder
        assert first.read_bytes() == second.read_bytes()
