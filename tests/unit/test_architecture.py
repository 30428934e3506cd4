"""The structure of the code: small files and folders, one thought to a statement."""

import ast
import re
from collections import defaultdict
from functools import cache
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "taichi_disk"
MAX_CONTENT = 3700  # nodes of a file


@cache
def nodes_of_files():
    """Return the nodes of each file's syntax tree, by path. The first is the module."""
    return {
        path: list(ast.walk(ast.parse(path.read_text())))
        for path in PACKAGE.rglob("*.py")
    }


def test_files_and_the_top_folder_stay_small():
    # Content: the nodes of a file's syntax tree, however its lines are broken.
    content = {str(path): len(found) for path, found in nodes_of_files().items()}
    assert {path: n for path, n in content.items() if n > MAX_CONTENT} == {}
    assert len(list(PACKAGE.glob("*.py"))) <= 5


def test_every_package_is_in_an_installation():
    # An editable installation has all packages, even if the list misses some.
    folders = {path.parent.relative_to(ROOT) for path in PACKAGE.rglob("__init__.py")}
    listed = (
        (ROOT / "pyproject.toml").read_text().split("\npackages = [")[1].split("]")[0]
    )
    names = set(re.findall(r"[\w.]+", listed))
    assert names == {".".join(folder.parts) for folder in folders} | {
        "taichi_disk.scene_library"
    }


def test_no_object_is_written_to_by_another_room():
    # A room is a folder of the package. No file writes an attribute that only classes
    # of other rooms have, unless the object is its own or made in the same function.
    rooms_of = defaultdict(set)
    for path, nodes in nodes_of_files().items():
        for name in attributes_of_classes(nodes):
            rooms_of[name].add(room_of(path))
    found = []
    for path, nodes in nodes_of_files().items():
        for function in filter(is_function, nodes):
            for target in written_attributes(function):
                rooms = rooms_of[target.attr]
                if rooms and room_of(path) not in rooms:
                    found.append(f"{path}: {ast.unparse(target)}")
    assert [place for place in found if ": sys." not in place] == []


def room_of(path):
    return path.parent.relative_to(PACKAGE)


def is_function(node):
    """Whether `node` is a function and no kernel, whose fields are memory."""
    if not isinstance(node, ast.FunctionDef):
        return False
    decorators = {ast.unparse(each) for each in node.decorator_list}
    return not decorators & {"ti.func", "ti.kernel"}


def is_target(node):
    return isinstance(getattr(node, "ctx", None), ast.Store | ast.Del)


def attributes_of_classes(nodes):
    """Yield the names of the attributes that classes declare or assign to `self`."""
    for node in nodes:
        if isinstance(node, ast.Attribute) and is_target(node):
            if ast.unparse(node.value) == "self":
                yield node.attr
        if isinstance(node, ast.ClassDef):
            for statement in node.body:
                if isinstance(statement, ast.AnnAssign | ast.Assign):
                    parts = filter(is_target, ast.walk(statement))
                    yield from (one.id for one in parts if isinstance(one, ast.Name))


def written_attributes(function):
    """Yield the attributes that `function` writes of objects not made in it."""
    nodes = list(ast.walk(function))
    made = set()
    for node in nodes:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
            made.update(map(ast.unparse, node.targets))
    for target in filter(is_target, nodes):
        while isinstance(target, ast.Subscript):
            target = target.value
        if isinstance(target, ast.Attribute):
            owner = ast.unparse(target.value)
            if owner not in ("self", "cls") and owner.split(".")[0] not in made:
                yield target


# ---- one thought to a statement


COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)


def joins_unlike_values(node):
    """Whether `node` gives several names a value each, as in `a, b = x, y`."""
    if not isinstance(node, ast.Assign):
        return False
    return isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple)


def multiplies_by_a_condition(node):
    """Whether `node` multiplies a text or a list by no number: `"s" * (count > 1)`."""
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult)):
        return False
    is_text = isinstance(getattr(node.left, "value", None), str)
    is_text = is_text or isinstance(node.left, ast.JoinedStr | ast.List)
    return is_text and not isinstance(node.right, ast.Constant)


def has_several_loops(node):
    if not isinstance(node, COMPREHENSIONS):
        return False
    inside = [child for child in ast.walk(node) if isinstance(child, COMPREHENSIONS)]
    return len(node.generators) > 1 or len(inside) > 1


HABITS = {
    "tuple assignments": joins_unlike_values,
    "conditional expressions": lambda node: isinstance(node, ast.IfExp),
    "walruses": lambda node: isinstance(node, ast.NamedExpr),
    "nested comprehensions": has_several_loops,
    "products with a condition": multiplies_by_a_condition,
}
# numbers in the whole package: what is reached, so that it does not grow again
MOST = {
    "tuple assignments": 0,
    "conditional expressions": 72,
    "walruses": 1,
    "nested comprehensions": 2,
    "products with a condition": 0,
}


def test_statements_hold_one_thought():
    nodes = list(chain.from_iterable(nodes_of_files().values()))
    found = {name: sum(map(is_one, nodes)) for name, is_one in HABITS.items()}
    assert {name: n for name, n in found.items() if n > MOST[name]} == {}
