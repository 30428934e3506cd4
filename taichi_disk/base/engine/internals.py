"""What this package uses of the engine that is not public, and patches of Taichi 1.7.4.

The patches act on functions of this package only, so that the user's own kernels get
Taichi's full messages. `signals` and `physics.law` each contain a workaround.
"""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from copy import deepcopy
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

PATCHED = (1, 7, 4)  # the private functions of other versions may differ
OWN_FILES = str(Path(__file__).parents[2]) + os.sep
# lists of the fields that were declared since the last launch of a kernel
DECLARED = ("global_vars", "grad_vars", "dual_vars", "matrix_fields")


def program(ti: Any) -> Any:
    return ti.lang.impl.get_runtime().prog


def settings(ti: Any) -> Any:
    """Return the settings of the running program, as attributes."""
    return ti.lang.impl.current_cfg()


@contextmanager
def own_settings(ti: Any) -> Iterator[None]:
    """Make fields and compile kernels in this block as this package needs it: in exact
    double precision, with vectors kept whole (see `physics.law`). Afterwards the
    settings of the user's `ti.init` hold again."""
    config = settings(ti)
    runtime = ti.lang.impl.get_runtime()
    own = {
        "default_fp": ti.f64,
        # True is no faster here, and results would depend on how a kernel is optimised
        "fast_math": False,
        "real_matrix_scalarize": False,
    }
    if hasattr(config, "compile_tier"):
        # The fork's default compiles faster, and a step then takes eleven times as
        # long.
        own["compile_tier"] = "balanced"
    with ExitStack() as stack:
        stack.callback(setattr, runtime, "default_fp", runtime.default_fp)
        runtime.default_fp = ti.f64
        for name, value in own.items():
            # copied, because a type is read as a reference into the settings
            stack.callback(setattr, config, name, deepcopy(getattr(config, name)))
            setattr(config, name, value)
        yield


def has_declared_fields(ti: Any) -> bool:
    """Return whether fields were declared since the last launch of a kernel."""
    runtime = ti.lang.impl.get_runtime()
    return any(getattr(runtime, name) for name in DECLARED)


def has_vulkan(ti: Any) -> bool:
    return ti._lib.core.with_vulkan()


def native_window(ti: Any, *options: Any) -> Any:
    """Return a window of GGUI that takes its shaders from a given folder."""
    return ti._lib.core.PyWindow(program(ti), *options, ti.cfg.arch)


def field_info(ti: Any) -> Callable[[Any], Any]:
    """Return the function that describes an array to GGUI's canvas."""
    return import_module(f"{ti.__name__}.ui.utils").get_field_info


@contextmanager
def field_builder(ti: Any) -> Iterator[Any]:
    """Yield a builder of fields. If the block fails, the engine forgets the fields that
    were declared in it; otherwise it would refuse every later kernel."""
    runtime = ti.lang.impl.get_runtime()
    declared = {name: list(getattr(runtime, name)) for name in DECLARED}
    builder = ti.FieldsBuilder()
    try:
        with own_settings(ti):
            yield builder
    except BaseException:
        runtime.unfinalized_fields_builder.pop(builder, None)
        vars(runtime).update(declared)
        raise


# ---- patches


def shorten_searches() -> None:
    """Save 0.07 s of searches through all modules while Taichi is imported and
    functions are decorated."""
    # Taichi asks for the source of the calling frame, which is the import system's own
    # and unknown to `inspect`.
    inspect.modulesbyfile[os.path.abspath("<frozen importlib._bootstrap>")] = (
        "importlib._bootstrap"
    )


def patch(ti: Any) -> None:
    """Skip work that Taichi repeats for every syntax node of this package's functions.

    For every node of every inlined function, Taichi breaks and underlines the source
    lines for an error message that nobody reads. It searches all modules for the source
    around a function to find out whether it is a method.
    """
    if ti.__version__ != PATCHED:
        return
    kernel_impl = ti.lang.kernel_impl
    transformer = ti.lang.ast.ast_transformer_utils.ASTTransformerContext
    full_position = transformer.get_pos_info
    searched_class = kernel_impl._inside_class

    def position(context: Any, node: Any) -> str:
        if not context.file.startswith(OWN_FILES):
            return full_position(context, node)
        where = (
            f'File "{context.file}", line {node.lineno + context.lineno_offset}, in'
            f" {context.func.func.__name__}"
        )
        return f"{where}:\n{context.src[node.lineno - 1]}\n"

    def is_in_class(level_of_class_stackframe: int) -> bool:
        frame = sys._getframe(level_of_class_stackframe - 1)
        if not frame.f_code.co_filename.startswith(OWN_FILES):
            return searched_class(level_of_class_stackframe + 1)
        return "__qualname__" in frame.f_locals

    transformer.get_pos_info = position
    kernel_impl._inside_class = is_in_class
    # an inlined function is read again each time (0.03 s of a warm run)
    kernel_impl.getsourcelines = lru_cache(maxsize=None)(kernel_impl.getsourcelines)
