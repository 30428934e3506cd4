"""The structure of the code: small files and folders, and one thought to a statement.
`lint-imports` checks the direction of imports, and that none go in a circle."""

import ast
import re
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
    # Content is the number of nodes of a file's syntax tree: what a reader has to
    # understand, however the lines are broken.
    content = {str(path): len(found) for path, found in nodes_of_files().items()}
    assert {path: n for path, n in content.items() if n > MAX_CONTENT} == {}
    assert len(list(PACKAGE.glob("*.py"))) <= 11


def test_every_package_is_in_an_installation():
    # An editable installation has all packages, even if the list misses some. (The
    # scene files are a package without a folder.)
    folders = {path.parent.relative_to(ROOT) for path in PACKAGE.rglob("__init__.py")}
    listed = (
        (ROOT / "pyproject.toml").read_text().split("\npackages = [")[1].split("]")[0]
    )
    names = set(re.findall(r"[\w.]+", listed))
    assert names == {".".join(folder.parts) for folder in folders} | {
        "taichi_disk.scene_library"
    }


# ---- one thought to a statement


COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)


def joins_unlike_values(node):
    """Whether `node` gives several names a value each, as in `a, b = x, y`."""
    if not isinstance(node, ast.Assign):
        return False
    return isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple)


def multiplies_by_a_condition(node):
    """Whether `node` multiplies a text or a list by something that is no number, as in
    `"s" * (count > 1)`."""
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


def writes_into_another_object(node):
    """Whether `node` sets an attribute of an object that is not its own: an object is
    finished when it is made."""
    if not isinstance(node, ast.Attribute) or not isinstance(node.ctx, ast.Store):
        return False
    return ast.unparse(node.value) not in ("self", "cls")


HABITS = {
    "tuple assignments": joins_unlike_values,
    "conditional expressions": lambda node: isinstance(node, ast.IfExp),
    "walruses": lambda node: isinstance(node, ast.NamedExpr),
    "nested comprehensions": has_several_loops,
    "products with a condition": multiplies_by_a_condition,
    "attributes of other objects": writes_into_another_object,
}
# numbers in the whole package: what is reached, so that it does not grow again
MOST = {
    "tuple assignments": 0,
    "conditional expressions": 72,
    "walruses": 1,
    "nested comprehensions": 2,
    "products with a condition": 0,
    "attributes of other objects": 39,  # of these 12 of PyAV's
}


def test_statements_hold_one_thought():
    nodes = list(chain.from_iterable(nodes_of_files().values()))
    found = {name: sum(map(is_one, nodes)) for name, is_one in HABITS.items()}
    assert {name: n for name, n in found.items() if n > MOST[name]} == {}
