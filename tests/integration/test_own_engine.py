"""The user's own Taichi beside a run; and the engine sends nothing over the network."""

import os
import sys
from pathlib import Path

import pytest
from programs import printed_by, python

from taichi_disk.base.engine import environment, ti

ROOT = Path(__file__).parents[2]
SMALL = (
    '{"scene": "exponential_wall", "lattice": {"points": 40}, "video": {"size": 64,'
    ' "seconds": 0.1}}'
)
AFTER = f"""
from taichi_disk import run
from taichi_disk.base.engine import ti

result = run({SMALL}, lattices=1)
before = result.state(1.0)
result.film("one.mp4")
import os
os.environ["TI_ARCH"] = "x64"
ti.init(arch=ti.cpu)
assert (result.state(1.0).positions == before.positions).all()
ti.reset()
result.film("two.mp4")
assert open("one.mp4", "rb").read() == open("two.mp4", "rb").read()
assert os.environ["TI_ARCH"] == "x64"
"""
FORK = f"""
import threading
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from taichi_disk import run

once = partial(run, {SMALL}, lattices=1)
thread = threading.Thread(target=once)
thread.start()
thread.join()
with ProcessPoolExecutor(1, get_context("fork")) as pool:
    print(pool.submit(once).exception(timeout=60))
"""
IN_THREAD = f"""
import threading, taichi as ti
from taichi_disk import run

def once():
    try:
        return print(run({SMALL}, lattices=1).restitution > 0)
    except Exception as error:
        return print(error)

def in_thread():
    thread = threading.Thread(target=once)
    thread.start()
    thread.join()

def own_field():
    x = ti.field(ti.f32, 3)
    x[0] = 1.5
    assert x[0] == 1.5
    return x
"""
OTHER_ARCH = f"""
from taichi_disk import run
from taichi_disk.base.engine import ti

ti.init(arch=ti.vulkan)
run({SMALL}, lattices=1)
"""
RUN = ("-m", "taichi_disk", "run", "exponential_wall", "--no-video", "--lattices=1")
SLEEP = """
import taichi_disk.mechanics.physics, time
from taichi_disk.base.engine import ti
ti.init()
time.sleep(0.3)
"""
HOOK = """
import sys

def heard(event, what):
    is_harmless = event in ("socket.__new__", "socket.gethostname")
    if event.startswith("socket.") and not is_harmless:
        print("SENT", event, what, file=sys.stderr, flush=True)

sys.addaudithook(heard)
"""


@pytest.mark.validate
def test_an_old_result_outlives_the_user_s_own_init_and_reset(tmp_path):
    printed_by("-c", AFTER, cwd=tmp_path)


@pytest.mark.parametrize(
    "starts",
    [
        # the fork has other settings
        ["settings", "f32"] if ti.__version__ == (1, 7, 4) else ["f32"],
        pytest.param(["plain", "exact", "defaults", "f32"], marks=pytest.mark.validate),
    ],
)
def test_the_user_s_own_kernels_and_runs_are_right_beside_each_other(starts):
    printed = printed_by("-m", "tests.integration.beside", *starts, cwd=ROOT)
    assert printed.endswith("right\n")


@pytest.mark.validate
@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        # the first run in a thread, and then fields of the main one
        ("in_thread(); x = own_field(); once(); in_thread(); own_field(); x[0]", ""),
        ("ti.init(arch=ti.cpu); in_thread(); once()", "in the thread that has called"),
        ("once(); x = own_field(); in_thread(); x[0]; once()", "in the main thread"),
        ("once(); x = ti.field(ti.f32, 3); in_thread(); x[0]", "in the main thread"),
    ],
)
def test_fields_of_a_thread_and_a_run_in_another_say_which(tmp_path, steps, expected):
    printed = printed_by("-c", IN_THREAD + steps, cwd=tmp_path)
    refusals = [line for line in printed.splitlines() if "compute in" in line]
    assert [expected in line for line in refusals] == [True] * bool(expected)


@pytest.mark.validate
def test_another_processor_is_refused_with_the_line_to_write(tmp_path):
    done = python("-c", OTHER_ARCH, cwd=tmp_path)
    assert "arch=vulkan, and a run needs the CPU: write ti.init(arch=" in done.stderr


@pytest.mark.validate
@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")
def test_a_process_that_is_forked_after_a_run_in_a_thread_says_what_to_do(tmp_path):
    assert 'with the method "spawn"' in printed_by("-c", FORK, cwd=tmp_path)


@pytest.mark.validate
def test_an_architecture_from_the_environment_changes_nothing(tmp_path):
    environment = os.environ | {"TI_ARCH": "vulkan"}
    printed = printed_by(*RUN, "--set=lattice.points=20", cwd=tmp_path, env=environment)
    assert "restitution" in printed


@pytest.mark.validate
@pytest.mark.parametrize("way", [(*RUN, "--set=lattice.points=20"), ("-c", SLEEP)])
def test_the_engine_sends_nothing_over_the_network(tmp_path, way):
    # In a new home Taichi would look for a newer version.
    (tmp_path / "sitecustomize.py").write_text(HOOK)
    known = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    home = os.environ | {
        "HOME": str(tmp_path),
        "PYTHONPATH": known,
        environment.CACHE: str(environment.cache_folder()),
    }
    ask = "import socket; socket.getaddrinfo('localhost', 1)"
    probe = python("-c", ask, cwd=tmp_path, env=home)
    assert "SENT socket.getaddrinfo" in probe.stderr
    done = python(*way, cwd=tmp_path, env=home)
    assert done.returncode == 0 and "SENT" not in done.stderr, done.stderr
