"""Options and fixtures that all tests share."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--validate", action="store_true", help="also run the long checks")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip the long checks unless they are asked for.

    The folder that most of them are in runs first: where several processes share the tests, short ones are left for
    the end.
    """
    skip = pytest.mark.skip(reason="a long check: add --validate")
    for item in items:
        if "validate" in item.keywords and not config.getoption("--validate"):
            item.add_marker(skip)
    items.sort(key=lambda item: item.path.parent.name != "validation")


def pytest_make_parametrize_id(val, argname):
    return val.name if argname == "integrator" else None


@pytest.fixture
def kernels():
    """The simulations that this process has compiled, a KernelCache: compiling takes most of the tests' time.

    A simulation from here is another test's as soon as one with the same laws and integrator is asked for.
    """
    from taichi_disk import runtime
    from taichi_disk.api import shared_kernels

    runtime.start()
    return shared_kernels()
