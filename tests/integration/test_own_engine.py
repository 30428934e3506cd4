"""The user's own Taichi, started before or after a run; and the engine sends nothing
over the network."""

import os
import re

import pytest
from programs import printed_by, python

from taichi_disk.engine import environment

SMALL = (
    '{"scene": "exponential_wall", "lattice": {"points": 40}, "video": {"size": 64,'
    ' "seconds": 0.1}}'
)
AFTER = f"""
from taichi_disk import run
from taichi_disk.engine import ti

result = run({SMALL}, lattices=1)
before = result.state(1.0)
result.film("one.mp4")
import os
os.environ["TI_ARCH"] = "x64"
ti.init(arch=ti.cpu, default_fp=ti.f64, fast_math=False)
assert (result.state(1.0).positions == before.positions).all()
ti.reset()
result.film("two.mp4")
assert open("one.mp4", "rb").read() == open("two.mp4", "rb").read()
assert os.environ["TI_ARCH"] == "x64"
"""
BEFORE = f"""
from taichi_disk import run
from taichi_disk.engine import ti
from taichi_disk.errors import InputError

double = {{"default_fp": ti.f64}}
for options in {{}}, double, double | {{"fast_math": False, "arch": ti.vulkan}}:
    ti.init(**options)
    try:
        run({SMALL}, lattices=1)
    except InputError as error:
        print(error)
"""
RUN = ("-m", "taichi_disk", "run", "exponential_wall", "--no-video", "--lattices=1")
SLEEP = """
import taichi_disk.physics, time
from taichi_disk.engine import ti
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
    done = python("-c", AFTER, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("Taichi runs with real_matrix_scalarize=True") == 1


@pytest.mark.validate
def test_an_engine_started_with_other_settings_is_refused_with_the_line_to_write(
    tmp_path,
):
    done = python("-c", BEFORE, cwd=tmp_path)
    messages = re.findall("^Taichi runs with .*$", done.stdout, re.MULTILINE)
    options = ("default_fp=f32", "fast_math=True", "arch=vulkan")
    remedy = (
        "ti.init(arch=ti.cpu, default_fp=ti.f64, fast_math=False,"
        " real_matrix_scalarize=False)"
    )
    assert len(messages) == 3, done.stdout + done.stderr
    for option, message in zip(options, messages, strict=True):
        assert message.startswith(f"Taichi runs with {option},")
        assert remedy in message


@pytest.mark.validate
def test_an_architecture_from_the_environment_changes_nothing(tmp_path):
    environment = os.environ | {"TI_ARCH": "vulkan"}
    printed = printed_by(*RUN, "--set=lattice.points=20", cwd=tmp_path, env=environment)
    assert "restitution" in printed


@pytest.mark.validate
@pytest.mark.parametrize("way", [(*RUN, "--set=lattice.points=20"), ("-c", SLEEP)])
def test_the_engine_sends_nothing_over_the_network(tmp_path, way):
    # A new home has no date of the last version check, so Taichi would check for a
    # newer version.
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
