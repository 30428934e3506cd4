"""Read scenes and overrides into a tree that records where each value was written.

A source is a file, a shipped scene, YAML text or a mapping. Scalars follow the core
schema of YAML 1.2: `1e-3` is a number, whereas `yes`, `010` and `1:30` have no special
meaning. A tree contains only mappings, lists and scalars.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import yaml

from taichi_disk.errors import InputError, did_you_mean, printable
from taichi_disk.text_files import read_text

Source: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any]"
Keys: TypeAlias = tuple[str, ...]  # from the top of the scene down to a value
_TAG = "tag:yaml.org,2002:"


class Mark(NamedTuple):
    """Location of text: line and column in a file (both from 1), or the number `rank`
    of a command-line option."""

    rank: int = 0
    line: int = 0
    column: int = 0
    label: str = ""

    def __str__(self) -> str:
        return f"{self.label}:{self.line}:{self.column}" if self.line else self.label

    def moved(self, line: int, column: int) -> Mark:
        """Return the mark of a line and column (both from 0). Marks of options and
        Python values have neither."""
        return (
            self
            if self.rank or not self.label
            else self._replace(line=line + 1, column=column + 1)
        )


class Fault(NamedTuple):
    mark: Mark
    key: str  # dotted name
    what: str

    def __str__(self) -> str:
        return ": ".join(part for part in (str(self.mark), self.key, self.what) if part)


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

    def take_faults(self, other: Tree) -> None:
        """Add the faults of another tree."""
        self.faults += other.faults

    def refuse(self) -> None:
        # Report only the first fault of each value, because an unreadable value is also
        # invalid.
        if faults := sorted(
            {fault[:2]: fault for fault in reversed(self.faults)}.values()
        ):
            head = [] if len(faults) == 1 else [f"{len(faults)} faults in the scene:"]
            raise InputError("\n  ".join(head + [str(fault) for fault in faults]))

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


class _Loader(yaml.BaseLoader):  # a BaseLoader keeps scalars as text
    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        # twenty lines of aliases can stand for millions of values
        if self.check_event(yaml.AliasEvent):
            what = "aliases (*) are not supported: write the value out"
            raise yaml.composer.ComposerError(
                None, None, what, self.peek_event().start_mark
            )
        return super().compose_node(parent, index)


def parse(text: str, source: Mark, path: Keys = ()) -> Tree:
    """Parse YAML `text`, whose values belong at `path`. Unreadable values are None and
    listed in the tree's faults."""
    tree, where = Tree(), source
    try:
        if node := _Loader(text).get_single_node():
            tree.value = _value(node, path, None, tree, source)
        return tree
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        where = source.moved(before.count("\n"), len(before) - before.rfind("\n") - 1)
        what = f"the character {error.character:#x} is not allowed in YAML: remove it"
    except yaml.MarkedYAMLError as error:
        if mark := error.problem_mark or error.context_mark:
            where = source.moved(mark.line, mark.column)
        what = f"not readable as YAML: {error.problem or error.context}"
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
    here = source.moved(node.start_mark.line, node.start_mark.column)
    shown = _as_written(node)
    tree.entries[path] = Entry(key or here, here, shown)
    if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
        values: dict[str, Any] = {}
        for item, value in node.value:
            mark = source.moved(item.start_mark.line, item.start_mark.column)
            if not isinstance(item, yaml.ScalarNode) or not item.value.isprintable():
                tree.fault(mark, path, f"a key must be a name, not {_as_written(item)}")
                continue
            name = (*path, item.value)
            if item.value in values:
                tree.fault(
                    mark,
                    name,
                    f"is given twice, first in line {tree.entries[name].key.line}",
                )
            else:
                values[item.value] = _value(value, name, mark, tree, source)
        return values
    if isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
        return [
            _value(item, (*path, str(k)), None, tree, source)
            for k, item in enumerate(node.value)
        ]
    if isinstance(node, yaml.ScalarNode) and node.tag == _TAG + "str":
        return node.value if node.style else _meaning(node.value)
    tree.fault(
        here,
        path,
        f"{shown} cannot be read as {printable(node.tag.removeprefix(_TAG))}",
    )
    return None


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
    if not isinstance(node, yaml.ScalarNode):
        return (
            f"{'a' if node.value else 'an empty'}"
            f" {'mapping' if isinstance(node, yaml.MappingNode) else 'list'}"
        )
    return (
        f'the text "{printable(node.value)}"'
        if node.style
        else printable(node.value) or "nothing"
    )


def tree_of(data: Mapping[str, Any]) -> Tree:
    tree = Tree()

    def plain(value: Any, path: Keys) -> Any:
        if hasattr(value, "tolist"):
            value = value.tolist()
        if isinstance(value, Mapping):
            items = {printable(str(name)): item for name, item in value.items()}
            value, shown = (
                {name: plain(item, (*path, name)) for name, item in items.items()},
                "a mapping",
            )
        elif isinstance(value, (list, tuple)):
            value, shown = (
                [plain(item, (*path, str(k))) for k, item in enumerate(value)],
                "a list",
            )
        elif value is None or isinstance(value, (bool, int, float)):
            shown = printable(str(value))
        else:
            value = str(value)
            shown = f'the text "{printable(value)}"'
        tree.entries[path] = Entry(Mark(), Mark(), shown)
        return value

    try:
        tree.value = plain(data, ())
    # raised for a loop, or an integer with thousands of digits
    except (RecursionError, ValueError):
        raise InputError(
            "a scene must be a mapping of keys to numbers and words, without loops"
        ) from None
    return tree


def read_tree(source: Source, overrides: Sequence[str]) -> Tree:
    """Read `source` and apply `overrides` of the form "section.key=value".

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
    # A missing key has no line to report.
    tree.entries[()] = Entry(start, start, "a mapping")
    for rank, override in enumerate(overrides, start=1):
        _override(tree, override, rank)
    return tree


def _read(source: str | os.PathLike[str]) -> tuple[str, str, str]:
    if isinstance(source, str) and (
        "\n" in source or (": " in source and not os.path.exists(source))
    ):
        return "scene", "", source
    path = as_path(source, "scene")
    # the folder of a run may have the name of a shipped scene
    if not os.path.exists(path) or os.path.isdir(path):
        path = shipped_scenes().get(str(path), path)
    label = printable(str(path), width=1000)
    try:
        # A pipe has no folder.
        folder = str(path.parent) if path.is_file() else ""
        text = read_text(path, accept_pipe=True)
    except (FileNotFoundError, NotADirectoryError):
        known = shipped_scenes()
        hint = did_you_mean(path.stem, known) or "."
        raise InputError(
            f"{label}: no such file{hint} The shipped scenes are {', '.join(known)}"
        ) from None
    except (OSError, ValueError) as error:
        raise InputError(
            f"{label}: cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from None
    return label, folder, text


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
    # The name of a sweep axis may contain dots.
    path = tuple(
        part.strip()
        for part in name.split(".", 1 if name.strip().startswith("sweep.") else -1)
    )
    if not equals or not all(part and part.isprintable() for part in path):
        tree.fault(
            mark,
            (),
            "must be KEY=VALUE without spaces around =, for example"
            " material.eta_star=30",
        )
        return
    blocks = tree.value.get("sweep")
    if path[0] == "sweep" and len(path) == 2 and isinstance(blocks, list):
        parents: dict[Keys, Any] = {
            ("sweep", str(k)): one
            for k, one in enumerate(blocks)
            if isinstance(one, dict)
        }
    else:
        parent = tree.value
        for depth, part in enumerate(path[:-1], start=1):
            parent = parent.setdefault(part, {})
            tree.entries.setdefault(path[:depth], Entry(mark, mark, "a mapping"))
            if not isinstance(parent, dict):
                tree.fault(mark, (), f"{'.'.join(path[:depth])} is not a section")
                return
        parents = {path[:-1]: parent}
    for section, parent in parents.items():
        where = (*section, path[-1])
        new, old = parse(text, mark, where), parent.get(path[-1])
        tree.take_faults(new)
        # replace some keys of a section
        if len(where) == 1 and isinstance(old, dict) and isinstance(new.value, dict):
            new.value = old | new.value
        parent[path[-1]] = new.value
        tree.entries |= {where: Entry(mark, mark)} | new.entries


def shipped_scenes() -> dict[str, Path]:
    package = Path(__file__).parent.parent
    # An installed package contains the files; a source checkout has them in its top
    # folder.
    folders = (package / "scene_library", package.parent / "scenes")
    return {
        path.stem: path
        for folder in reversed(folders)
        for path in sorted(folder.glob("[!.]*.yaml"))
    }
