"""YAML text, or plain Python values, as a tree that knows where each value was written.

Scalars follow the core schema of YAML 1.2: `1e-3` is a number (PyYAML by itself takes it for a string), while
`yes`, `010` and `1:30` have no second meaning. Nothing but mappings, lists and scalars is ever built.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import yaml

from taichi_disk.errors import InputError

Path: TypeAlias = tuple[str, ...]
_TAG = "tag:yaml.org,2002:"


class Place(NamedTuple):
    """Where something was written: a file with line and column (both from 1), or the rank-th option."""

    rank: int = 0
    line: int = 0
    column: int = 0
    label: str = ""

    def __str__(self) -> str:
        return f"{self.label}:{self.line}:{self.column}" if self.line else self.label

    def moved(self, line: int, column: int) -> Place:
        """The place of a line and column (both from 0) in a file; an option and a Python value have none."""
        return self if self.rank or not self.label else self._replace(line=line + 1, column=column + 1)


class Fault(NamedTuple):
    place: Place
    key: str  # dotted
    what: str

    def __str__(self) -> str:
        return ": ".join(part for part in (str(self.place), self.key, self.what) if part)


class Entry(NamedTuple):
    """Where a key and its value were written, and the value as its author would recognise it."""

    key: Place
    value: Place
    shown: str = "nothing"


@dataclass
class Tree:
    """Values, the entry of each path in them, what could not be read, and the folder that file names start from."""

    value: Any = None
    entries: dict[Path, Entry] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)
    folder: str = ""

    def fault(self, place: Place, path: Path, what: str) -> None:
        self.faults.append(Fault(place, ".".join(path), what))

    def refuse(self) -> None:
        """Raise InputError with every fault, in the order of the file, where there is one."""
        # The first of several at one place: a value that could not even be read is not also told to be unfit.
        if faults := sorted({fault[:2]: fault for fault in reversed(self.faults)}.values()):
            head = [] if len(faults) == 1 else [f"{len(faults)} faults in the scene:"]
            raise InputError("\n  ".join(head + [str(fault) for fault in faults]))

    def entry(self, path: Path) -> Entry:
        """That of the path itself, else of the nearest part of the scene around it that was written."""
        while path not in self.entries:
            path = path[:-1]
        return self.entries[path]


class _CoreLoader(yaml.SafeLoader):
    yaml_implicit_resolvers = {}  # noqa: RUF012 (so declared by PyYAML)

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            what = "aliases (*) are not supported: write the value out"  # they may stand for billions of values
            raise yaml.composer.ComposerError(None, None, what, self.peek_event().start_mark)
        return super().compose_node(parent, index)


for _name, _pattern in (
    ("null", r"~|null|Null|NULL|"),
    ("bool", r"true|True|TRUE|false|False|FALSE"),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+"),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"),
):
    _CoreLoader.add_implicit_resolver(_TAG + _name, re.compile(f"^(?:{_pattern})$"), None)

_SCALARS: dict[str, Callable[[str], Any]] = {
    _TAG + "null": lambda text: None,
    _TAG + "bool": lambda text: {"true": True, "false": False}[text.lower()],
    _TAG + "int": lambda text: int(text, {"0o": 8, "0x": 16}.get(text[:2], 10)),
    _TAG + "float": lambda text: float(text.lower().replace(".inf", "inf").replace(".nan", "nan")),
    _TAG + "str": str,
}


def parse(text: str, source: Place, path: Path = ()) -> Tree:
    """The values in `text`, as found at `path`.

    Never raises: what cannot be read is in the tree's faults, and its value is then None.
    """
    tree, where = Tree(), source
    try:
        if node := _CoreLoader(text).get_single_node():
            tree.value = _value(node, path, None, tree, source)
        return tree
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        where = source.moved(before.count("\n"), len(before) - before.rfind("\n") - 1)
        what = f"the character {error.character:#x} may not stand in a YAML file"
    except yaml.MarkedYAMLError as error:
        if mark := error.problem_mark or error.context_mark:
            where = source.moved(mark.line, mark.column)
        what = f"not readable as YAML: {error.problem or error.context}"
        if "'\\t'" in what:
            what += " (YAML allows no tabs for indentation: use spaces)"
    except (RecursionError, ValueError, OverflowError):  # the last two of version numbers, and escapes beyond Unicode
        what = "not readable as YAML: nested too deeply, or a number or an escape is out of range"
    return Tree(faults=[Fault(where, ".".join(path), what)])


def _value(node: yaml.Node, path: Path, key: Place | None, tree: Tree, source: Place) -> Any:
    here = source.moved(node.start_mark.line, node.start_mark.column)
    shown = _shown(node)
    tree.entries[path] = Entry(key or here, here, shown)
    if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
        values: dict[str, Any] = {}
        for one, value in node.value:
            at = source.moved(one.start_mark.line, one.start_mark.column)
            if not isinstance(one, yaml.ScalarNode) or not one.value.isprintable():
                tree.fault(at, path, f"a key must be a name, not {_shown(one)}")
                continue
            name = (*path, one.value)
            if one.value in values:
                tree.fault(at, name, f"given twice, first in line {tree.entries[name].key.line}")
            else:
                values[one.value] = _value(value, name, at, tree, source)
        return values
    if isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
        return [_value(one, (*path, str(k)), None, tree, source) for k, one in enumerate(node.value)]
    if isinstance(node, yaml.ScalarNode):
        with suppress(KeyError, ValueError):  # another tag, or a text that does not fit it
            return _SCALARS[node.tag](node.value)
    tree.fault(here, path, f"{shown} cannot be read as {printable(node.tag.removeprefix(_TAG))}")
    return None


def _shown(node: yaml.Node) -> str:
    if not isinstance(node, yaml.ScalarNode):
        return "a mapping" if isinstance(node, yaml.MappingNode) else "a list"
    return f'the text "{printable(node.value)}"' if node.style else printable(node.value) or "nothing"


def tree_of(data: Mapping[str, Any]) -> Tree:
    """A tree of Python values, which have no places. NumPy's numbers become Python's; paths become text."""
    try:  # JSON is YAML too
        text = json.dumps(dict(data), ensure_ascii=False, default=lambda one: getattr(one, "item", one.__str__)())
    except (RecursionError, ValueError, TypeError):  # a loop; an integer of thousands of digits; a key that is a tuple
        raise InputError("not the keys and values of a scene") from None
    tree = parse(text, Place())
    tree.refuse()
    return tree


def printable(text: str, width: int = 40) -> str:
    """The text with escapes for what a terminal cannot show, cut off at `width` characters."""
    text = text if text.isprintable() else ascii(text)[1:-1]
    return text if len(text) <= width else text[: width - 3] + "..."
