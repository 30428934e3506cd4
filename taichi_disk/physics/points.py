"""A point's x and y, gathered from two scalar fields into one vector and put back.

Taichi 1.7.4 by default takes local vectors apart into scalars and leaves it to LLVM 15 to find vectors again; on a
processor that LLVM 15 does not know (Zen 4, Zen 5, ...) it makes pairs of numbers at best. `runtime.start` has them
kept whole, in registers as wide as the processor has. Two things go wrong then: the address of an element of a vector
field, so the fields here are pairs of scalar fields, side by side in memory; and `a -= b` of whole local vectors (LLVM
aborts), so write a = a - b.
"""

import taichi as ti

# NumPy arrays that kernels take.
Integers1 = ti.types.ndarray(ti.i32, ndim=1)
Reals1 = ti.types.ndarray(ti.f64, ndim=1)
Reals2 = ti.types.ndarray(ti.f64, ndim=2)
Reals3 = ti.types.ndarray(ti.f64, ndim=3)


@ti.func
def get(pair: ti.template(), i):
    """(x, y) at i of a pair of scalar fields."""
    return ti.Vector([pair[0][i], pair[1][i]])


@ti.func
def put(pair: ti.template(), i, value):
    """Set what `get` returns."""
    pair[0][i] = value[0]
    pair[1][i] = value[1]


def pair_of(builder, count: int):
    """Two scalar fields of `count` numbers in f64, x and y of a point side by side: loaded with one instruction."""
    pair = (ti.field(ti.f64), ti.field(ti.f64))
    builder.dense(ti.i, count).place(*pair)
    return pair
