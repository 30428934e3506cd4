"""Read scenes and overrides into a tree that records where each value was written.

A source is a file, a shipped scene, YAML text or a mapping. Scalars follow the core
schema of YAML 1.2: `1e-3` is a number, whereas `yes`, `010` and `1:30` have no special
meaning. A tree contains only mappings, lists and scalars.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import yaml
from yaml import BaseLoader  # the error names the file if a yaml.py hides the package

from taichi_disk.base.errors import (
    InputError,
    did_you_mean,
    printable,
    reason,
    shown_path,
)
from taichi_disk.base.text_files import read_text

Source: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any]"
Keys: TypeAlias = tuple[str, ...]  # from the top of the scene down to a value
QUOTES = "a backslash in double quotes begins a special character: use single quotes"
_TAG = "tag:yaml.org,2002:"
_MAX_EXPLAINED = 20  # faults; a search for what was meant takes milliseconds


class Mark(NamedTuple):
    """Location of text: line and column in a file (both from 1), or the number `rank`
    of a command-line option."""

    rank: int = 0
    line: int = 0
    column: int = 0
    label: str = ""

    def __str__(self) -> str:
        if self.line:
            return f"{self.label}:{self.line}:{self.column}"
        return self.label

    def moved(self, line: int, column: int) -> Mark:
        """Return the mark of a line and column (both from 0). Marks of options and
        Python values have neither."""
        if self.rank or not self.label:
            return self
        return self._replace(line=line + 1, column=column + 1)


class Fault(NamedTuple):
    mark: Mark
    key: str  # dotted name
    what: str

    def __str__(self) -> str:
        parts = (str(self.mark), self.key, self.what)
        return ": ".join(part for part in parts if part)


class Entry(NamedTuple):
    """Locations of a key and its value, and the value as written."""

    key: Mark
    value: Mark
    shown: str = "nothing"


@dataclass
class Tree:
    """Values of a scene, an entry for each path, faults, and the folder to which file
    names are relative."""

    value: Any = None
    entries: dict[Keys, Entry] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)
    folder: str = ""

    def fault(self, mark: Mark, path: Keys, what: str) -> None:
        self.faults.append(Fault(mark, ".".join(path), what))

    def remove(self, section: str, key: str) -> None:
        del self.value[section][key]
        del self.entries[section, key]

    @property
    def is_full(self) -> bool:
        """Whether there are so many faults that others are only counted."""
        return len(self.faults) >= _MAX_EXPLAINED

    def refuse(self) -> None:
        """Raise InputError with all faults, if there are any."""
        if not self.faults:
            return
        # Report only the first fault of each value, because an unreadable value is also
        # invalid.
        first: dict[tuple[Mark, str], Fault] = {}
        for fault in self.faults:
            first.setdefault((fault.mark, fault.key), fault)
        lines = [str(fault) for fault in sorted(first.values())]
        count = len(lines)
        if count > _MAX_EXPLAINED:
            lines[_MAX_EXPLAINED:] = [f"and {count - _MAX_EXPLAINED:,} more"]
        if count > 1:
            lines.insert(0, f"{count:,} faults in the scene:")
        raise InputError("\n  ".join(lines))

    def entry(self, path: Keys) -> Entry:
        """Return the entry of `path`, or of its closest ancestor present in the
        file."""
        while path not in self.entries:
            path = path[:-1]
        return self.entries[path]


# the minus sign of typography, which people copy from papers and web pages
_MINUS = "\u2212"
# Meaning of plain scalars. PyYAML itself reads 1e-3 as text, 010 and 1:30 as numbers,
# and `yes` as true.
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
_INTEGER = re.compile("[-+]?[0-9]+|0o[0-7]+|0x[0-9a-f]+")
_FLOAT = re.compile(
    r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)(e[-+]?[0-9]+)?|[-+]?\.inf|\.nan"
)


class _Loader(BaseLoader):  # a BaseLoader keeps scalars as text
    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        # twenty lines of aliases can stand for millions of values
        if self.check_event(yaml.AliasEvent):
            what = "aliases (*) are not supported: write the value out"
            raise yaml.composer.ComposerError(
                None, None, what, self.peek_event().start_mark
            )
        return super().compose_node(parent, index)


@lru_cache(maxsize=128)  # a program reads the same scenes again and again
def _composed(text: str) -> yaml.Node | None:
    return _Loader(text).get_single_node()


def parse(text: str, source: Mark, path: Keys = ()) -> Tree:
    """Parse YAML `text`, whose values belong at `path`. Unreadable values are None and
    listed in the tree's faults."""
    tree = Tree()
    where = source
    try:
        node = _composed(text)
        if node:
            tree.value = _value(node, path, None, tree, source)
        return tree
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        column = len(before) - before.rfind("\n") - 1
        where = source.moved(before.count("\n"), column)
        what = f"the character {error.character:#x} is not allowed in YAML: remove it"
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        if mark:
            where = source.moved(mark.line, mark.column)
        what = f"not readable as YAML: {error.problem or error.context}"
        if "escape" in what:
            what += f" ({QUOTES})"
        if "'\\t'" in what:
            what += " (YAML allows no tabs for indentation: use spaces)"
    # the last two: version numbers, escapes, thousands of digits
    except (RecursionError, ValueError, OverflowError):
        what = (
            "not readable as YAML: nested too deeply, or a number or an escape is out"
            " of range"
        )
    return Tree(faults=[Fault(where, ".".join(path), what)])


def _value(
    node: yaml.Node, path: Keys, key: Mark | None, tree: Tree, source: Mark
) -> Any:
    here = _mark_of(node, source)
    shown = _as_written(node)
    tree.entries[path] = Entry(key or here, here, shown)
    if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
        return _mapping(node, path, tree, source)
    if isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
        return [
            _value(item, (*path, str(k)), None, tree, source)
            for k, item in enumerate(node.value)
        ]
    if isinstance(node, yaml.ScalarNode) and node.tag == _TAG + "str":
        if node.style:  # in quotes
            return node.value
        return _meaning(node.value)
    kind = printable(node.tag.removeprefix(_TAG))
    tree.fault(here, path, f"{shown} cannot be read as {kind}")
    return None


def _mark_of(node: yaml.Node, source: Mark) -> Mark:
    return source.moved(node.start_mark.line, node.start_mark.column)


def _mapping(
    node: yaml.MappingNode, path: Keys, tree: Tree, source: Mark
) -> dict[str, Any]:
    values = {}
    for item, value in node.value:
        mark = _mark_of(item, source)
        if not isinstance(item, yaml.ScalarNode) or not item.value.isprintable():
            tree.fault(mark, path, f"a key must be a name, not {_as_written(item)}")
            continue
        name = item.value
        if name in values:
            line = tree.entries[(*path, name)].key.line
            tree.fault(mark, (*path, name), f"is given twice, first in line {line}")
            continue
        values[name] = _value(value, (*path, name), mark, tree, source)
    return values


def _meaning(text: str) -> Any:
    word = text.lower()
    if word in _WORDS:
        return _WORDS[word]
    number = word.replace(_MINUS, "-")
    if _INTEGER.fullmatch(number):
        base = {"0o": 8, "0x": 16}.get(number[:2], 10)
        return int(number, base)
    if _FLOAT.fullmatch(number):
        return float(number.replace(".inf", "inf").replace(".nan", "nan"))
    return text


def _as_written(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        if node.style:
            return f'the text "{printable(node.value)}"'
        return printable(node.value) or "nothing"
    kind = "list"
    if isinstance(node, yaml.MappingNode):
        kind = "mapping"
    if node.value:
        return f"a {kind}"
    return f"an empty {kind}"


def tree_of(data: Mapping[str, Any]) -> Tree:
    tree = Tree()
    try:
        tree.value = _plain(data, (), tree)
    # raised for a loop, or an integer with thousands of digits
    except (RecursionError, ValueError):
        raise InputError(
            "a scene must be a mapping of keys to numbers and words, without loops"
        ) from None
    return tree


def _plain(value: Any, path: Keys, tree: Tree) -> Any:
    """Return a Python value as a tree contains it, and add its entries to the tree."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    plain = value
    if isinstance(value, Mapping):
        plain = {}
        for key, item in value.items():
            name = printable(str(key))
            plain[name] = _plain(item, (*path, name), tree)
        shown = "a mapping"
    elif isinstance(value, Iterable) and not isinstance(value, (str, bytes)):
        plain = [_plain(item, (*path, str(k)), tree) for k, item in enumerate(value)]
        shown = "a list"
    elif value is None or isinstance(value, (bool, int, float)):
        shown = printable(str(value))
    else:
        plain = str(value)
        shown = f'the text "{printable(plain)}"'
    tree.entries[path] = Entry(Mark(), Mark(), shown)
    return plain


def read_tree(source: Source, overrides: str | Sequence[str]) -> Tree:
    """Read `source` and apply one or more `overrides`, "section.key=value" each.

    A str with a line end or ": " is YAML text. The source may be a pipe, because it is
    read only once. Raises InputError if the source does not exist or is no mapping;
    other faults are listed in the tree.
    """
    start = Mark()
    if isinstance(source, Mapping):
        tree = tree_of(source)
    else:
        label, folder, text = _read(source)
        start = Mark(label=label)
        tree = parse(text, start)
        tree.folder = folder
    if not isinstance(tree.value, dict):
        tree.refuse()
        if tree.value is None:
            raise InputError(
                f"{start}: holds no keys: a scene needs at least the line `scene:"
                " exponential_wall`"
            )
        entry = tree.entries[()]
        what = (
            "a scene consists of lines `key: value` (with a space after the colon),"
            f" not {entry.shown}"
        )
        raise InputError(f"{entry.value}: {what}")
    if isinstance(overrides, str):
        overrides = [overrides]
    # A missing key has no line to report.
    tree.entries[()] = Entry(start, start, "a mapping")
    for rank, override in enumerate(overrides, start=1):
        _override(tree, override, rank)
    return tree


def _read(source: str | os.PathLike[str]) -> tuple[str, str, str]:
    if isinstance(source, str) and _is_yaml(source):
        return "scene", "", source
    path = as_path(source, "scene")
    # the folder of a run may have the name of a shipped scene
    if not os.path.exists(path) or os.path.isdir(path):
        path = shipped_scenes().get(str(path), path)
    label = shown_path(path)
    folder = ""  # a pipe has none
    try:
        if path.is_file():
            folder = str(path.parent)
        text = read_text(path, accept_pipe=True)
    except (FileNotFoundError, NotADirectoryError):
        known = shipped_scenes()
        hint = did_you_mean(path.stem, known) or "."
        raise InputError(
            f"{label}: no such file{hint} The shipped scenes are"
            f" {', '.join(known) or 'missing, as in a zip file: install the program'}"
        ) from None
    except (OSError, ValueError) as error:
        raise InputError(f"{label}: cannot be read: {reason(error)}") from None
    return label, folder, text


def _is_yaml(source: str) -> bool:
    if "\n" in source:
        return True
    return ": " in source and not os.path.exists(source)


def as_path(path: Any, name: str) -> Path:
    """Return `path` with ~ expanded. Raises InputError with the argument's `name` if it
    is no path."""
    try:
        expanded = Path(path).expanduser()
    except TypeError:
        raise InputError(f"{name}: must be a path, not {path!r:.60}") from None
    except RuntimeError:
        raise InputError(f"{name}: {path}: there is no user of this name") from None
    if "\0" in str(expanded):
        raise InputError(f"{name}: a path has no null characters, as {path!r:.60} has")
    return expanded


def _override(tree: Tree, override: str, rank: int) -> None:
    mark = Mark(rank, label=f"--set {printable(override, width=1000)}")
    name, equals, text = override.partition("=")
    # the name of a sweep axis may contain dots
    path = [part.strip() for part in name.split(".", 1)]
    if not equals or not all(part and part.isprintable() for part in path):
        tree.fault(
            mark,
            (),
            "must be KEY=VALUE without spaces around =, for example"
            " material.eta_star=30",
        )
        return
    *section, key = path
    for place, parent in _parents(tree, section, mark):
        where = (*place, key)
        new = parse(text, mark, where)
        tree.faults += new.faults
        old = parent.get(key)
        value = new.value
        if not place and isinstance(old, dict) and isinstance(value, dict):
            value = old | value  # replaces some keys of a section
        parent[key] = value
        tree.entries |= {where: Entry(mark, mark)} | new.entries


def _parents(
    tree: Tree, section: list[str], mark: Mark
) -> list[tuple[Keys, dict[str, Any]]]:
    """Return the mappings that get the value of a key, with their paths: that of the
    `section`, if there is one, or each of a sweep, or none if something else is
    there."""
    if not section:
        return [((), tree.value)]
    (name,) = section
    content = tree.value.setdefault(name, {})
    tree.entries.setdefault((name,), Entry(mark, mark, "a mapping"))
    if isinstance(content, dict):
        return [((name,), content)]
    if name != "sweep" or not isinstance(content, list):
        tree.fault(mark, (), f"{name} is not a section")
        return []
    return [
        ((name, str(k)), block)
        for k, block in enumerate(content)
        if isinstance(block, dict)
    ]


def shipped_scenes() -> dict[str, Path]:
    """Return the paths of the shipped scenes by their names."""
    package = Path(__file__).parents[2]
    scenes: dict[str, Path] = {}
    # A source checkout has the files in its top folder; an installed package contains
    # them, and they count if both exist.
    for folder in (package.parent / "scenes", package / "scene_library"):
        paths = sorted(folder.glob("[!.]*.yaml"))
        scenes |= {path.stem: path for path in paths if path.is_file()}
    return scenes
