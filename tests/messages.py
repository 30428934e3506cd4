"""Print all texts of the program in one list, to be read as a whole: `python -m
tests.messages [FOLDER ...]`.

A text is a string of at least four words, except docstrings; {…} stands for inserted
values.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "taichi_disk"
WORDS = 4


def texts(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield (line, text), without strings that are statements, such as docstrings."""
    for child in ast.iter_child_nodes(tree):
        if isinstance(child, ast.JoinedStr):
            parts = [
                part.value if isinstance(part, ast.Constant) else "{…}"
                for part in child.values
            ]
            yield child.lineno, "".join(map(str, parts))
            yield from texts(
                ast.Module(
                    [
                        part
                        for part in child.values
                        if isinstance(part, ast.FormattedValue)
                    ],
                    [],
                )
            )
        elif isinstance(child, ast.Constant) and isinstance(child.value, str):
            yield child.lineno, child.value
        elif not (
            isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)
        ):
            yield from texts(child)


def main(folders: list[str]) -> None:
    for path in sorted(
        path for folder in folders or [""] for path in (PACKAGE / folder).rglob("*.py")
    ):
        for line, text in texts(ast.parse(path.read_text(encoding="utf-8"))):
            if len(text.split()) >= WORDS:
                print(f"{path.relative_to(PACKAGE)}:{line}: {text}")


if __name__ == "__main__":
    main(sys.argv[1:])
