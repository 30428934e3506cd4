"""The list of scenes: that of a folder."""

import pytest

from taichi_disk.base.errors import InputError
from taichi_disk.sandbox.app import list_folder

SCENE = "scene: exponential_wall\nlattice: {points: 60}\n"


def test_the_scenes_of_a_folder_are_listed_by_their_names(tmp_path):
    with pytest.raises(InputError, match="no scene in this folder"):
        list_folder(tmp_path)
    (tmp_path / "b.yaml").write_text("scene: compression\n")
    (tmp_path / "a.yaml").write_text(SCENE + "impact: {velocity: 0.02}\n")
    # no single scene
    (tmp_path / "figure.yaml").write_text("scene: compression\nsweep: {axes: {}}\n")
    (tmp_path / ".#a.yaml").symlink_to("nowhere")  # an editor's lock
    (tmp_path / "c.yaml").mkdir()
    entries = list_folder(tmp_path)
    assert [one.name for one in entries] == ["a", "b"]
    assert entries[0].load().impact.velocity == 0.02


def test_a_huge_file_is_listed_and_refused_when_it_is_chosen(tmp_path):
    (tmp_path / "a.yaml").write_text(SCENE)
    with (tmp_path / "b.yaml").open("w") as file:
        file.write(SCENE)
        file.truncate(3_000_000_000)  # sparse
    small, huge = list_folder(tmp_path)
    small.load()
    with pytest.raises(InputError, match=r"b\.yaml.*larger than"):
        huge.load()
