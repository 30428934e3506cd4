"""Read the points of a disk from text in columns, as spreadsheets, pandas, NumPy and
ParaView write it."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from taichi_disk.errors import InputError, printable
from taichi_disk.lattice.custom import MAX_EXTENT
from taichi_disk.lattice.triangles import Array

_SPACES = ""  # the separator of columns is one or more spaces
_SEPARATORS = ("\t", ";", ",", _SPACES)  # in the order in which they are tried
_MINUS = "\u2212"  # the minus sign of typography
# names of columns, in lower case and without units
_NAMES = {
    "x": ("x", "points:0", "points_0"),
    "y": ("y", "points:1", "points_1"),
    "z": ("z", "points:2", "points_2"),
    "mass": ("mass", "masses", "m"),
}
_UNIT = re.compile(r"\s*[\[(/].*")  # "x [R]", "x (R)", "x/R"
_WANTED = "needs the columns x, y and optionally mass"

Row = tuple[int, str]  # line number from 1, and its text


def read_table(text: str) -> tuple[Array, Array | None]:
    """Return the positions (n, 2) and masses (n,), or None, of a table.

    Columns are separated by tabs, semicolons, commas or spaces. A header names the
    columns; other columns are ignored. Without a header there are x, y and optionally
    mass; a first column that numbers the rows and a third column of zeros are ignored.
    Raises InputError with the line of a fault.
    """
    rows = _rows(text)
    if not rows:
        raise InputError(f"has no points; it {_WANTED}")
    separator = _separator(rows[-1][1])
    if separator != ",":
        rows = [(number, line.replace(",", ".")) for number, line in rows]
    header = _cells(rows[0][1], separator)
    if all(map(_is_number, header)):
        table = _numbers(rows, separator, range(len(header)), len(header))
        return _without_names(table)
    if len(rows) == 1:
        raise InputError(f"has no points; it {_WANTED}")
    columns = _named_columns(header)
    table = _numbers(rows[1:], separator, list(columns.values()), len(header))
    named = dict(zip(columns, table.T, strict=True))
    z = named.get("z", np.zeros(1))
    if np.ptp(z) > 0.0:
        raise InputError(
            f"z must be the same for all points, not {z.min():g} to {z.max():g}"
        )
    return np.stack([named["x"], named["y"]], axis=1), named.get("mass")


def _rows(text: str) -> list[Row]:
    """Return the lines that are neither empty nor comments."""
    rows = []
    plain = text.replace('"', "").replace(_MINUS, "-")
    for number, line in enumerate(plain.splitlines(), start=1):
        # A tab at the beginning follows an empty name, such as that of pandas' index.
        content = line.strip(" ").rstrip()
        if content and not content.startswith("#"):
            rows.append((number, content))
    return rows


def _separator(line: str) -> str:
    """Return the first separator that splits the line into numbers, or else into at
    least two numbers and other words."""
    splits = {separator: _cells(line, separator) for separator in _SEPARATORS}
    for separator, cells in splits.items():
        if len(cells) > 1 and all(map(_is_number, cells)):
            return separator
    for separator, cells in splits.items():
        if sum(map(_is_number, cells)) > 1:
            return separator
    return ","


def _cells(line: str, separator: str) -> list[str]:
    if separator != ",":
        line = line.replace(",", ".")  # decimal commas
    return [cell.strip() for cell in line.split(separator or None)]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _named_columns(header: Sequence[str]) -> dict[str, int]:
    """Return the places of the columns that are read."""
    names = [_UNIT.sub("", name.lower()) for name in header]
    columns: dict[str, int] = {}
    for name, spellings in _NAMES.items():
        places = [k for k, found in enumerate(names) if found in spellings]
        if len(places) > 1:
            raise InputError(f"has {len(places)} columns {name}: leave one")
        if places:
            columns[name] = places[0]
    if "x" not in columns or "y" not in columns:
        found = printable(", ".join(header), width=100)
        raise InputError(f"{_WANTED}; found {found}")
    return columns


def _without_names(table: Array) -> tuple[Array, Array | None]:
    width = table.shape[1]
    found = f"{width} columns without names"
    if width > 2 and _numbers_rows(table[:, 0]):
        table = table[:, 1:]
    if table.shape[1] > 2 and not table[:, 2].any():
        table = np.delete(table, 2, axis=1)  # z
    if table.shape[1] == 2:
        return table, None
    if table.shape[1] == 3:
        return table[:, :2], table[:, 2]
    raise InputError(
        f"{_WANTED}; found {found}: write the names into the first line, such as"
        " x,y,mass"
    )


def _numbers_rows(column: Array) -> bool:
    """Return whether a column counts the rows and cannot be x, because x would be
    longer than a disk."""
    if len(column) - 1 <= MAX_EXTENT or column[0] not in (0.0, 1.0):
        return False
    return bool((np.diff(column) == 1.0).all())


def _numbers(
    rows: Sequence[Row], separator: str, columns: Sequence[int], width: int
) -> Array:
    """Return the `columns` of all rows, each of which must have `width` values."""
    lines = [line for _, line in rows]
    for number, line in rows:
        count = len(line.split(separator or None))
        if count != width:
            raise InputError(
                f"line {number} has {count} values, but the first line has {width}"
            )
    try:
        return np.loadtxt(lines, delimiter=separator or None, usecols=columns, ndmin=2)
    except ValueError as error:
        what = _what_is_no_number(rows, separator, columns) or str(error)
        raise InputError(what) from None


def _what_is_no_number(
    rows: Sequence[Row], separator: str, columns: Sequence[int]
) -> str:
    for number, line in rows:
        cells = _cells(line, separator)
        for k in columns:
            if not _is_number(cells[k]):
                return f'line {number}: "{printable(cells[k])}" is not a number'
    return ""
