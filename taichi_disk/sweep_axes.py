"""The `sweep:` section: which keys of a scene take which values, checked like every other value.

    sweep: {eta_star: [0, 10, 100], velocity: {geom: [3e-3, 5e-2, 12]}, seed: {range: 8}}

Every combination is one scene. A list of such sections is swept one after the other.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, TypeAlias

from taichi_disk.scene import SCENES, Scene, yaml_scalar
from taichi_disk.scene_faults import check, did_you_mean, sections
from taichi_disk.yaml_tree import Entry, Fault, Path, Tree

Value: TypeAlias = bool | int | float | str
MAX_POINTS = 100_000
FORMS = "a list of values, {lin: [from, to, count]}, {geom: [from, to, count]} or {range: count}"


@dataclass(frozen=True)
class SweepPoint:
    """One scene of a sweep: the values of the swept keys by their names in the file, and the whole scene."""

    parameters: dict[str, Value]
    scene: Scene


@dataclass(frozen=True)
class Sweep:
    """Scenes that differ in some keys.

    Attributes:
        base: the scene at the first value of every axis.
        blocks: one mapping of axis names to values for each section; each is a product.
        points: every scene once, the last axis of a block varying fastest.
    """

    base: Scene
    blocks: tuple[dict[str, tuple[Value, ...]], ...]
    points: tuple[SweepPoint, ...]

    @property
    def axes(self) -> list[str]:
        """Names of all axes, in the order of the file."""
        return list(dict.fromkeys(name for block in self.blocks for name in block))

    def to_yaml(self) -> str:
        """The whole sweep, every default filled in; reading it gives an equal sweep."""
        swept = {".".join(target_of(self.base.scene, name) or ()) for name in self.axes}
        lines = ["sweep:"]
        for block in self.blocks:
            for k, (name, values) in enumerate(block.items()):
                lead = "  - " if k == 0 else "    "
                lines.append(f"{lead}{name}: [{', '.join(yaml_scalar(value) for value in values)}]")
        return self.base.to_yaml(leave_out=swept) + "\n".join(lines) + "\n"


def target_of(kind: str, name: str) -> tuple[str, str] | None:
    """(section, key) of the axis `name` in a scene of that kind: dotted, or the first section's key of that name."""
    there = {section: model.model_fields for section, model in sections(kind).items() if section != "video"}
    section, dot, key = name.partition(".")
    if dot:
        return (section, key) if key in there.get(section, ()) else None
    return next(((one, name) for one, keys in there.items() if name in keys), None)


def value_of(scene: Scene, name: str) -> Value:
    """What `scene` has at the axis `name`. Raises KeyError where it has no such key."""
    target = target_of(scene.scene, name)
    if target is None:
        raise KeyError(name)
    value: Value = getattr(getattr(scene, target[0]), target[1])
    return value


def check_sweep(tree: Tree) -> Sweep | list[Fault]:
    """The sweep that the tree describes, or every fault of it."""
    section = tree.value.pop("sweep")
    kind = tree.value.get("scene")
    if not (isinstance(kind, str) and kind in SCENES):
        found = check(tree)
        return found if isinstance(found, list) else []
    prefixes: list[Path] = [("sweep",)]
    if isinstance(section, list):
        prefixes = [("sweep", str(k)) for k in range(len(section))]
    faults: list[Fault] = []
    blocks: list[dict[str, list[tuple[Value, Entry]]]] = []
    for prefix, block in zip(prefixes, section if isinstance(section, list) else [section], strict=True):
        if isinstance(block, dict) and block:
            blocks.append(_axes(kind, block, prefix, tree, faults))
        else:
            entry = tree.entries[prefix]
            faults.append(Fault(entry.value, "sweep", f"must be lines of key: values, not {entry.shown}"))
    if faults or not blocks:
        found = check(tree)
        empty = Fault(tree.entries[("sweep",)].value, "sweep", "an empty list: give it a section, or leave it out")
        return [*(faults or [empty]), *(found if isinstance(found, list) else [])]
    return _combine(kind, blocks, tree)


def _axes(
    kind: str, block: dict[str, Any], prefix: Path, tree: Tree, faults: list[Fault]
) -> dict[str, list[tuple[Value, Entry]]]:
    axes: dict[str, list[tuple[Value, Entry]]] = {}
    taken: dict[tuple[str, str], str] = {}
    for name, spec in block.items():
        path = (*prefix, name)
        entry = tree.entries[path]
        target = target_of(kind, name)
        if target is None:
            names = [key for part, one in sections(kind).items() if part != "video" for key in one.model_fields]
            what = f"no key of scene: {kind} that can be swept{did_you_mean(name.split('.')[-1], names)}"
            faults.append(Fault(entry.key, ".".join(path), what))
            continue
        dotted = ".".join(target)
        if target in tree.entries or taken.get(target):
            other = taken.get(target, "the scene")
            what = f"{dotted} is also given by {other}: leave one of the two out"
            faults.append(Fault(entry.key, ".".join(path), what))
        taken[target] = name
        whole = sections(kind)[target[0]].model_fields[target[1]].annotation is int
        axes[name] = _values(spec, path, whole, tree, faults)
    return axes


def _values(spec: Any, path: Path, whole: bool, tree: Tree, faults: list[Fault]) -> list[tuple[Value, Entry]]:
    """The values that `spec` stands for, each with the entry to blame for it."""
    entry = tree.entries[path]
    key = ".".join(path)
    found: list[tuple[Value, Entry]] = []
    if isinstance(spec, list):
        found = [(value, tree.entries[path + (str(k),)]) for k, value in enumerate(spec)]
        if not found:
            faults.append(Fault(entry.value, key, "an empty list: give it values, or leave the axis out"))
    elif isinstance(spec, dict) and len(spec) == 1 and next(iter(spec)) in ("lin", "geom", "range"):
        form, bounds = next(iter(spec.items()))
        place = tree.entries[path + (form,)].value
        try:
            numbers = _range(bounds) if form == "range" else _between(form, bounds, whole)
            found = [(number, Entry(place, place, f"{number:g}")) for number in numbers]
        except ValueError as error:
            faults.append(Fault(place, f"{key}.{form}", str(error)))
    else:
        faults.append(Fault(entry.value, key, f"must be {FORMS}, not {entry.shown}"))
    seen: set[tuple[type, Value]] = set()
    for value, one in found:
        if isinstance(value, (dict, list)):
            faults.append(Fault(one.value, key, f"a value must be a number or a word, not {one.shown}"))
        elif (type(value), value) in seen:
            faults.append(Fault(one.value, key, f"{one.shown} is given twice"))
        else:
            seen.add((type(value), value))
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300


def _range(count: Any) -> list[int]:
    if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= MAX_POINTS:
        raise ValueError(f"must be a whole number from 1 to {MAX_POINTS}: {{range: 3}} is 0, 1, 2")
    return list(range(count))


def _between(form: str, bounds: Any, whole: bool) -> list[int] | list[float]:
    if not (isinstance(bounds, list) and len(bounds) == 3 and all(_is_number(one) for one in bounds)):
        raise ValueError(f"must be three numbers: {{{form}: [from, to, count]}}")
    low, high, count = bounds
    if not isinstance(count, int) or not 2 <= count <= MAX_POINTS:
        raise ValueError(f"the count must be a whole number from 2 to {MAX_POINTS}, not {count}")
    if form == "geom" and not (low > 0 and high > 0):
        raise ValueError("a geometric axis needs bounds above 0")
    parts = [k / (count - 1) for k in range(count)]
    if form == "geom":
        values = [low * (high / low) ** part for part in parts]
    else:
        values = [low + (high - low) * part for part in parts]
    # Twelve digits: the last bits of a power are not the same on every machine, and a table should be.
    return [round(value) for value in values] if whole else [float(f"{value:.12g}") for value in values]


def _combine(kind: str, blocks: list[dict[str, list[tuple[Value, Entry]]]], tree: Tree) -> Sweep | list[Fault]:
    """Check every value of every axis by itself, then every combination."""
    faults: list[Fault] = []
    first: Scene | None = None
    for block in blocks:
        start = {name: values[0] for name, values in block.items()}
        for name, values in block.items():
            for value in values:
                found = check(_with(kind, tree, start | {name: value}))
                if isinstance(found, list):
                    faults += found
                else:
                    first = first or found
    if faults or first is None:
        return faults
    where = tree.entries[("sweep",)].key
    plain = tuple({name: tuple(value for value, _ in values) for name, values in block.items()} for block in blocks)
    total = sum(_size(block) for block in plain)
    if total > MAX_POINTS:
        return [Fault(where, "sweep", f"{total} combinations: at most {MAX_POINTS}")]
    points: dict[str, SweepPoint] = {}
    for block in blocks:
        for chosen in _product(block):
            found = check(_with(kind, tree, chosen))
            if isinstance(found, list):
                given = ", ".join(f"{name}: {value}" for name, (value, _) in chosen.items())
                return [Fault(fault.place, fault.key, f"{fault.what} (at {given})") for fault in found]
            parameters = {name: value_of(found, name) for name in chosen}
            points.setdefault(found.to_yaml(), SweepPoint(parameters, found))
    return Sweep(first, plain, tuple(points.values()))


def _size(block: dict[str, tuple[Value, ...]]) -> int:
    size = 1
    for values in block.values():
        size *= len(values)
    return size


def _product(block: dict[str, list[tuple[Value, Entry]]]) -> Iterator[dict[str, tuple[Value, Entry]]]:
    for chosen in itertools.product(*block.values()):
        yield dict(zip(block, chosen, strict=True))


def _with(kind: str, tree: Tree, chosen: dict[str, tuple[Value, Entry]]) -> Tree:
    """The tree of one scene: `chosen` written where the axes point."""
    scene = Tree(deepcopy(tree.value), dict(tree.entries))
    for name, (value, entry) in chosen.items():
        target = target_of(kind, name)
        assert target is not None
        section = scene.value.setdefault(target[0], {})
        scene.entries.setdefault(target[:1], entry)
        if isinstance(section, dict):
            section[target[1]] = value
            scene.entries[target] = entry
    return scene
