"""Read the points of a disk from a table: a text file with a line for each point."""

from __future__ import annotations

import csv
import re

import numpy as np

from taichi_disk.base.errors import InputError, printable
from taichi_disk.mechanics.lattice.triangles import Array

_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)(e[-+]?[0-9]+)?", re.I | re.A)
_DECIMAL_COMMA = re.compile(r"(?<=[0-9]),(?=[0-9])")
# the name of a column, which a unit may follow: x [mm], x (mm), x/mm
_NAME = re.compile(r"(x|y|mass)((?<=s)es)?(\s*[\[(/].*)?", re.S)
_WORD = re.compile("[a-z0-9_]+")


def read_table(text: str) -> tuple[Array, Array | None]:
    """Return the positions (n, 2) and masses (n,), or None, of a table.

    A table has one line of names with x, y and optionally mass, in any order and each
    with a unit behind it or without, or it has no names and exactly two columns. Other
    columns with names are ignored. Commas, semicolons, tabs or blanks separate the
    columns, the same in each line. Decimal commas are read unless commas separate.
    Quotes around a name or a number, and rows without content, do not matter. Lines
    that begin with # are comments. Raises InputError with the line of whatever is
    not such a table.
    """
    lines = _content(text)
    if not lines:
        raise _refusal("it has no points", "no lines")
    first = min(lines)
    separator = _separator(lines[first])
    rows = {number: _cells(line, separator) for number, line in lines.items()}
    names = rows[first]
    places = {"x": 0, "y": 1}
    if not all(map(_NUMBER.fullmatch, names)):
        del rows[first]
        places = _places(first, names)
    elif len(names) != 2:
        raise _refusal(f"line {first} has {len(names)} numbers and no names", *names)
    numbers = []
    for number, cells in rows.items():
        if len(cells) != len(names):
            fault = f"line {number} has {len(cells)} columns instead of {len(names)}"
            raise _refusal(fault, *cells)
        chosen_cells = [cells[place] for place in places.values()]
        if not all(map(_NUMBER.fullmatch, chosen_cells)):
            raise _refusal(f"line {number} lacks a number", *chosen_cells)
        numbers.append([float(cell) for cell in chosen_cells])
    if not numbers:
        raise _refusal("it has no points", *names)
    columns = dict(zip(places, np.array(numbers).T, strict=True))
    return np.stack([columns["x"], columns["y"]], axis=1), columns.get("mass")


def _refusal(fault: str, *cells: str) -> InputError:
    content = printable(" | ".join(cells), width=100)
    return InputError(
        f"{fault} ({content}): a table has one line of names with x, y and optionally"
        " mass, or no names and two columns; Lattice.from_points takes other points,"
        " Lattice.outline other outlines"
    )


def _content(text: str) -> dict[int, str]:
    """Return the lines that are neither empty nor comments, by their numbers from 1."""
    lines = {}
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.strip(" ")
        if not content.strip(',;\t" '):  # as spreadsheets end a table
            continue
        if not content.startswith("#"):
            lines[number] = content
        elif {"x", "y", "mass", "masses"} & {*_WORD.findall(content.lower())}:
            fault = f"line {number} may name columns behind #: remove the # or the line"
            raise _refusal(fault, content)
    return lines


def _separator(line: str) -> str | None:
    """Return what separates the columns of a line; None: blanks."""
    for mark in (";", "\t"):
        if mark in line:
            return mark
    if len(line.split()) > 1:
        line = _DECIMAL_COMMA.sub(".", line)
    if "," in line:
        return ","
    return None


def _cells(line: str, separator: str | None) -> list[str]:
    if separator != ",":
        line = _DECIMAL_COMMA.sub(".", line)
    cells = line.split()
    if separator:
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return [cell.strip(' "') for cell in cells]


def _places(line: int, names: list[str]) -> dict[str, int]:
    """Return the columns of x, y and possibly mass, by these names."""
    places = {}
    for place, name in enumerate(names):
        match = _NAME.fullmatch(name.lower())
        if match is None:
            continue
        column = match[1]
        if column in places:
            raise _refusal(f"line {line} names {column} twice", *names)
        places[column] = place
    if not places.keys() >= {"x", "y"}:
        raise _refusal(f"line {line} does not name x and y", *names)
    return places
