"""Print all texts of the program in one list, to be read as a whole: `python -m
tests.messages [FOLDER ...]`.

A text is a string of at least four words, except docstrings; {…} stands for inserted
values.
"""

import ast
import sys
from itertools import chain
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "taichi_disk"
WORDS = 4


def texts(tree):
    """Yield (line, text), without strings that are statements, such as docstrings."""
    parts = set()
    for node in ast.walk(tree):  # parts come after their whole
        if isinstance(node, ast.Expr):
            parts.add(node.value)
        elif isinstance(node, ast.JoinedStr):
            parts.update(node.values)
            pieces = [getattr(part, "value", "") for part in node.values]
            words = [one if isinstance(one, str) else "{…}" for one in pieces]
            yield node.lineno, "".join(words)
        elif isinstance(node, ast.Constant) and node not in parts:
            yield node.lineno, str(node.value)


def main(folders):
    paths = [*chain.from_iterable((PACKAGE / one).rglob("*.py") for one in folders)]
    for path in sorted(paths):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for line, text in sorted(texts(tree)):
            if len(text.split()) >= WORDS:
                print(f"{path.relative_to(PACKAGE)}:{line}: {text}")


if __name__ == "__main__":
    main(sys.argv[1:] or [""])
