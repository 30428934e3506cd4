"""Starting Taichi on the machine that was asked for, or saying why not."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, Literal

from taichi_disk.errors import InputError

ARCHES = ("cpu", "cuda", "vulkan")
Precision = Literal["f64", "f32"]


def start(arch: str = "cpu", threads: int | None = None, precision: Precision = "f64") -> None:
    """(Re)start Taichi in `precision` on `arch`; every field made before this is gone.

    fast_math stays off: it gains nothing here, and without it the bytes of a result do not depend on how
    a kernel was optimised. The offline cache halves the compile time of the next run.

    Raises InputError when the machine cannot compute this model on `arch`.
    """
    if arch not in ARCHES:
        raise InputError(f"--arch {arch}: choose one of {', '.join(ARCHES)}")
    import taichi as ti

    _spare_source_lines()
    if arch == "cuda" and not ti._lib.core.with_cuda():
        raise InputError("--arch cuda: Taichi finds no CUDA device on this machine; use --arch cpu")
    if arch == "vulkan":
        # Vulkan's exp() exists in single precision only, and software Vulkan (lavapipe) silently ends a
        # shader's loop after 65,535 iterations: both would give wrong physics without an error.
        raise InputError(
            "--arch vulkan: refused, because the stepping needs exp() in double precision and loops of more than "
            "65,535 iterations, and Vulkan drivers lack the first and may cut the second short without an error. "
            "Use --arch cpu (or cuda); the film is drawn with Vulkan in any case"
        )
    options: dict[str, Any] = {"cpu_max_num_threads": threads} if threads else {}
    with contextlib.redirect_stdout(io.StringIO()):  # it tells the arch where only results belong
        ti.init(
            arch=getattr(ti, arch),
            default_fp=getattr(ti, precision),
            default_ip=ti.i32,
            fast_math=False,
            log_level=ti.ERROR,
            **options,
        )


class _Whole:
    """Stands in for a `textwrap.TextWrapper`, and wraps nothing."""

    def __init__(self, width: int) -> None:
        pass

    def wrap(self, text: str) -> list[str]:
        return [text] if text else []


def _spare_source_lines() -> None:
    """Take away what Taichi 1.7.4 spends half of its Python time on before a kernel is compiled, or found compiled.

    For every node of every function that it inlines it breaks the source lines for an error message that is not
    needed, and reads a function's source anew each time. Its messages now show whole lines.
    """
    from taichi.lang import kernel_impl
    from taichi.lang.ast import ast_transformer_utils

    ast_transformer_utils.TextWrapper = _Whole
    if not hasattr(kernel_impl.getsourcelines, "cache_info"):
        kernel_impl.getsourcelines = lru_cache(maxsize=None)(kernel_impl.getsourcelines)


def precision() -> Precision:
    """The precision that Taichi was started in: literals in kernels have it, so every world has to."""
    import taichi as ti

    return "f32" if ti.lang.impl.current_cfg().default_fp == ti.f32 else "f64"


@contextlib.contextmanager
def whole_vectors() -> Iterator[None]:
    """Kernels that are compiled within keep local vectors whole on a CPU (see `vectors`)."""
    import taichi as ti

    config = ti.lang.impl.current_cfg()
    scalarize = config.real_matrix_scalarize
    config.real_matrix_scalarize = config.arch not in (ti.x64, ti.arm64)
    try:
        yield
    finally:
        config.real_matrix_scalarize = scalarize
