"""The engine that compiles and runs kernels: Taichi, or its fork Taichi Forge if Taichi
is not installed.

Taichi has no wheels for Python 3.14 and later. The fork has, and it gives bitwise the
same results.
Only this file names the two. The rest of the package writes
`from taichi_disk.base.engine import ti`, which prepares the environment and imports the
engine at that moment.
"""

from __future__ import annotations

import atexit
import sys
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from taichi_disk.base.engine import environment, internals
from taichi_disk.base.errors import TaichiDiskError
from taichi_disk.base.machine import foreign_packages

if TYPE_CHECKING:
    import taichi as _taichi

    ti = _taichi

NAME = next((name for name in ("taichi", "taichi_forge") if find_spec(name)), "taichi")
PACKAGE = NAME.replace("_", "-")
WITH_KNOWN_SHADERS = {"taichi": "1.7.4"}  # see `render.shaders`


def __getattr__(name: str) -> Any:
    if name != "ti":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    is_temporary = environment.prepare()
    internals.shorten_searches()
    try:
        module = import_module(NAME)
        internals.patch(module)
        if is_temporary:  # the engine writes its kernels before they are removed
            atexit.register(module.reset)
    except (ImportError, AttributeError) as error:
        sys.modules.pop(NAME, None)  # which may be a file of the user's
        needs = (
            "it needs libX11 and, on Linux, glibc 2.34 or later (Debian 12, Ubuntu"
            " 22.04, RHEL 9)"
        )
        raise TaichiDiskError(
            f"{PACKAGE} cannot be loaded: {error}; {foreign_packages() or needs}"
        ) from None
    globals()["ti"] = module
    return module


def loaded() -> Any:
    return sys.modules.get(NAME)


def program() -> Any:
    """Return the engine's running program, which owns all fields; None before `ti.init`
    and after `ti.reset`."""
    module = loaded()
    if module is None:
        return None
    return internals.program(module)


def versions() -> dict[str, str]:
    """Return {package: version} of the installed engine, without importing it."""
    from importlib.metadata import PackageNotFoundError, version

    with suppress(PackageNotFoundError):
        return {PACKAGE: version(PACKAGE)}
    return {}
