"""A scene as a value: sections that agree with each other, checked, written out or changed. Each kind is a subclass."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection, Mapping
from dataclasses import asdict, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, cast

from taichi_disk.config.sections import (
    ElasticWallSection,
    Frozen,
    ImpactSection,
    LatticeSection,
    MaterialSection,
    Section,
    TimeSection,
    VideoSection,
    WallSection,
)
from taichi_disk.config.tree import Keys, Tree, tree_of
from taichi_disk.config.words import ALIASES, UNITS, number_hint
from taichi_disk.errors import InputError, did_you_mean, either, nearest

if TYPE_CHECKING:
    from typing_extensions import Self

Value: TypeAlias = bool | int | float | str
Conflicts: TypeAlias = list[tuple[str, str]]  # (dotted key, what is wrong with it)


class SceneBase(Frozen):
    """What every kind of scene has. A kind narrows `scene` to its name and adds sections of its own."""

    title: ClassVar[str] = ""  # the kind in words

    scene: str = ""
    lattice: LatticeSection = LatticeSection()
    material: MaterialSection = MaterialSection()
    time: TimeSection = TimeSection()
    video: VideoSection = VideoSection()

    @classmethod
    def sections(cls) -> dict[str, Section]:
        """The sections of this kind of scene at their defaults, by name, in the order in which they are written."""
        ordered = sorted(fields(cls), key=lambda one: one.name in ("time", "video"))
        return {one.name: cast(Section, one.default) for one in ordered if one.name != "scene"}

    @classmethod
    def homes(cls, key: str) -> list[tuple[str, str]]:
        """(section, key) of every key of that name; `key` may be dotted and then names one section's."""
        *home, name = key.split(".")
        return [(one, name) for one, keys in cls.sections().items() if name in keys.schema() and home in ([], [one])]

    def conflicts(self) -> Conflicts:
        """Disagreements between keys that are valid by themselves; a kind adds its own."""
        material, usual = self.material, self.usual_eta_star()
        if material.viscosity == "auto" or material.eta_star == usual:
            return []
        both = f"{material.viscosity:g} and material.eta_star = {material.eta_star:g} both set the dashpots"
        return [("material.viscosity", f"{both}: write auto, or leave material.eta_star at its default, {usual:g}")]

    @classmethod
    def usual_eta_star(cls) -> float:
        """The default of this kind of scene, which may stand beside `material.viscosity`."""
        return cast(MaterialSection, cls.sections()["material"]).eta_star

    def unused(self) -> Collection[tuple[str, str]]:
        """(section, key) that change nothing beside `lattice.file`, and so cannot be swept."""
        return ()

    def with_(self, changes: Mapping[str, Any] | None = None, /, **keys: Any) -> Self:
        """The scene with some keys changed: `scene.with_(eta_star=30)`, `scene.with_({"wall.a": 3000})`.

        A key's own name is enough where only one section has it; a section's name takes a mapping of some of its keys.
        Raises InputError with every fault at once.
        """
        if not isinstance(changes or {}, Mapping) or not all(isinstance(name, str) for name in changes or ()):
            raise InputError(f'with_: takes keys and values, as {{"wall.a": 3000}}, not {changes!r:.60}')
        data, others = asdict(self), dict[str, Any]()
        for name, value in {**(changes or {}), **keys}.items():
            homes = self.homes(name)
            if len(homes) > 1:
                raise InputError(f"{name}: write {either('.'.join(home) for home in homes)}")
            section, key = homes[0] if homes else name.partition(".")[::2]
            if section in self.sections() and (key or isinstance(value, Mapping)):
                data[section] |= {key: value} if key else value
            else:
                others[name] = value
        tree = tree_of(data | others)
        found = check(tree, {self.scene: type(self)})
        tree.refuse()
        return cast("Self", found)

    def to_yaml(self, leave_out: Collection[str] = ()) -> str:
        """The whole scene but the dotted keys `leave_out`, with units; reading it gives an equal scene."""
        lines = [f"scene: {self.scene}"]
        for name, section in self.sections().items():
            lines.append(f"{name}:")
            for one, key in section.schema().items():
                if f"{name}.{one}" not in leave_out:
                    entry = f"  {one}: {yaml_scalar(getattr(getattr(self, name), one))}"
                    lines.append(f"{entry:<32} # {f'[{key.unit}] ' if key.unit else ''}{key.meaning}")
        return "\n".join(lines) + "\n"


def yaml_scalar(value: Value) -> str:
    """YAML text that reads back as the same value, in YAML 1.1 as in 1.2."""
    if isinstance(value, str) and re.fullmatch(r"[a-z][a-z0-9]+(_[a-z]+)*", value):
        return value
    text = json.dumps(value, ensure_ascii=False)  # a path: quoted; a float: the shortest text that reads back bit-equal
    # Without a point, YAML 1.1 readers (PyYAML too) take 1e-05 for a string.
    return text.replace("e", ".0e") if isinstance(value, float) and "." not in text else text


def time_conflicts(time: TimeSection, material: MaterialSection, *others: str, friction: float = 0.0) -> Conflicts:
    """Those of the section `time`; `others` are keys, with values, that make forces depend on velocity, too."""
    conflicts, damping = [], [*dashpots(material), *others, *[f"wall.friction = {friction:g}"] * bool(friction)]
    if time.tolerance != "none" and time.dt != "auto":
        conflicts.append(("time.tolerance", f"finds the step itself: write time.dt: auto, not {time.dt:g}"))
    if time.integrator == "vefrl" and damping:
        text = f"vefrl cannot take forces that depend on velocity ({damping[0]}): write auto, or velocity_verlet"
        conflicts.append(("time.integrator", text))
    if time.integrator == "trapezoidal" and friction:
        text = "trapezoidal has errors of order 1 beside friction: write auto, or velocity_verlet"
        conflicts.append(("time.integrator", text))
    if time.integrator == "trapezoidal" and material.dashpot == "axial" and dashpots(material):
        text = "trapezoidal solves for dashpots whose matrix stays the same, not for axial ones: write auto"
        conflicts.append(("time.integrator", text))
    return conflicts


def dashpots(material: MaterialSection) -> list[str]:
    """The key, with its value, that makes the springs' forces depend on velocity; empty where none does."""
    name, value = material.dashpots
    return [f"material.{name} = {value:g}"] if value else []


def gap_conflicts(wall: WallSection | ElasticWallSection, impact: ImpactSection) -> Conflicts:
    """A start within the wall's reach: the disk would be shot away by potential energy to spare, e > 1."""
    least = wall.height_of(1e-3 * 0.5 * impact.towards**2)  # M = 1
    if impact.gap == "auto" or impact.gap >= least:
        return []
    what = f"at {impact.gap:g} R the wall's potential exceeds 1e-3 of the kinetic energy"
    return [("impact.gap", f"{what}: start at {rounded_up(least)} R or farther, or write auto")]


def least_threshold(wall: ElasticWallSection, velocity: float) -> float:
    """Distance at which the contact may be cut off: farther away its potential is 1e-5 of v^2/2 or less [R].

    `velocity` is that towards the wall.
    """
    return wall.height_of(1e-5 * 0.5 * velocity**2)


def rounded_up(value: float) -> str:
    """Four digits, above the value."""
    return f"{value * 1.001:.4g}"


# ---- from a tree of values to a scene, or every fault in words, with the nearest name

Kinds: TypeAlias = Mapping[str, type[SceneBase]]  # of scenes, by the name that `scene:` takes


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

    def known(name: str) -> int:
        sections = kinds[name].sections()
        paths = [path for path in tree.entries if path and path[0] in sections]
        return sum(set(path[1:2]) <= sections[path[0]].schema().keys() for path in paths)

    # The other keys are checked as those of the kind that was probably meant, else of the one that has most of them.
    _read((nearest(kind, kinds) or [max(kinds, key=known)])[0], tree, kinds)
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


def _value(kind: str, path: Keys, value: Any, tree: Tree, kinds: Kinds) -> Any:
    """`value` as the scene keeps it, or a fault."""
    key, entry = kinds[kind].sections()[path[0]].schema().get(path[1]), tree.entry(path)
    if key is None:
        tree.fault(entry.key, path, _unknown(kind, path, kinds))
    elif key.kind is int and isinstance(value, float) and value.is_integer() and key.accepts(int(value)):
        return int(value)  # 1e3
    elif not key.accepts(value):
        hint = did_you_mean(value, key.words) or number_hint(value, key.unit, path[-1])
        what = f"must be {key.allowed()}, not {entry.shown}{hint} ({key.meaning})"
        tree.fault(entry.value, path, what)
    elif path in (("lattice", "file"), ("lattice", "velocities")) and value != "none":
        # On the command line a name counts from the working directory, in a scene file from the file's folder.
        folder = "" if entry.value.rank else tree.folder
        return os.path.realpath(os.path.join(folder, os.path.expanduser(value)))
    elif key.kind is float and not isinstance(value, str):
        return float(value)
    return value


def _unknown(kind: str, path: Keys, kinds: Kinds) -> str:
    """Why the key at `path` is not one of this kind of scene, and what was probably meant."""
    section, *keys = path
    if path[-1].lower() in UNITS:
        return f"no key: {UNITS[path[-1].lower()]}"
    having = {name: one.sections()[section].schema() for name, one in kinds.items() if section in one.sections()}
    if others := [name for name, known in having.items() if known.keys() >= set(keys)]:
        return f"belongs to scene: {either(others)}, not to scene: {kind}"
    if homes := kinds[kind].homes(
        ALIASES.get(path[-1].lower(), path[-1])
    ):  # another section's key only where it bears exactly this name
        return f"unknown key; did you mean {either('.'.join(home) for home in homes)}?"
    siblings = list(having[kind]) if keys else ["scene", *kinds[kind].sections()]
    listed = f"; {section if keys else f'scene: {kind}'} has {', '.join(siblings)}"
    return f"unknown key{did_you_mean(path[-1], siblings) or listed}"
