"""Options and fixtures that all tests share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--validate", action="store_true", help="also run the long physics checks")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--validate"):
        skip = pytest.mark.skip(reason="a long physics check: add --validate")
        for item in items:
            if "validate" in item.keywords:
                item.add_marker(skip)


@pytest.fixture(scope="module")
def taichi() -> Iterator[None]:
    """Taichi started on the CPU, as `run` starts it, for tests that make worlds themselves."""
    from taichi_disk.model import runtime

    runtime.start("cpu")
    yield
