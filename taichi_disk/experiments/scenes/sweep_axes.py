"""The `sweep:` section: which keys of a scene take which values, checked like every
other value.

    sweep: {eta_star: [0, 10, 100], velocity: {geom: [3e-3, 5e-2, 12]}, seed: {range:
        8}}

Every combination is one scene. A list of such sections is swept one after the other.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

from taichi_disk.base.errors import did_you_mean, printable
from taichi_disk.experiments.config.tree import Entry, Keys, Tree
from taichi_disk.experiments.config.words import resolve_synonym
from taichi_disk.experiments.scenes.scene import (
    DiskScene,
    Home,
    Kinds,
    Value,
    check,
    yaml_scalar,
)

MAX_SCENES = 100_000
FORMS = (
    "a list of values, {lin: [from, to, count]}, {geom: [from, to, count]} or {range:"
    f" count}}, of at most {MAX_SCENES} values"
)


class Axis(NamedTuple):
    """An axis of one section: its key, and its values with the entries for messages."""

    home: Home
    values: list[tuple[Value, Entry]]


@dataclass(frozen=True)
class Sweep:
    """Scenes that differ in some keys.

    Attributes:
        axes: the keys that differ, by their names in the file.
        blocks: axes of each section `sweep:`, name to values; a block stands for all
            combinations of its values.
        scenes: all scenes without duplicates; the last axis of a block varies fastest.
    """

    axes: dict[str, Home]
    blocks: tuple[dict[str, tuple[Value, ...]], ...]
    scenes: tuple[Any, ...]

    def place_of(self, scene: DiskScene) -> dict[str, Any]:
        """Return the value of each axis in a scene."""
        return {name: _value(scene, home) for name, home in self.axes.items()}

    def to_yaml(self) -> str:
        """Return the sweep as YAML with all defaults; reading it gives an equal
        sweep."""
        swept = [".".join(home) for home in self.axes.values()]
        lines = ["sweep:"]
        for block in self.blocks:
            start = "  - "
            for name, values in block.items():
                written = ", ".join(map(yaml_scalar, values))
                lines.append(f"{start}{name}: [{written}]")
                start = "    "
        return self.scenes[0].to_yaml(leave_out=swept) + "\n".join(lines) + "\n"


def _home(kind: type[DiskScene], name: str) -> Home | None:
    """Return the key that `name`, which may be dotted, means, or None if there is no
    such key."""
    return next((home for home in kind.homes(name) if home[0] != "video"), None)


def _value(scene: DiskScene, home: Home) -> Any:
    section, key = home
    return getattr(getattr(scene, section), key)


def check_sweep(tree: Tree, kinds: Kinds) -> Sweep | None:
    """Return the sweep that the tree describes, or None if it has faults, which are
    added to the tree."""
    section = tree.value.pop("sweep")
    name = tree.value.get("scene")
    kind = kinds.get(name) if isinstance(name, str) else None
    given: dict[Keys, Any] = {("sweep",): section}
    if isinstance(section, list) and section:
        given = {("sweep", str(k)): block for k, block in enumerate(section)}
    blocks = []
    for path, block in given.items():
        if not (isinstance(block, dict) and block):
            entry = tree.entries[path]
            tree.fault(
                entry.value,
                ("sweep",),
                f"must be lines of key: values, not {entry.shown}",
            )
        elif kind:
            blocks.append(_axes(kind, block, path, tree))
    if kind and not tree.faults:
        return _combine(blocks, tree, kinds)
    check(tree, kinds)
    return None


def _axes(
    kind: type[DiskScene], block: dict[str, Any], prefix: Keys, tree: Tree
) -> dict[str, Axis]:
    axes = {}
    taken: dict[Keys, str] = {}
    for name, spec in block.items():
        path = (*prefix, name)
        mark = tree.entries[path].key
        home = _home(kind, name)
        if home is None:
            names = [key for key in kind.key_names() if _home(kind, key)]
            word = name.split(".")[-1]
            hint = ""
            if not tree.is_full:
                hint = did_you_mean(resolve_synonym(word), names)
            tree.fault(
                mark,
                path,
                f"no key of scene: {tree.value['scene']} that can be swept{hint}",
            )
            continue
        section, key = home
        given = tree.entries.get(home)
        is_override = mark.rank > 0
        if given and is_override and given.key.rank == 0:
            # An option replaces what the file says, as for single values.
            tree.remove(section, key)
        if home in tree.entries or home in taken:
            other = taken.get(home, "the scene")
            tree.fault(
                mark,
                path,
                f"{'.'.join(home)} is also given by {other}: leave one of the two out",
            )
        taken[home] = name
        whole = kind.sections()[section].schema()[key].kind is int
        axes[name] = Axis(home, _values(spec, path, whole, tree))
    return axes


def _values(
    spec: Any, path: Keys, whole: bool, tree: Tree
) -> list[tuple[Value, Entry]]:
    entry = tree.entries[path]
    if isinstance(spec, list) and spec:
        return [(value, tree.entries[path + (str(k),)]) for k, value in enumerate(spec)]

    import numpy as np  # slow to load, and not needed for a single scene

    try:
        ((form, given),) = spec.items()
        low, high, count = (0, given - 1, given) if form == "range" else given
        if not 0 < count <= MAX_SCENES:
            raise ValueError
        spread: Any = {"range": np.linspace, "lin": np.linspace, "geom": np.geomspace}[
            form
        ]
        # Rounded to twelve digits, because the last bits of a power depend on the
        # machine.
        numbers = [
            round(one) if whole else float(f"{one:.12g}")
            for one in spread(low, high, count).tolist()
        ]
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError):
        shown = printable(str(spec)) if spec else entry.shown
        tree.fault(entry.value, path, f"must be {FORMS}, not {shown}")
        return []
    return [(one, entry._replace(key=entry.value, shown=f"{one:g}")) for one in numbers]


def _combine(blocks: list[dict[str, Axis]], tree: Tree, kinds: Kinds) -> Sweep | None:
    total = 0
    for block in blocks:
        total += prod(len(axis.values) for axis in block.values())
    if total > MAX_SCENES:
        tree.fault(
            tree.entries[("sweep",)].key,
            ("sweep",),
            f"{total} combinations: at most {MAX_SCENES}",
        )
        return None
    homes: dict[str, Home] = {}
    checked_blocks = []
    scenes: list[DiskScene] = []
    for block in blocks:
        of_block = []
        for entries in itertools.product(*(axis.values for axis in block.values())):
            if tree.is_full:
                break
            combination = dict(zip(block, entries, strict=True))
            terms = [f"{name}: {value}" for name, (value, _) in combination.items()]
            combined = _with(tree, zip(block.values(), entries, strict=True))
            scene = check(combined, kinds, where=f" (at {', '.join(terms)})")
            tree.faults.extend(combined.faults)
            if scene is not None:
                of_block.append(scene)
        values = {}
        for name, (home, given) in block.items():
            homes[name] = home
            # as scenes have them, without duplicates
            values[name] = tuple(
                dict.fromkeys(_value(scene, home) for scene in of_block)
            )
            if of_block and home in of_block[0].unused():
                what = "has no effect with lattice.file: leave it out"
                _, first = given[0]
                tree.fault(first.key, ("sweep", name), what)
        checked_blocks.append(values)
        scenes += of_block
    if tree.faults:
        return None
    return Sweep(homes, tuple(checked_blocks), tuple(dict.fromkeys(scenes)))


def _with(tree: Tree, chosen: Iterable[tuple[Axis, tuple[Value, Entry]]]) -> Tree:
    """Return a tree with one value of each axis."""
    scene = Tree({**tree.value}, {**tree.entries}, folder=tree.folder)
    for axis, (one, entry) in chosen:
        section, key = axis.home
        scene.entries.setdefault((section,), entry)
        present = scene.value.get(section, {})
        if isinstance(present, dict):
            scene.value[section] = {**present, key: one}
            scene.entries[axis.home] = entry
    return scene
