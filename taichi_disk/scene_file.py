"""Scene files: from YAML to a checked `Scene`, or to one message with every fault and its place."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from taichi_disk.errors import InputError
from taichi_disk.scene import Scene
from taichi_disk.scene_faults import check
from taichi_disk.sweep_axes import Sweep, check_sweep
from taichi_disk.yaml_tree import Entry, Fault, Place, Tree, parse

MAX_BYTES = 100_000  # a scene is a few kB; PyYAML would chew on a megabyte for seconds


def load_scene(source: str | Path, overrides: Sequence[str] = ()) -> Scene:
    """Read a scene file and check it.

    source: path of a YAML file, or the bare name of a shipped scene (exponential_wall).
    overrides: "section.key=value" each, the value written as in YAML; the last of several wins.

    Raises InputError with every fault at once, each as file:line:column: key: what is wrong.
    """
    tree = _read_tree(source, overrides)
    if "sweep" in tree.value:
        what = "this scene has a sweep: compute it with `taichi-disk sweep`, or leave this section out"
        _refuse([Fault(tree.entries[("sweep",)].key, "sweep", what)])
    found = check(tree)
    if isinstance(found, list) or tree.faults:
        _refuse(_all_faults(tree, found))
    return found


def load_sweep(source: str | Path, overrides: Sequence[str] = ()) -> Sweep:
    """Read a scene file with a `sweep:` section and check every scene of it; else as `load_scene`."""
    tree = _read_tree(source, overrides)
    if "sweep" not in tree.value:
        what = "there is no sweep: section: compute a single scene with `taichi-disk run`, or add one, for example "
        _refuse([Fault(tree.entries[()].value, "", what + "`sweep: {seed: {range: 8}}`")])
    found = check_sweep(tree)
    if isinstance(found, list) or tree.faults:
        _refuse(_all_faults(tree, found))
    return found


def load_any(source: str | Path, overrides: Sequence[str] = ()) -> Scene | Sweep:
    """`load_sweep` where the file has a `sweep:` section, else `load_scene`."""
    tree = _read_tree(source, overrides)
    return load_sweep(source, overrides) if "sweep" in tree.value else load_scene(source, overrides)


def shipped_scenes() -> dict[str, Path]:
    """The scenes that come with the package, by bare name."""
    package = Path(__file__).parent
    # In an installed package the files lie beside this one; in a source checkout, at the top of the tree.
    folders = (package / "scene_library", package.parent / "scenes")
    return {path.stem: path for folder in reversed(folders) for path in sorted(folder.glob("*.yaml"))}


def _read_tree(source: str | Path, overrides: Sequence[str]) -> Tree:
    label, text = _read(source)
    tree = parse(text, lambda line, column: Place(0, line, column, label))
    if not isinstance(tree.value, dict):
        _refuse(tree.faults or [_not_a_scene(tree, label)])
    # Where a key that nobody wrote is at fault, there is no line to name.
    tree.entries[()] = Entry(Place(0, 0, 0, label), Place(0, 0, 0, label), "a mapping")
    for rank, override in enumerate(overrides, start=1):
        _override(tree, override, rank)
    return tree


def _all_faults(tree: Tree, found: Scene | Sweep | list[Fault]) -> list[Fault]:
    """Those of reading and those of checking, but for values that could not even be read."""
    unreadable = {(fault.place, fault.key) for fault in tree.faults}
    unfit = found if isinstance(found, list) else []
    return tree.faults + [fault for fault in unfit if (fault.place, fault.key) not in unreadable]


def _refuse(faults: list[Fault]) -> NoReturn:
    lines = [str(fault) for fault in sorted(dict.fromkeys(faults))]
    head = [] if len(lines) == 1 else [f"{len(lines)} faults in the scene:"]
    raise InputError("\n  ".join(head + lines))


def _not_a_scene(tree: Tree, label: str) -> Fault:
    if tree.value is None:
        what = "holds no keys: a scene needs at least the line `scene: exponential_wall`"
        return Fault(Place(0, 0, 0, label), "", what)
    entry = tree.entries[()]
    what = f"a scene is a list of lines `key: value` (mind the space after the colon), not {entry.shown}"
    return Fault(entry.value, "", what)


def _read(source: str | Path) -> tuple[str, str]:
    """(name for messages, text) of a scene file."""
    path = Path(source)
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        shipped = shipped_scenes()
        if str(source) in shipped:
            return _read(shipped[str(source)])
        raise InputError(_cannot_read(path, error, list(shipped))) from None
    if len(data) > MAX_BYTES:
        raise InputError(f"{path}: larger than {MAX_BYTES} bytes, which no scene is")
    if b"\0" in data:
        raise InputError(f"{path}: a binary file, or text that is not UTF-8; a scene is YAML text in UTF-8")
    try:
        return str(path), data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}:{line}: not UTF-8 text (byte {data[error.start]:#x}); save it as UTF-8") from None


def _cannot_read(path: Path, error: OSError | ValueError, shipped: list[str]) -> str:
    if isinstance(error, IsADirectoryError):
        found = sorted(str(one) for one in path.glob("*.yaml"))
        return f"{path}: a folder, not a scene file" + (f"; it holds {', '.join(found)}" if found else "")
    if not isinstance(error, (FileNotFoundError, NotADirectoryError)):
        return f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}"
    try:
        beside = [one.name for one in path.parent.iterdir() if one.suffix in (".yaml", ".yml")]
    except OSError:
        beside = []
    near = [str(path.with_name(name)) for name in difflib.get_close_matches(path.name, beside)]
    near += difflib.get_close_matches(path.stem, shipped, n=1)
    hint = f"; did you mean {' or '.join(near)}?" if near else "."
    return f"{path}: no such file{hint} The shipped scenes are {', '.join(shipped)}"


def _override(tree: Tree, override: str, rank: int) -> None:
    """Write the value of "section.key=value" into the tree, or add a fault to it."""
    place = Place(rank, 0, 0, f"--set {override}")
    name, equals, text = override.partition("=")
    # The name of an axis may itself be dotted.
    path = tuple(part.strip() for part in name.split(".", 1 if name.strip().startswith("sweep.") else -1))
    if not equals or not all(path):
        tree.faults.append(Fault(place, "", "must be of the form section.key=value"))
        return
    value = parse(text, lambda line, column: place, path)
    tree.faults += value.faults
    parent = tree.value
    for depth, part in enumerate(path[:-1], start=1):
        parent = parent.setdefault(part, {})
        tree.entries.setdefault(path[:depth], Entry(place, place, "a mapping"))
        if not isinstance(parent, dict):
            tree.faults.append(Fault(place, "", f"{'.'.join(path[:depth])} is not a section"))
            return
    if path[0] != "sweep" and (isinstance(parent.get(path[-1]), dict) or isinstance(value.value, dict)):
        tree.faults.append(Fault(place, "", "a section cannot be set as a whole: set its keys one by one"))
        return
    parent[path[-1]] = value.value
    tree.entries[path] = Entry(place, place, "nothing")
    tree.entries.update(value.entries)
