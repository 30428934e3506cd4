"""A point's numbers, gathered from fields into one vector and put back.

Taichi 1.7.4 takes local vectors apart into scalars and leaves it to LLVM 15 to find vectors again; on a processor that
LLVM 15 does not know (Zen 4, Zen 5, ...) it makes pairs of numbers at best. Kernels compiled under
`runtime.whole_vectors` keep vectors whole, in registers as wide as the processor has. Two things go wrong there:
matrix and vector fields (an element's address is wrong), so kernels see them as the scalar fields that they are made
of, side by side in memory; and `a -= b` of whole local vectors (LLVM aborts): write a = a - b.
"""

from typing import Any

import taichi as ti


def parts_of(field: Any) -> Any:
    """The scalar fields of a matrix field, [row][column], or of a vector field, [row]; another field as it is."""
    if not isinstance(field, ti.MatrixField):
        return field
    if field.ndim == 1:
        return [field.get_scalar_field(c) for c in range(field.n)]
    return [[field.get_scalar_field(c, w) for w in range(field.m)] for c in range(field.n)]


@ti.func
def get(parts: ti.template(), i):
    """What a matrix or vector field, or one row of a matrix field, holds at i."""
    if ti.static(isinstance(parts[0], list)):
        return ti.Matrix([[part[i] for part in line] for line in parts])
    else:
        return ti.Vector([part[i] for part in parts])


@ti.func
def put(parts: ti.template(), i, value):
    """Set what `get` returns."""
    for c in ti.static(range(len(parts))):
        if ti.static(isinstance(parts[c], list)):
            for w in ti.static(range(len(parts[c]))):
                parts[c][w][i] = value[c, w]
        else:
            parts[c][i] = value[c]
