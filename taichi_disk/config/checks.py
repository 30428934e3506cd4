"""A tree of values checked against the kinds of scenes: a scene, or every fault in words, with the nearest name."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

from taichi_disk.config.sections import Key
from taichi_disk.config.yaml_tree import Path, Tree

if TYPE_CHECKING:
    from taichi_disk.config.scene_base import SceneBase

Kinds: TypeAlias = "Mapping[str, type[SceneBase]]"  # of scenes, by the name that `scene:` takes


def check(tree: Tree, kinds: Kinds) -> SceneBase | None:
    """The scene that the tree describes; None where it has faults, which are added to the tree's."""
    kind = tree.value.get("scene")
    if isinstance(kind, str) and kind in kinds:
        return _read(kind, tree, kinds)
    entry = tree.entry(("scene",))
    what = f"missing: write scene: {either(kinds)}"
    if "scene" in tree.value:
        what = f"must be {either(kinds)}, not {entry.shown}{did_you_mean(kind, kinds)}"
    tree.fault(entry.value, ("scene",), what)
    # The other keys are judged as the kind that was probably meant, else as the kind that they fit best.
    judged = {name: replace(tree, faults=list(tree.faults)) for name in _nearest(kind, kinds) or kinds}
    for name, one in judged.items():
        _read(name, one, kinds)
    found = (one.faults for one in judged.values())
    tree.faults = min(found, key=lambda faults: (sum("belongs to" in one.what for one in faults), len(faults)))
    return None


def _read(kind: str, tree: Tree, kinds: Kinds) -> SceneBase | None:
    sections, read = kinds[kind].sections(), dict[str, Any]()
    for name, given in tree.value.items():
        entry = tree.entry((name,))
        if name == "scene":
            continue
        if name not in sections:
            tree.fault(entry.key, (name,), _unknown(kind, (name,), kinds))
        elif given is None:
            tree.fault(entry.value, (name,), "an empty section: give it a key, or leave it out")
        elif not isinstance(given, dict):
            what = f"must be a section, that is indented lines of key: value, not {entry.shown}"
            tree.fault(entry.value, (name,), what)
        else:
            values = {one: _value(kind, (name, one), value, tree, kinds) for one, value in given.items()}
            read[name] = (sections[name], values)
    if tree.faults:
        return None
    scene: SceneBase = kinds[kind](**{name: replace(section, **values) for name, (section, values) in read.items()})
    for key, what in scene.conflicts():
        path = tuple(key.split("."))
        tree.fault(tree.entry(path).value, path, what)
    return None if tree.faults else scene


def _value(kind: str, path: Path, value: Any, tree: Tree, kinds: Kinds) -> Any:
    """`value` as the scene keeps it, or a fault."""
    key, entry = kinds[kind].sections()[path[0]].schema().get(path[1]), tree.entry(path)
    if key is None:
        tree.fault(entry.key, path, _unknown(kind, path, kinds))
    elif not key.accepts(value):
        what = f"must be {_allowed(key)}, not {entry.shown}{did_you_mean(value, key.words)} ({key.meaning})"
        tree.fault(entry.value, path, what)
    elif path == ("lattice", "file") and value != "none":
        # On the command line a name counts from the working directory, in a scene file from the file's folder.
        folder = "" if entry.value.rank else tree.folder
        return os.path.realpath(os.path.join(folder, os.path.expanduser(value)))
    elif key.kind is float and not isinstance(value, str):
        return float(value)
    return value


def _allowed(key: Key) -> str:
    """The values that a key may have, in words."""
    if key.kind is bool:
        return "true or false"
    if key.kind is str:
        return either(key.words or ("none", "the name of a file"))
    number = "a whole number" if key.kind is int else "a number"
    if key.step:
        number = "an even whole number" if key.step == 2 else f"a multiple of {key.step:g}"
    numbers = f"{number} from {_short(key.low)} to {_short(key.high)}"
    return either([*key.words, numbers]) + (f" [{key.unit}]" if key.unit else "")


def _short(bound: float) -> str:
    return str(bound) if isinstance(bound, int) else f"{bound:.5g}".replace("e-0", "e-").replace("e+0", "e")


def _unknown(kind: str, path: Path, kinds: Kinds) -> str:
    """Why the key at `path` is not one of this kind of scene, and what was probably meant."""
    section, *keys = path
    having = {name: one.sections()[section].schema() for name, one in kinds.items() if section in one.sections()}
    if others := [name for name, known in having.items() if known.keys() >= set(keys)]:
        return f"belongs to scene: {either(others)}, not to scene: {kind}"
    if homes := kinds[kind].homes(path[-1]):  # another section's key only where it bears exactly this name
        return f"unknown key; did you mean {either('.'.join(home) for home in homes)}?"
    siblings = list(having[kind]) if keys else ["scene", *kinds[kind].sections()]
    listed = f"; {section if keys else f'scene: {kind}'} has {', '.join(siblings)}"
    return f"unknown key{did_you_mean(path[-1], siblings) or listed}"


def _nearest(word: Any, names: Iterable[str]) -> list[str]:
    """The nearest of `names`, whatever its case; empty if none is near."""
    by_lower = {name.lower(): name for name in names}
    near = difflib.get_close_matches(str(word).lower(), by_lower, n=1) if isinstance(word, str) else []
    return [by_lower[one] for one in near]


def did_you_mean(word: Any, names: Iterable[str]) -> str:
    """The end of a message: the nearest of `names`, or nothing."""
    return "".join(f"; did you mean {near}?" for near in _nearest(word, names))


def either(names: Iterable[str]) -> str:
    """The names in words: a, b or c."""
    *first, last = names
    return f"{', '.join(first)} or {last}" if first else last
