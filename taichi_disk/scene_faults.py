"""What is wrong with the values of a scene, in words: what a key must be, and the nearest valid name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel, ValidationError

from taichi_disk.scene import SCENES, Scene
from taichi_disk.yaml_tree import Entry, Fault, Path, Tree


def check(tree: Tree) -> Scene | list[Fault]:
    """The scene that the tree describes, or every fault of it."""
    kind = tree.value.get("scene")
    if isinstance(kind, str) and kind in SCENES:
        return _validate(kind, tree)
    entry = _entry(tree, ("scene",))
    if "scene" not in tree.value:
        what = f"missing: write scene: {_either(SCENES)}"
    else:
        what = f"must be {_either(SCENES)}, not {entry.shown}{did_you_mean(kind, SCENES)}"
    # The other keys are judged as the kind that was probably meant.
    near = _nearest(kind, SCENES)
    rest = [_validate(name, tree) for name in ([near] if near else SCENES)]
    fewest = min((faults for faults in rest if isinstance(faults, list)), key=len, default=[])
    return [Fault(entry.value, "scene", what), *(fault for fault in fewest if fault.key != "scene")]


def _validate(kind: str, tree: Tree) -> Scene | list[Fault]:
    try:
        return SCENES[kind].model_validate(tree.value)
    except ValidationError as error:
        # A union ("auto" or a number) reports each of its branches: one fault for each key is enough.
        faults: dict[tuple[str, ...], Fault] = {}
        for one in error.errors(include_url=False, include_input=False):
            if one["type"] == "conflict":
                for key, what in one["ctx"]["conflicts"]:
                    faults[(key,)] = Fault(_entry(tree, tuple(key.split("."))).value, key, what)
                continue
            path = tuple(str(part) for part in one["loc"][:2])
            entry = _entry(tree, path)
            if one["type"] == "extra_forbidden":
                faults[path] = Fault(entry.key, ".".join(path), _unknown(kind, path))
            else:
                faults[path] = Fault(entry.value, ".".join(path), _wrong(kind, path, tree, entry))
        return list(faults.values())


def _entry(tree: Tree, path: Path) -> Entry:
    """That of the path itself, else of the nearest part of the scene around it that was written."""
    while path not in tree.entries:
        path = path[:-1]
    return tree.entries[path]


def sections(kind: str) -> dict[str, type[BaseModel]]:
    """The sections that a scene of this kind has."""
    types = {name: field.annotation for name, field in SCENES[kind].model_fields.items()}
    return {name: one for name, one in types.items() if isinstance(one, type) and issubclass(one, BaseModel)}


def _wrong(kind: str, path: Path, tree: Tree, entry: Entry) -> str:
    section = sections(kind).get(path[0])
    if section is None:  # `scene` itself, when the keys are judged as another kind
        return ""
    if len(path) == 1:
        if tree.value[path[0]] is None:
            return "an empty section: give it a key, or leave it out"
        return f"must be a section, that is indented lines of key: value, not {entry.shown}"
    key = path[1]
    value = tree.value[path[0]][key]
    spec = section.model_json_schema()["properties"][key]
    hint = did_you_mean(value, spec.get("enum", ()))
    if isinstance(value, str) and entry.shown.startswith("the text") and _is_number(value):
        hint = "; leave out the quotes"
    unit = f" [{spec['unit']}]" if spec["unit"] else ""
    return f"must be {_allowed(spec)}{unit}, not {entry.shown}{hint} ({spec['description']})"


def _allowed(spec: dict[str, Any]) -> str:
    """The values that a JSON schema lets pass, in words."""
    if "anyOf" in spec:
        return " or ".join(_allowed(one) for one in spec["anyOf"])
    if "enum" in spec or "const" in spec:
        return _either(spec.get("enum", [spec.get("const")]))
    if spec["type"] == "boolean":
        return "true or false"
    number = "a whole number" if spec["type"] == "integer" else "a number"
    if spec.get("multipleOf") == 2:
        number = "an even whole number"
    elif "multipleOf" in spec:
        number = f"a multiple of {_short(spec['multipleOf'])}"
    if "exclusiveMinimum" in spec:
        return f"{number} above {_short(spec['exclusiveMinimum'])} and at most {_short(spec['maximum'])}"
    return f"{number} from {_short(spec['minimum'])} to {_short(spec['maximum'])}"


def _short(bound: float) -> str:
    return str(bound) if isinstance(bound, int) else f"{bound:g}".replace("e-0", "e-").replace("e+0", "e")


def _unknown(kind: str, path: Path) -> str:
    """Why the key at `path` is not one of this kind of scene, and what was probably meant."""
    others = [other for other in SCENES if _has(other, path)]
    if others:
        return f"belongs to scene: {_either(others)}, and this is scene: {kind}"
    if path[-1] == "<<":
        return "merge keys are not supported: write the keys out"
    there = sections(kind)
    siblings = ["scene", *there] if len(path) == 1 else list(there[path[0]].model_fields)
    elsewhere: dict[str, list[str]] = {}
    for name, section in there.items():
        for key in section.model_fields:
            elsewhere.setdefault(key, []).append(f"{name}.{key}")
    if path[-1] not in elsewhere and _nearest(path[-1], siblings):
        return f"unknown key{did_you_mean(path[-1], siblings)}"
    if near := _nearest(path[-1], elsewhere):
        return f"unknown key; did you mean {_either(elsewhere[near])}?"
    place = f"in {path[0]}" if len(path) > 1 else f"in scene: {kind}"
    return f"unknown key; {place} there are {', '.join(siblings)}"


def _has(kind: str, path: Path) -> bool:
    section = sections(kind).get(path[0])
    return section is not None and all(key in section.model_fields for key in path[1:])


def _nearest(word: Any, names: Iterable[str]) -> str | None:
    by_lower = {name.lower(): name for name in names}
    near = difflib.get_close_matches(str(word).lower(), by_lower, n=1, cutoff=0.5)
    return by_lower[near[0]] if near else None


def did_you_mean(word: Any, names: Iterable[str]) -> str:
    """The end of a message: the nearest of `names`, or nothing."""
    near = _nearest(word, names) if isinstance(word, str) else None
    return f"; did you mean {near}?" if near else ""


def _either(names: Iterable[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} or {last}" if first else last


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
