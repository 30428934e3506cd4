"""Launches of this package's kernels without Taichi's checks of their arguments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import ref

import numpy as np


def quick_call(
    kernel_impl: Any, program: Callable[[], Any], folder: str
) -> Callable[..., Any]:
    """Return what launches a kernel without the checks of its arguments, except the
    first time.

    Args:
        kernel_impl: Taichi's module of kernels.
        program: returns the running program.
        folder: where the source of such kernels is. Others are launched as usual.

    The checks take 35 of 50 us; a class's page launches 2,000 kernels a second.
    """
    full_call = kernel_impl.Kernel.__call__
    real_kinds = kernel_impl.primitive_types.real_type_ids

    def call(self: Any, *values: Any) -> Any:
        is_own = self.func.__code__.co_filename.startswith(folder)
        if self.return_type or not is_own or _has_gaps(values):
            return full_call(self, *values)
        # the object whose method the kernel is, and flags
        owner, *flags = [values[k] for k in self.template_slot_locations]
        key = ref(owner), *flags
        kernel = self.compiled_kernels.get(key)
        if kernel is None:
            full_call(self, *values)
            known = self.ensure_compiled(*values)
            self.compiled_kernels[key] = self.compiled_kernels[known]
            return None
        context = kernel.make_launch_context()
        place = 0
        for k, argument in enumerate(self.arguments):
            if k not in self.template_slot_locations:
                is_real = id(argument.annotation) in real_kinds
                _pass(context, place, values[k], is_real)
                place += 1
        runner = program()
        compiled = runner.compile_kernel(
            runner.config(), runner.get_device_caps(), kernel
        )
        runner.launch_kernel(compiled, context)
        return None

    return call


def _has_gaps(values: tuple[Any, ...]) -> bool:
    """Return whether an array among the arguments must be copied before a launch."""
    return any(
        isinstance(value, np.ndarray) and not value.flags.c_contiguous
        for value in values
    )


def _pass(context: Any, place: int, value: Any, is_real: bool) -> None:
    """Set an argument of a launch."""
    if isinstance(value, np.ndarray):
        context.set_arg_external_array_with_shape(
            (place,), value.ctypes.data, value.nbytes, value.shape, 0
        )
    elif is_real:
        context.set_arg_float((place,), value)
    else:
        context.set_arg_int((place,), value)
