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
SANDBOX = """test_controls test_hostile_visitors test_messages test_mouse_spring
    test_page test_page_look test_pages test_sandbox test_session"""
# unit tests that compute
COMPUTING = """test_diagnostics test_driver test_error_estimate test_model test_moments
    test_own_start test_plot test_step_control test_study"""
LAST = {"test_api": "a4", "test_sweep": "b2"}  # their threads let Taichi start anew


def pytest_addoption(parser):
    parser.addoption("--validate", action="store_true", help="also run the long checks")
    parser.addoption(
        "--record", action="store_true", help="write tests/looks anew, see shown.py"
    )


def pytest_collection_modifyitems(config, items):
    """Skip the long checks unless they are requested, and order all tests.

    Two processes share the tests: each begins with its half, and takes from the end of
    the other half what is left there. Taichi finds a compiled kernel again only if the
    same programs were made before it in its process, as its fields are numbered. So the
    tests that compute come first in each half, and what is taken computes nothing.
    """
    skip = pytest.mark.skip(reason="a long check: add --validate")
    for item in items:
        if "validate" in item.keywords and not config.getoption("--validate"):
            item.add_marker(skip)
    gc.freeze()
    gc.enable()
    gc.set_threshold(100_000, 20, 50)  # to look for garbage took 4 % of the time
    items.sort(key=part_of)
    first, second, others = (
        [item for item in items if part_of(item).startswith(half)] for half in "abc"
    )
    room = max(0, len(items) // 2 - len(first))
    items[:] = [*first, *others[:room], *second, *others[room:]]


def part_of(item):
    """Return the part of all tests to which `item` belongs; each begins with a letter.

    a: the first half, with the long checks and then all tests of the sandbox, whose
    simulations one process compiles; b: the second half; c: tests without simulations.
    """
    folder = item.path.parent.name
    name = item.path.stem
    if folder in ("validation", "benchmarks"):
        return "a1"
    if name in SANDBOX.split():
        return "a2"
    if name in LAST:
        return LAST[name]
    if folder == "integration" and name < "test_s":  # half of the time
        return "a3"
    if folder in ("integration", "physics") or name in COMPUTING.split():
        return "b1"
    return "c"


def pytest_sessionfinish():
    """Let Taichi save its kernels, so that the next session finds them compiled."""
    from taichi_disk.base import engine

    module = engine.loaded()
    if module:
        module.reset()


def pytest_make_parametrize_id(val, argname):
    return val.name if argname == "integrator" else None


@pytest.fixture(autouse=True)
def computes_only_if_listed(request, monkeypatch):
    """Let a unit test make no program of Taichi if its file is not in `COMPUTING`."""
    simulation = sys.modules.get("taichi_disk.mechanics.simulation.simulation")
    if simulation and part_of(request.node) == "c":
        text = "it computes: add its file to COMPUTING of tests/conftest.py"
        monkeypatch.setattr(simulation, "Program", lambda _: pytest.fail(text))


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
