"""Options and fixtures of all tests."""

import gc
import os
import signal
import sys
from functools import partial

import pytest

# Else each of the processes that tests start compiles all modules anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# a shell ignores Ctrl-C for commands in the background
signal.signal(signal.SIGINT, signal.default_int_handler)
gc.disable()  # until all tests are found: they and their modules stay to the end
SANDBOX = {
    "test_controls",
    "test_hostile_visitors",
    "test_messages",
    "test_mouse_spring",
    "test_page",
    "test_page_look",
    "test_pages",
    "test_sandbox",
    "test_session",
}


def pytest_addoption(parser):
    parser.addoption("--validate", action="store_true", help="also run the long checks")
    parser.addoption(
        "--record", action="store_true", help="write tests/looks anew, see shown.py"
    )


def pytest_collection_modifyitems(config, items):
    """Skip the long checks unless they are requested.

    Two processes share the tests, and each begins with its half. The folder of long
    checks runs first, so that short tests are left for the end; then the tests that
    share the simulations of the sandbox, so that one process compiles them.
    """
    skip = pytest.mark.skip(reason="a long check: add --validate")
    for item in items:
        if "validate" in item.keywords and not config.getoption("--validate"):
            item.add_marker(skip)
    gc.freeze()
    gc.enable()
    items.sort(
        key=lambda item: (
            item.path.parent.name != "validation",
            item.path.stem not in SANDBOX,
        )
    )


def pytest_sessionfinish():
    """Let Taichi save its kernels, so that the next session finds them compiled."""
    from taichi_disk.base import engine

    module = engine.loaded()
    if module:
        module.reset()


def pytest_make_parametrize_id(val, argname):
    return val.name if argname == "integrator" else None


@pytest.fixture
def kernels():
    """Return the KernelCache of this process: compiling takes most of the time."""
    from taichi_disk.base import runtime
    from taichi_disk.mechanics.simulation.simulation import shared_kernels

    runtime.start()
    return shared_kernels()


@pytest.fixture
def record(request):
    """Return a function that compares lines of text with a recording."""
    from shown import check

    return partial(check, is_recording=request.config.getoption("--record"))


@pytest.fixture
def notices(caplog):
    """What the program tells its user: `notices.messages`."""
    caplog.set_level("INFO", "taichi_disk")
    return caplog


@pytest.fixture
def playlist():
    """Return a list of three small scenes."""
    from taichi_disk.experiments.scenes import load_scene
    from taichi_disk.sandbox.controls import Preset

    throw = ["lattice.points=120", "impact.velocity=0.05"]
    scenes = {
        "exponential_wall": [*throw, "material.eta_star=1"],
        "absorbing_wall": [*throw, "wall.points=160", "wall.threshold=0.11"],
        "compression": throw[:1],
    }
    presets = []
    for name, changes in scenes.items():
        load = partial(load_scene, name, changes)
        presets.append(Preset(name, "Look.", load))
    return presets
