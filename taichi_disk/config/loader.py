"""Scene files: from YAML to a checked scene or sweep, or to one message with every fault and its place.

The kinds of scenes are handed in; `taichi_disk.scenes` binds them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from taichi_disk.config.checks import Kinds, check, did_you_mean
from taichi_disk.config.scene_base import SceneBase
from taichi_disk.config.sweep_axes import Sweep, check_sweep
from taichi_disk.config.yaml_tree import Entry, Fault, Place, Tree, parse, printable, tree_of
from taichi_disk.errors import InputError

Source: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any]"


def load(source: Source, overrides: Sequence[str], kinds: Kinds, want: str = "any") -> SceneBase | Sweep:
    """Read a scene, or a sweep where the source has a section `sweep:`, and check it.

    See `taichi_disk.scenes.load_scene` and `load_sweep`. YAML text is a str with a line end or ": ". The source is read
    once, so that it may be a pipe. `want` is "scene", "sweep" or "any"; the other one is refused with advice.
    """
    tree = _read_tree(source, overrides)
    has_sweep = "sweep" in tree.value
    if has_sweep and want == "scene":
        what = "this scene has a sweep: compute it with `taichi-disk sweep`, or leave this section out"
        tree.fault(tree.entries[("sweep",)].key, ("sweep",), what)
    if not has_sweep and want == "sweep":
        what = "there is no sweep: section: compute a single scene with `taichi-disk run`, or add one, for example "
        tree.fault(tree.entries[()].value, (), what + "`sweep: {seed: {range: 8}}`")
    _end_precision(tree)
    found = check_sweep(tree, kinds) if has_sweep else check(tree, kinds)
    tree.refuse()
    assert found is not None
    return found


def shipped_scenes() -> dict[str, Path]:
    """The scenes that come with the package, by bare name."""
    package = Path(__file__).parent.parent
    # In an installed package the files lie in it; in a source checkout, at the top of the tree.
    folders = (package / "scene_library", package.parent / "scenes")
    return {path.stem: path for folder in reversed(folders) for path in sorted(folder.glob("[!.]*.yaml"))}


def _read_tree(source: Source, overrides: Sequence[str]) -> Tree:
    start = Place()
    if isinstance(source, Mapping):
        tree = tree_of(source)
    else:
        label, folder, text = _read(source)
        start = Place(label=label)
        tree = parse(text, start)
        tree.folder = folder
    if not isinstance(tree.value, dict):
        tree.refuse()
        if tree.value is None:
            raise InputError(f"{start}: holds no keys: a scene needs at least the line `scene: exponential_wall`")
        entry = tree.entries[()]
        what = f"a scene is a list of lines `key: value` (mind the space after the colon), not {entry.shown}"
        raise InputError(f"{entry.value}: {what}")
    # Where a key that nobody wrote is at fault, there is no line to name.
    tree.entries[()] = Entry(start, start, "a mapping")
    for rank, override in enumerate(overrides, start=1):
        _override(tree, override, rank)
    return tree


def _end_precision(tree: Tree) -> None:
    """Take `time.precision`, a key of older versions, out of the tree, and say so."""
    time, path = tree.value.get("time"), ("time", "precision")
    if not isinstance(time, dict) or "precision" not in time:
        return
    if time.pop("precision") == "f64":
        what = "this key has ended, all computations are in double precision: leave it out"
        print(f"note: {Fault(tree.entry(path).key, 'time.precision', what)}", file=sys.stderr)
    else:
        what = "single precision gained nothing in whole commands and was removed: leave this key out"
        tree.fault(tree.entry(path).value, path, what)


def _read(source: str | os.PathLike[str]) -> tuple[str, str, str]:
    """(name for messages, folder that file names start from, text) of a scene."""
    if isinstance(source, str) and ("\n" in source or (": " in source and not os.path.exists(source))):
        return "scene", "", source
    path = Path(source)
    if not os.path.exists(path) or os.path.isdir(path):  # a run leaves a folder of that name
        path = shipped_scenes().get(str(path), path)
    label = printable(str(path), width=1000)
    try:
        data = path.read_bytes()
        # What is piped has no folder of its own.
        return label, str(path.parent) if path.is_file() else "", data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{label}:{line}: not UTF-8 text (byte {data[error.start]:#x}); save it as UTF-8") from None
    except (FileNotFoundError, NotADirectoryError):
        known = shipped_scenes()
        hint = did_you_mean(path.stem, known) or "."
        raise InputError(f"{label}: no such file{hint} The shipped scenes are {', '.join(known)}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{label}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def _override(tree: Tree, override: str, rank: int) -> None:
    """Write the value of "section.key=value" into the tree, or add a fault to it."""
    place = Place(rank, label=f"--set {printable(override, width=1000)}")
    name, equals, text = override.partition("=")
    # The name of an axis may itself be dotted.
    path = tuple(part.strip() for part in name.split(".", 1 if name.strip().startswith("sweep.") else -1))
    if not equals or not all(part and part.isprintable() for part in path):
        tree.fault(place, (), "must be KEY=VALUE without spaces around =, for example material.eta_star=30")
        return
    blocks = tree.value.get("sweep")
    if path[0] == "sweep" and len(path) == 2 and isinstance(blocks, list):
        for k, block in enumerate(blocks):
            if isinstance(block, dict):
                _put(tree, block, ("sweep", str(k), path[1]), text, place)
        return
    parent = tree.value
    for depth, part in enumerate(path[:-1], start=1):
        parent = parent.setdefault(part, {})
        tree.entries.setdefault(path[:depth], Entry(place, place, "a mapping"))
        if not isinstance(parent, dict):
            tree.fault(place, (), f"{'.'.join(path[:depth])} is not a section")
            return
    _put(tree, parent, path, text, place)


def _put(tree: Tree, parent: dict[str, Any], path: tuple[str, ...], text: str, place: Place) -> None:
    new, there = parse(text, place, path), parent.get(path[-1])
    tree.faults += new.faults
    section = len(path) == 1 and isinstance(there, dict) and isinstance(new.value, dict)  # some of its keys are given
    parent[path[-1]] = there | new.value if section else new.value
    tree.entries |= {path: Entry(place, place)} | new.entries
