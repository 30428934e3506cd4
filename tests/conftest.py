"""Options, tiers and fixtures that all tests share."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import pytest

TIERS = ("unit", "physics", "integration", "validation", "benchmarks")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--validate", action="store_true", help="also run the long checks")


def pytest_configure(config: pytest.Config) -> None:
    for tier in TIERS:
        config.addinivalue_line("markers", f"{tier}: a test in tests/{tier}")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark each test with its tier, the folder it lies in; skip the long checks unless they are asked for.

    The tier of long checks runs first: where several processes share the tests, short ones are left for the end.
    """
    skip = pytest.mark.skip(reason="a long check: add --validate")
    for item in items:
        tier = item.path.relative_to(Path(__file__).parent).parts[0]
        if tier in TIERS:
            item.add_marker(tier)
        if "validate" in item.keywords and not config.getoption("--validate"):
            item.add_marker(skip)
    items.sort(key=lambda item: "validation" not in item.keywords)


def pytest_make_parametrize_id(val, argname):
    return val.name if argname == "integrator" else None


@pytest.fixture
def kernels():
    """The simulations that this process has compiled, a KernelCache: compiling takes most of the tests' time.

    A simulation from here is another test's as soon as one with the same laws and integrator is asked for.
    """
    import taichi as ti

    from taichi_disk import runtime

    runtime.start()
    return _kernels_of(ti.lang.impl.get_runtime().prog)


@lru_cache(maxsize=1)
def _kernels_of(program):
    """One cache for each start of Taichi: where a test has started it anew, all fields are gone."""
    from taichi_disk.simulation.simulation import KernelCache

    return KernelCache(size=64)
