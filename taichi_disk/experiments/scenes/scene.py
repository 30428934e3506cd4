"""Scenes as values: sections of keys, which can be checked, changed and written. Each
kind of scene is a subclass."""

from __future__ import annotations

import json
import os
import re
from abc import abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import asdict, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, cast

import numpy as np

from taichi_disk.base.errors import InputError, did_you_mean, either, nearest
from taichi_disk.base.files import PROGRAM
from taichi_disk.experiments.config.sections import (
    Frozen,
    LatticeSection,
    MaterialSection,
    Section,
    TimeSection,
    VideoSection,
)
from taichi_disk.experiments.config.tree import QUOTES, Keys, Tree, tree_of
from taichi_disk.experiments.config.words import NO_KEYS, resolve_synonym
from taichi_disk.experiments.scenes.conflicts import Conflicts, time_conflicts
from taichi_disk.mechanics.lattice import (
    Array,
    Lattice,
    Moduli,
    OwnStart,
    bulk_moduli,
    circle_faults,
    own_velocities,
)

if TYPE_CHECKING:
    from typing_extensions import Self

    from taichi_disk.experiments.computation.scenario import Scenario
    from taichi_disk.mechanics.physics import Springs

Home: TypeAlias = tuple[str, str]  # section and key
Value: TypeAlias = bool | int | float | str

# keys without a meaning for an outline
CIRCLE_KEYS = ("rim", "hole", "core_radius", "core_stiffness", "core_density")
MAX_VELOCITY = 100.0  # largest velocity component of a point at the start [c]


class DiskScene(Frozen):
    """Base class of all kinds of scenes. A kind sets `scene` to its name, adds
    sections, and defines `of_body`."""

    title: ClassVar[str] = ""  # description of the kind
    # sections and keys on which `body` depends, besides material.k_a
    lattice_keys: ClassVar[tuple[str, ...]] = ("lattice",)
    # section and key against which a sweep draws curves
    abscissa: ClassVar[Home]
    results: ClassVar[tuple[str, ...]] = ()  # names of the results
    # names of results that only some scenes have
    optional_results: ClassVar[tuple[str, ...]] = ()

    scene: str = ""
    lattice: LatticeSection = LatticeSection()
    material: MaterialSection = MaterialSection()
    time: TimeSection = TimeSection()
    video: VideoSection = VideoSection()

    @classmethod
    def sections(cls) -> dict[str, Section]:
        ordered = sorted(fields(cls), key=lambda one: one.name in ("time", "video"))
        return {
            one.name: cast(Section, one.default)
            for one in ordered
            if one.name != "scene"
        }

    @classmethod
    def key_names(cls) -> list[str]:
        """Return the names of all keys, without their sections."""
        names: list[str] = []
        for section in cls.sections().values():
            names += section.schema()
        return names

    @classmethod
    def homes(cls, key: str) -> list[Home]:
        """Return (section, key) of every key with this name; a dotted name also names
        the section."""
        *home, name = key.split(".")
        return [
            (one, name)
            for one, keys in cls.sections().items()
            if name in keys.schema() and home in ([], [one])
        ]

    def conflicts(self) -> Conflicts:
        """Return conflicts between keys that are valid by themselves; a kind adds its
        own."""
        spec = self.lattice
        material = self.material
        usual = type(self).material.eta_star
        wall = getattr(self, "wall", None)
        found = time_conflicts(self.time, material, wall)
        if material.viscosity != "auto" and material.eta_star != usual:
            text = (
                f"{material.viscosity:g} and material.eta_star = {material.eta_star:g}"
                f" both set the dashpots: add eta_star={usual:g}, and only the"
                " viscosity counts, or viscosity=auto, and only eta_star counts"
            )
            found.append(("material.viscosity", text))
        if "none" not in (spec.file, spec.outline):
            text = "lattice.file has all points: leave one of the two out"
            found.append(("lattice.outline", text))
        if spec.file != "none":  # the file defines the whole lattice
            return found
        if spec.outline != "none":
            text = "is for the circle: leave it out with lattice.outline"
            return found + [
                (f"lattice.{key}", text)
                for key in CIRCLE_KEYS
                if getattr(spec, key) != getattr(LatticeSection, key)
            ]
        faults = circle_faults(spec.points, spec.hole, spec.core_radius)
        found += [(f"lattice.{key}", fault) for key, fault in faults]
        for key in ("core_stiffness", "core_density"):
            if not spec.core_radius and getattr(spec, key) != 1.0:
                text = (
                    "there is no core: write lattice.core_radius, too, or leave this"
                    " out"
                )
                found.append((f"lattice.{key}", text))
        return found

    def unused(self) -> Collection[Home]:
        """Return (section, key) of the keys that have no effect with `lattice.file` and
        cannot be swept."""
        if self.lattice.file == "none":
            return []
        return [
            ("lattice", key)
            for key in self.lattice.schema()
            if key not in ("file", "velocities")
        ]

    def with_(self, changes: Mapping[str, Any] | None = None, /, **keys: Any) -> Self:
        """Return the scene with some keys changed: `scene.with_(eta_star=30)`,
        `scene.with_({"wall.a": 3000})`.

        A key needs no section if its name is unique; a section takes a mapping of its
        keys.
        Raises InputError with all faults.
        """
        data = asdict(self)
        setters = dict[str, str]()  # which name has set each dotted key
        for name, value in [*(changes or {}).items(), *keys.items()]:
            section, key = self._home(name)
            values = value
            if key:
                values = {key: value}
            old = data.get(section)
            if not (isinstance(old, dict) and isinstance(values, Mapping)):
                data[name] = value  # a fault, which `check` reports
                continue
            for one in values:
                path = f"{section}.{one}"
                if path in setters:
                    raise InputError(
                        f"{setters[path]} and {name} both set {path}: leave one of the"
                        " two out"
                    )
                setters[path] = name
            old |= values
        tree = tree_of(data)
        found = check(tree, {self.scene: type(self)})
        tree.refuse()
        return cast("Self", found)

    def _home(self, name: str) -> Home:
        """Return (section, key) that `name` means; key is "" for a whole section."""
        homes = self.homes(name)
        if len(homes) > 1:
            raise InputError(
                f"{name}: write {either('.'.join(home) for home in homes)}"
            )
        if homes:
            return homes[0]
        section, _, key = name.partition(".")
        return section, key

    def to_yaml(self, leave_out: Collection[str] = ()) -> str:
        """Return the scene as YAML with units, without the dotted keys `leave_out`;
        reading it gives an equal scene."""
        lines = [f"scene: {self.scene}"]
        for name, section in self.sections().items():
            lines.append(f"{name}:")
            for one, key in section.schema().items():
                if f"{name}.{one}" in leave_out:
                    continue
                entry = f"  {one}: {yaml_scalar(getattr(getattr(self, name), one))}"
                meaning = key.meaning
                if key.unit:
                    meaning = f"[{key.unit}] {meaning}"
                lines.append(f"{entry:<32} # {meaning}")
        return "\n".join(lines) + "\n"

    # ---- the computation

    def check_wall(self, points: int) -> None:
        """Raise InputError if no wall can be built for a disk of `points` points."""

    @property
    def reset_interval(self) -> float:
        """Time between two resets of the wall's boundary [R/c]; 0: it is not reset."""
        return 0.0

    def body(self) -> Lattice:
        """Return the unloaded lattice. Raises InputError as `Lattice.disk` does, or if
        the file holds no disk."""
        spec = self.lattice
        if spec.file != "none":
            return Lattice.read(spec.file)
        if spec.outline != "none":
            return Lattice.outline(
                spec.outline, spec.points, spec.seed, spec.min_spacing
            )
        core = spec.core_radius, spec.core_stiffness, spec.core_density
        return Lattice.disk(
            spec.points, spec.seed, spec.rim, spec.min_spacing, spec.hole, *core
        )

    @abstractmethod
    def of_body(self, body: Lattice) -> Scenario:
        """Return the scenario of the unloaded lattice `body`, which may contain its
        wall."""

    def scenario(
        self, lattice: Lattice | None = None, own: OwnStart | None = None
    ) -> Scenario:
        """Return the scenario that computes the scene.

        Args:
            lattice: unloaded disk to use instead of the scene's, or a disk with its
                wall, as `body` returns it.
            own: user-supplied start, whose velocities are used; by default those in the
                file that the scene names.
        """
        body = lattice or self.body()
        if own is None:
            own = OwnStart(None, own_velocities(self.lattice, None))
        if own.velocities is None:
            return replace(self.of_body(body), own=own)
        scenario = self.thrown_with(body, own.velocities).of_body(body)
        velocities = scenario.velocities.copy()
        velocities[: body.disk_points] = own.velocities
        return replace(scenario, velocities=velocities, own=own)

    def thrown_with(self, body: Lattice, velocities: Array) -> Self:
        """Return the scene whose throw has the mean speed and direction of `velocities`
        (N, 2) [c]; a scene without a throw stays as it is.

        Raises InputError if these are no velocities of the disk's points.
        """
        n = body.disk_points
        if velocities.shape != (n, 2):
            raise InputError(
                f"velocities: must have the shape ({n}, 2), not {velocities.shape}"
            )
        if not (np.abs(velocities) <= MAX_VELOCITY).all():
            raise InputError(
                f"velocities: must be numbers from {-MAX_VELOCITY:g} to"
                f" {MAX_VELOCITY:g} c"
            )
        return self

    def moduli(self, points: int) -> Moduli:
        spec = self.lattice
        return bulk_moduli(points, spec.seed, self.material.k_a, spec.min_spacing)

    def springs(self, lattice: Lattice) -> Springs:
        from taichi_disk.mechanics.physics import Springs

        material = self.material
        eta = material.eta(lattice.disk_points)
        return Springs(
            material.k_a, material.k_b, eta, axial=material.dashpot == "axial"
        )

    def changes_with(self, key: str, value: Any) -> dict[str, Any]:
        """Return a dotted key with its new value, and the other keys that must change
        with it, for `with_`."""
        # If the number of points changes, the viscosity of the body is kept.
        name, number = self.material.dashpots
        if (
            key != "lattice.points"
            or name == "viscosity"
            or not number
            or self.lattice.file != "none"
        ):
            return {key: value}
        eta = self.material.eta(self.lattice.points)
        return {
            key: value,
            "material.viscosity": eta,
            "material.eta_star": type(self).material.eta_star,
        }

    def in_time(self) -> Self:
        return self

    def notes(self, points: int) -> list[str]:
        """Return notes for the user, such as how viscous a body of `points` points
        is."""
        name, value = self.material.dashpots
        paper = LatticeSection.points
        if name == "viscosity" or not value or points == paper:
            return []
        return [
            f"material.eta_star = {value:g} is per point: with {points:,} points the"
            f" body is {paper / points:.3g} times as viscous as with the paper's"
            f" {paper}; this changes e; material.viscosity = {value / paper:.3g} keeps"
            " the damping"
        ]

    @property
    def damping(self) -> str:
        name, value = self.material.dashpots
        if name == "eta_star":
            return f"η* = {value:g}"
        return f"η = {value:g} Mc/R"

    def described(self, lattice: Lattice) -> str:
        return f"N = {lattice.disk_points:,}    {lattice.origin}"


def origin(*scenes: DiskScene) -> str:
    """Return the metadata of films, pictures and trajectories: version and scenes, as
    YAML for `load_scene`."""
    return f"# {PROGRAM}\n" + "---\n".join(scene.to_yaml() for scene in scenes)


def yaml_scalar(value: Value) -> str:
    if isinstance(value, str) and re.fullmatch(r"[a-z][a-z0-9]+(_[a-z]+)*", value):
        return value
    # quotes a path, and writes a float with just enough digits
    text = json.dumps(value, ensure_ascii=False)
    if isinstance(value, float) and "." not in text:
        # YAML 1.1 readers such as PyYAML take 1e-05, which has no point, for a string.
        return text.replace("e", ".0e")
    # Escape narrow spaces, which nobody would see, and line separators, which YAML
    # would not keep.
    return "".join(_escaped(character) for character in text)


def _escaped(character: str) -> str:
    if character.isprintable() or ord(character) > 0xFFFF:
        return character
    return f"\\u{ord(character):04x}"


# ---- make a scene of a tree of values, or report all faults

# kinds of scenes by the value of `scene:`
Kinds: TypeAlias = Mapping[str, type[DiskScene]]


def check(tree: Tree, kinds: Kinds, where: str = "") -> DiskScene | None:
    """Return the scene that the tree describes, or None if it has faults, which are
    added to the tree; `where` is added to conflicts between keys."""
    kind = tree.value.get("scene")
    if isinstance(kind, str) and kind in kinds:
        return _read(kind, tree, kinds, where)
    entry = tree.entry(("scene",))
    what = f"missing: write scene: {either(kinds)}"
    if "scene" in tree.value:
        what = f"must be {either(kinds)}, not {entry.shown}{did_you_mean(kind, kinds)}"
    tree.fault(entry.value, ("scene",), what)
    for similar in nearest(kind, kinds):  # check its keys, too
        _read(similar, tree, kinds)
    return None


def _read(kind: str, tree: Tree, kinds: Kinds, where: str = "") -> DiskScene | None:
    sections = kinds[kind].sections()
    values = dict[str, dict[str, Any]]()
    for name, given in tree.value.items():
        entry = tree.entry((name,))
        if name == "scene":
            continue
        if name not in sections:
            tree.fault(entry.key, (name,), _unknown(kind, (name,), kinds, tree))
        elif given is None:
            text = "an empty section: give it a key, or leave it out"
            tree.fault(entry.value, (name,), text)
        elif not isinstance(given, dict):
            text = (
                "must be a section, that is indented lines of key: value, not"
                f" {entry.shown}"
            )
            tree.fault(entry.value, (name,), text)
        else:
            values[name] = {
                key: _value(kind, (name, key), value, tree, kinds)
                for key, value in given.items()
            }
    if tree.faults:
        return None
    changed: Any = {
        name: replace(sections[name], **keys) for name, keys in values.items()
    }
    scene = kinds[kind](**changed)
    for key, text in scene.conflicts():
        path = tuple(key.split("."))
        tree.fault(tree.entry(path).value, path, text + where)
    if tree.faults:
        return None
    return scene


def _value(kind: str, path: Keys, value: Any, tree: Tree, kinds: Kinds) -> Any:
    key = kinds[kind].sections()[path[0]].schema().get(path[1])
    entry = tree.entry(path)
    if key is None:
        tree.fault(entry.key, path, _unknown(kind, path, kinds, tree))
    elif not key.accepts(value):
        hint = did_you_mean(value, key.words)
        if isinstance(value, str) and not value.isprintable():
            hint = f"; {QUOTES}"
        if isinstance(value, list) and len(value) > 1:
            hint = "; several values are a sweep: write them in the section sweep"
        what = f"must be {key.allowed()}, not {entry.shown}{hint} ({key.meaning})"
        tree.fault(entry.value, path, what)
    elif key.is_file and value != "none":
        # On the command line a path is relative to the working directory, in a scene
        # file to the folder of that file.
        folder = tree.folder
        if entry.value.rank:
            folder = ""
        return os.path.realpath(os.path.join(folder, os.path.expanduser(value)))
    elif key.kind in (int, float) and not isinstance(value, str):
        return key.kind(value)
    return value


def _unknown(kind: str, path: Keys, kinds: Kinds, tree: Tree) -> str:
    """Return what is wrong with an unknown section, or an unknown key of a section."""
    if tree.is_full:
        return "unknown key"
    word = path[-1]
    reason = NO_KEYS.get(word.lower())
    if reason:
        return f"no key: {reason}"
    owners = [name for name, one in kinds.items() if _has(one, path)]
    if owners:
        return f"belongs to scene: {either(owners)}, not to scene: {kind}"
    name = resolve_synonym(word)
    sections = kinds[kind].sections()
    if len(path) == 1:
        place = f"scene: {kind}"
        siblings = ["scene", *sections]
        names = [*siblings, *kinds[kind].key_names()]
        name = (nearest(name, names) or [name])[0]
    else:
        place = path[0]
        siblings = [*sections[place].schema()]
    # inside a section, a key of another section only if its name is exactly the same
    homes = [".".join(home) for home in kinds[kind].homes(name)]
    if word in homes:
        return f"no dotted key here: write {word.replace('.', ': {')}: ...}}"
    if homes:
        return f"unknown key; did you mean {either(homes)}?"
    hint = did_you_mean(word, siblings)
    if hint:
        return f"unknown key{hint}"
    return f"unknown key; {place} has {', '.join(siblings)}"


def _has(kind: type[DiskScene], path: Keys) -> bool:
    """Return whether a kind of scene has the section or the key at `path`."""
    section = kind.sections().get(path[0])
    return section is not None and section.schema().keys() >= set(path[1:])
