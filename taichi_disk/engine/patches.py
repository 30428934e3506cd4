"""Patches of Taichi 1.7.4 and their reasons. `signals` and `physics.law` each contain
one more workaround.

The patches save 0.3 s of a first run of 2.0 s. They change private functions, so they
apply only to this version.
"""

from __future__ import annotations

import inspect
import os
import sys
import textwrap
import time
from contextlib import suppress
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

from taichi_disk.engine.environment import cache_folder

# a lock of this age is stale [s]; Taichi holds the lock of its cache for less than 1 s
STALE = 60.0


def shorten_searches() -> None:
    """Save 0.07 s of searches through all modules while Taichi is imported and
    functions are decorated."""
    # Taichi asks for the source of the calling frame, which is the import system's own
    # and unknown to `inspect`.
    inspect.modulesbyfile[os.path.abspath("<frozen importlib._bootstrap>")] = (
        "importlib._bootstrap"
    )


def apply(ti: Any) -> None:
    """Skip work that Taichi repeats for every syntax node and that takes half of its
    compile time in Python.

    For every node of every inlined function, Taichi breaks and underlines the source
    lines for an error message that nobody reads; with the patch its messages show a
    node's first line. It reads a function's source again each time, and searches all
    modules for the source around a function to find out whether it is a method. It
    wraps each source line at 9999 characters, which only strips it.
    """
    kernel_impl = ti.lang.kernel_impl
    transformer = ti.lang.ast.ast_transformer_utils.ASTTransformerContext

    def position(context: Any, node: Any) -> str:
        where = (
            f'File "{context.file}", line {node.lineno + context.lineno_offset}, in'
            f" {context.func.func.__name__}"
        )
        return f"{where}:\n{context.src[node.lineno - 1]}\n"

    def is_in_class(level_of_class_stackframe: int) -> bool:
        return "__qualname__" in sys._getframe(level_of_class_stackframe - 1).f_locals

    transformer.get_pos_info = position
    kernel_impl._inside_class = is_in_class
    kernel_impl.getsourcelines = lru_cache(maxsize=None)(kernel_impl.getsourcelines)
    kernel_impl.textwrap = SimpleNamespace(
        dedent=textwrap.dedent, fill=lambda line, **_: line.expandtabs(4).rstrip()
    )


def remove_stale_lock() -> None:
    """Remove the lock that a killed process has left in the cache, because Taichi would
    not use a locked cache."""
    lock = cache_folder() / "ticache.lock"
    with suppress(OSError):  # there is no lock, or another process has removed it
        if time.time() - lock.stat().st_mtime > STALE:
            lock.unlink()
