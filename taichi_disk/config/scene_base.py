"""A scene as a value: sections that agree with each other, written out or changed. Each kind is a subclass."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, cast

from taichi_disk.config.checks import check, either
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
from taichi_disk.config.yaml_tree import tree_of
from taichi_disk.errors import InputError

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
        return []

    def unused(self) -> Collection[tuple[str, str]]:
        """(section, key) that change nothing beside `lattice.file`, and so cannot be swept."""
        return ()

    def with_(self, changes: Mapping[str, Any] | None = None, /, **keys: Any) -> Self:
        """The scene with some keys changed: `scene.with_(eta_star=30)`, `scene.with_({"wall.a": 3000})`.

        A key's own name is enough where only one section has it; a section's name takes a mapping of some of its keys.
        Raises InputError with every fault at once.
        """
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


def time_conflicts(time: TimeSection, damping: list[str]) -> Conflicts:
    """Those of the section `time`; `damping` are the keys, with values, that make forces depend on velocity."""
    conflicts = []
    if time.tolerance != "none" and time.dt != "auto":
        conflicts.append(("time.tolerance", f"finds the step itself: write time.dt: auto, not {time.dt:g}"))
    if time.integrator == "vefrl" and damping:
        text = f"vefrl cannot take forces that depend on velocity ({damping[0]}): write auto, or velocity_verlet"
        conflicts.append(("time.integrator", text))
    return conflicts


def dashpots(material: MaterialSection) -> list[str]:
    """The key, with its value, that makes the springs' forces depend on velocity; empty where none does."""
    return [f"material.eta_star = {material.eta_star:g}"] if material.eta_star else []


def gap_conflicts(wall: WallSection | ElasticWallSection, impact: ImpactSection) -> Conflicts:
    """A start within the wall's reach: the disk would be shot away by potential energy to spare, e > 1."""
    least = wall.height_of(1e-3 * 0.5 * impact.velocity**2)  # M = 1
    if impact.gap == "auto" or impact.gap >= least:
        return []
    what = f"at {impact.gap:g} R the wall's potential exceeds 1e-3 of the kinetic energy"
    return [("impact.gap", f"{what}: start at {rounded_up(least)} R or farther, or write auto")]


def least_threshold(wall: ElasticWallSection, velocity: float) -> float:
    """Distance at which the contact may be cut off: farther away its potential is 1e-5 of v^2/2 or less [R]."""
    return wall.height_of(1e-5 * 0.5 * velocity**2)


def rounded_up(value: float) -> str:
    """Four digits, above the value."""
    return f"{value * 1.001:.4g}"
