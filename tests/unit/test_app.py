"""The list of scenes: that of the program, a folder, a sweep."""

from __future__ import annotations

from pathlib import Path

import pytest

from taichi_disk.errors import InputError
from taichi_disk.window.app import list_folder


@pytest.mark.parametrize(
    "table", [b"key\n\xff\xfe\n", b"key\n" + b"x" * 140_000 + b"\n"]
)
def test_a_table_that_cannot_be_read_is_named(tmp_path: Path, table: bytes) -> None:
    (tmp_path / "points.csv").write_bytes(table)
    with pytest.raises(InputError, match=r"points\.csv"):
        list_folder(tmp_path)


def test_a_huge_file_is_listed_and_refused_when_it_is_chosen(tmp_path: Path) -> None:
    text = "scene: exponential_wall\nlattice: {points: 60}\n"
    (tmp_path / "a.yaml").write_text(text)
    with (tmp_path / "b.yaml").open("w") as file:
        file.write(text)
        file.truncate(3_000_000_000)  # sparse
    small, huge = list_folder(tmp_path)
    small.load()
    with pytest.raises(InputError, match=r"b\.yaml.*larger than"):
        huge.load()
