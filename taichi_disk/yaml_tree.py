"""YAML text to plain values that know their place in it, so that a fault can name line and column.

Scalars follow the core schema of YAML 1.2: `1e-3` is a number (PyYAML by itself takes it for a string), while
`yes`, `010` and `1:30` have no second meaning. Nothing but mappings, lists and scalars is ever built.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

import yaml

Path = tuple[str, ...]
MAX_VALUES = 10_000  # aliases of aliases can stand for billions
_TAG = "tag:yaml.org,2002:"


@dataclass(frozen=True, order=True)
class Place:
    """Where something was written: a file with line and column (both from 1), or a command-line option."""

    rank: int
    line: int
    column: int
    label: str

    def __str__(self) -> str:
        return f"{self.label}:{self.line}:{self.column}" if self.line else self.label


@dataclass(frozen=True, order=True)
class Fault:
    place: Place
    key: str  # dotted
    what: str

    def __str__(self) -> str:
        return ": ".join(part for part in (str(self.place), self.key, self.what) if part)


@dataclass(frozen=True)
class Entry:
    """Where a key and its value were written, and the value as the author would recognise it."""

    key: Place
    value: Place
    shown: str


@dataclass
class Tree:
    """Values, the entry of each dotted path in them, and what could not be read."""

    value: Any
    entries: dict[Path, Entry] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)


class _CoreLoader(yaml.SafeLoader):
    yaml_implicit_resolvers = {}  # noqa: RUF012 (so declared by PyYAML)


for _name, _pattern in (
    ("null", r"~|null|Null|NULL|"),
    ("bool", r"true|True|TRUE|false|False|FALSE"),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+"),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"),
):
    _CoreLoader.add_implicit_resolver(_TAG + _name, re.compile(f"^(?:{_pattern})$"), None)


def parse(text: str, place: Callable[[int, int], Place], path: Path = ()) -> Tree:
    """The values in `text`, as found at `path`; `place(line, column)` says where a character is (0: nowhere).

    Never raises: what cannot be read is in the tree's faults, and its value is then None.
    """
    loader = None
    try:
        loader = _CoreLoader(text)
        node = loader.get_single_node()
        return _Builder(place).build(node, path)
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        where = place(before.count("\n") + 1, len(before) - before.rfind("\n"))
        what = f"the character {error.character:#x} may not stand in a YAML file"
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = place(mark.line + 1, mark.column + 1) if mark else place(0, 0)
        what = f"not readable as YAML: {error.problem or error.context}"
        if "'\\t'" in what:
            what += " (YAML allows no tabs for indentation: use spaces)"
    except RecursionError:
        where, what = place(0, 0), "nested too deeply"
    except (ValueError, OverflowError):
        # PyYAML on escapes beyond Unicode, and on version numbers of more digits than int() takes.
        line, column = (loader.line + 1, loader.column + 1) if loader else (0, 0)
        where, what = place(line, column), "not readable as YAML: a number or an escape is out of range"
    return Tree(None, faults=[Fault(where, ".".join(path), what)])


class _Builder:
    def __init__(self, place: Callable[[int, int], Place]) -> None:
        self._place = place
        self._tree = Tree(None)
        self._values = 0
        self._open: list[yaml.Node] = []

    def build(self, node: yaml.Node | None, path: Path) -> Tree:
        if node is not None:
            self._tree.value = self._value(node, path, self._at(node))
        return self._tree

    def _at(self, node: yaml.Node) -> Place:
        return self._place(node.start_mark.line + 1, node.start_mark.column + 1)

    def _fault(self, place: Place, path: Path, what: str) -> None:
        self._tree.faults.append(Fault(place, ".".join(path), what))

    def _value(self, node: yaml.Node, path: Path, key: Place) -> Any:
        circular = any(node is one for one in self._open)
        place = key if circular else self._at(node)
        self._tree.entries[path] = Entry(key, place, _shown(node))
        self._values += 1
        if self._values > MAX_VALUES:
            if self._values == MAX_VALUES + 1:
                self._fault(place, (), f"more than {MAX_VALUES} values, aliases counted as often as used")
            return None
        if circular:
            self._fault(place, path, "an alias that contains itself")
            return None
        read, tags = self._reader(node)
        if node.tag not in tags:
            tag = _printable(node.tag.replace(_TAG, "!!"))
            self._fault(place, path, f"the YAML tag {tag} is not allowed")
            return None
        self._open.append(node)
        value = read(node, path)
        self._open.pop()
        return value

    def _reader(self, node: yaml.Node) -> tuple[Callable[[Any, Path], Any], Collection[str]]:
        """How such a node is read, and the tags that it may bear."""
        if isinstance(node, yaml.MappingNode):
            return self._mapping, (_TAG + "map",)
        if isinstance(node, yaml.SequenceNode):
            return self._sequence, (_TAG + "seq",)
        return self._scalar, _SCALARS

    def _scalar(self, node: yaml.ScalarNode, path: Path) -> Any:
        try:
            return _SCALARS[node.tag](node.value)
        except (ValueError, KeyError):
            self._fault(self._at(node), path, f"{_shown(node)} cannot be read as {node.tag.removeprefix(_TAG)}")
            return None

    def _sequence(self, node: yaml.SequenceNode, path: Path) -> list[Any]:
        return [self._value(one, (*path, str(i)), self._at(one)) for i, one in enumerate(node.value)]

    def _mapping(self, node: yaml.MappingNode, path: Path) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for key, value in node.value:
            place = self._at(key)
            if not isinstance(key, yaml.ScalarNode):
                self._fault(place, path, f"a key must be a name, not {_shown(key)}")
                continue
            name = (*path, key.value)
            if key.value in values:
                self._fault(place, name, f"given twice, first in line {self._tree.entries[name].key.line}")
            else:
                values[key.value] = self._value(value, name, place)
        return values


def _integer(text: str) -> int:
    return int(text, {"0o": 8, "0x": 16}.get(text[:2], 10))


def _real(text: str) -> float:
    return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))


_SCALARS: dict[str, Callable[[str], Any]] = {
    _TAG + "null": lambda text: None,
    _TAG + "bool": lambda text: {"true": True, "false": False}[text.lower()],
    _TAG + "int": _integer,
    _TAG + "float": _real,
    _TAG + "str": str,
}


def _printable(text: str) -> str:
    text = text if text.isprintable() else ascii(text)[1:-1]
    return text if len(text) <= 40 else text[:37] + "..."


def _shown(node: yaml.Node) -> str:
    if isinstance(node, yaml.MappingNode):
        return "a mapping"
    if isinstance(node, yaml.SequenceNode):
        return "a list"
    assert isinstance(node, yaml.ScalarNode)
    if node.style:
        return f'the text "{_printable(node.value)}"'
    return _printable(node.value) or "nothing"
