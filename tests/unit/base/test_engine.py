"""The engine: selected in one file, in a suitable environment, patched if necessary."""

import os
import re
import resource
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from programs import printed_by

from taichi_disk.base import engine, runtime
from taichi_disk.base.engine import environment, internals, ti
from taichi_disk.base.errors import TaichiDiskError

ROOT = Path(__file__).parents[3]
INIT = "__init__.py"


KERNEL = """
from taichi_disk.base import runtime
from taichi_disk.base.engine import ti
runtime.start()
@ti.kernel
def one() -> float:
    return 1.0
one()
"""


def test_kernels_that_no_later_program_finds_are_removed(tmp_path):
    (tmp_path / "own.py").write_text(KERNEL)
    temporary = tmp_path / "t"
    temporary.mkdir()
    variables = {environment.CACHE: "/dev/null/x", "TMPDIR": str(temporary)}
    printed_by(tmp_path / "own.py", env=os.environ | variables)
    assert not list(temporary.iterdir())


@pytest.mark.parametrize(
    ("age", "stays"),
    [(environment.STALE - 30.0, True), (environment.STALE + 30.0, False)],
)
def test_the_lock_of_a_process_that_was_killed_goes_and_that_of_another_process_stays(
    tmp_path, monkeypatch, age, stays
):
    monkeypatch.setenv(environment.CACHE, str(tmp_path))
    lock = tmp_path / "ticache.lock"
    lock.touch()
    os.utime(lock, (time.time() - age,) * 2)
    environment.remove_stale_lock()
    assert lock.exists() == stays
    environment.remove_stale_lock()


def test_a_cache_that_cannot_be_read_or_has_no_room_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv(environment.CACHE, str(tmp_path))
    assert environment.cache_problem() == ""
    (tmp_path / "ticache.tcb").mkdir()
    assert environment.cache_problem() == f"{tmp_path}: Is a directory"
    (tmp_path / "ticache.tcb").rmdir()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, limits[1]))  # as if it were full
    try:
        assert environment.cache_problem() == f"{tmp_path}: File too large"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_an_engine_that_cannot_be_loaded_says_what_it_needs(monkeypatch):
    def fails(name):
        raise ImportError("/lib/libc.so.6: version `GLIBC_2.34' not found")

    monkeypatch.delitem(sys.modules, engine.NAME)
    monkeypatch.setattr(engine, "import_module", fails)
    with pytest.raises(
        TaichiDiskError, match=r"GLIBC_2.34' not found; it needs libX11"
    ):
        engine.__getattr__("ti")


@pytest.mark.parametrize(
    ("error", "limit"),
    [("Resource temporarily unavailable", "-u"), ("Out of memory", "-v")],
)
def test_a_limit_that_keeps_an_engine_from_starting_is_named(monkeypatch, error, limit):
    def fails(init):
        raise RuntimeError(error)

    monkeypatch.setattr(runtime.owner, "start", fails)
    with pytest.raises(TaichiDiskError, match=f"{error}; .*`ulimit {limit}`"):
        runtime._init(ti, 1)


@pytest.mark.parametrize(
    ("pattern", "file"),
    [
        # names an engine
        (r"(?m)^\s*(import|from) taichi(_forge)?\b|[\"']taichi([_-]forge)?[\"']", INIT),
        # uses what the engine does not promise
        (r"\bti\._|\bti\.lang\b|\.lang\.impl\b|\bui\.utils\b", "internals.py"),
    ],
)
def test_one_file_alone_knows_the_engine(pattern, file):
    files = [*(ROOT / "taichi_disk").rglob("*.py"), *(ROOT / "docs").rglob("*.py")]
    found = [one for one in files if re.search(pattern, one.read_text("utf-8"))]
    assert found == [ROOT / "taichi_disk" / "base" / "engine" / file]


def test_another_version_of_taichi_is_left_as_it_is():
    internals.patch(SimpleNamespace(__version__=(1, 7, 3)))  # has nothing to change


@ti.kernel
def slip():
    print(unknown)  # noqa: F821


@pytest.mark.skipif(
    ti.__version__ != internals.PATCHED, reason="this version is not patched"
)
def test_a_slip_in_this_package_s_kernels_is_shown_with_its_line():
    context = SimpleNamespace(
        file=internals.OWN_FILES + "x.py",
        lineno_offset=40,
        src=["a = 1", "b = c"],
        func=SimpleNamespace(func=slip.__wrapped__),
    )
    transformer = ti.lang.ast.ast_transformer_utils.ASTTransformerContext
    shown = transformer.get_pos_info(context, SimpleNamespace(lineno=2))
    assert shown.endswith('x.py", line 42, in slip:\nb = c\n')


def test_a_slip_in_the_user_s_own_kernel_is_underlined(kernels):
    with pytest.raises(ti.TaichiNameError, match=r"print\(unknown\).*\n +\^+ *\n"):
        slip()
