"""Read the points of a disk from text in columns, as spreadsheets, pandas, NumPy, R,
Fortran and ParaView write it."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from taichi_disk.errors import InputError, printable
from taichi_disk.lattice.custom import MAX_EXTENT
from taichi_disk.lattice.triangles import Array

_SEPARATORS = (",", "\t", ";", None)  # None: one or more spaces
_COMMENTS = ("#", "%", "!", "//")
# quotes, and the minus sign of typography
_PLAIN = str.maketrans({'"': None, "\u2212": "-"})
_FORTRAN_EXPONENT = re.compile(r"(?<=[0-9.])[dD](?=[-+]?[0-9])")
# names of columns in lower case, which a unit may follow: x_R, x [R], x (R), x/R
_NAMES = {
    "x": "x|points[:_]0",
    "y": "y|points[:_]1",
    "z": "z|points[:_]2",
    "mass": "mass|masses|m",
}
_UNIT = r"(_r|\s*[\[(/].*)?"
_REQUIREMENT = "needs the columns x, y and optionally mass"

Rows = dict[int, list[str]]  # the cells of each line, by its number from 1


def read_table(text: str) -> tuple[Array, Array | None]:
    """Return the positions (n, 2) and masses (n,), or None, of a table.

    Columns are separated by tabs, semicolons, commas or spaces. If there is a header,
    it names the columns, and columns with other names are ignored. If there is none,
    the columns are x, y and optionally mass. A column that numbers the rows before them
    and a z of zeros after y are then ignored. Raises InputError with the line of a
    fault.
    """
    rows = _rows(_FORTRAN_EXPONENT.sub("e", text.translate(_PLAIN)))
    header: list[str] = []
    if rows:
        first_line = min(rows)
        if not all(_is_number(cell) for cell in rows[first_line]):
            header = rows.pop(first_line)
    if not rows:
        raise InputError(f"has no points; it {_REQUIREMENT}")
    if header:
        columns = _by_name(header, rows)
    else:
        columns = _by_place(rows)
    z = columns.get("z", np.zeros(1))
    if np.ptp(z) > 0.0:
        raise InputError(
            f"z must be the same for all points, not {z.min():g} to {z.max():g}"
        )
    return np.stack([columns["x"], columns["y"]], axis=1), columns.get("mass")


def _rows(text: str) -> Rows:
    """Split the lines that are neither empty nor comments."""
    lines = {}
    for number, line in enumerate(text.splitlines(), start=1):
        # A tab at the beginning follows an empty name, such as that of pandas' index.
        content = line.lstrip(" ").rstrip(" \t,;")
        if content and not content.startswith(_COMMENTS):
            lines[number] = content
    if not lines:
        return {}
    last = lines[max(lines)]

    def share_of_numbers(separator: str | None) -> float:
        cells = _cells(last, separator)
        if len(cells) < 2:
            return 0.0
        return sum(map(_is_number, cells)) / len(cells)

    separator = max(_SEPARATORS, key=share_of_numbers)
    return {number: _cells(line, separator) for number, line in lines.items()}


def _cells(line: str, separator: str | None) -> list[str]:
    if separator != ",":
        line = line.replace(",", ".")  # decimal commas
    return line.split(separator)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _by_name(header: list[str], rows: Rows) -> dict[str, Array]:
    """Return the columns whose names in the header say what they are."""
    titles = [name.strip().lower() for name in header]
    if all(len(cells) == len(titles) + 1 for cells in rows.values()):
        titles.insert(0, "")  # R's names of rows
    places: dict[str, int] = {}
    for name, spellings in _NAMES.items():
        pattern = re.compile(f"({spellings}){_UNIT}")
        matches = [k for k, title in enumerate(titles) if pattern.fullmatch(title)]
        if len(matches) > 1:
            raise InputError(f"has {len(matches)} columns {name}: leave one")
        if matches:
            places[name] = matches[0]
    if "x" not in places or "y" not in places:
        names_found = printable(", ".join(header), width=100)
        raise InputError(f"{_REQUIREMENT}; found {names_found}")
    numbers = _numbers(rows, list(places.values()), len(titles))
    return dict(zip(places, numbers.T, strict=True))


def _by_place(rows: Rows) -> dict[str, Array]:
    """Return x, y and possibly mass, without a number of the row and a z of 0."""
    width = len(rows[min(rows)])
    columns = [*_numbers(rows, range(width), width).T]
    if width > 2 and _numbers_rows(columns[0]):
        del columns[0]
    if len(columns) > 2 and not columns[2].any():
        del columns[2]
    if len(columns) not in (2, 3):
        raise InputError(
            f"{_REQUIREMENT}; found {width} columns without names: write the names into"
            " the first line, such as x,y,mass"
        )
    return dict(zip(("x", "y", "mass"), columns, strict=False))


def _numbers_rows(column: Array) -> bool:
    """Return whether a column counts the rows and cannot be x, because x would be
    longer than a disk."""
    if len(column) - 1 <= MAX_EXTENT or column[0] not in (0.0, 1.0):
        return False
    return bool((np.diff(column) == 1.0).all())


def _numbers(rows: Rows, places: Sequence[int], width: int) -> Array:
    """Return the numbers at the `places` of all rows, which have at most `width`
    cells."""
    numbers = []
    for line, cells in rows.items():
        if not max(places) < len(cells) <= width:
            raise InputError(
                f"line {line} has {len(cells)} values, but the first line has {width}"
            )
        try:
            numbers.append([float(cells[k]) for k in places])
        except ValueError as error:
            raise InputError(
                f"line {line}: {printable(str(error), width=100)}"
            ) from None
    return np.array(numbers)
