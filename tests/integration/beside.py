"""A user's own fields and kernels beside the program, in one process.

    python -m tests.integration.beside plain defaults f32 …

Each word is a start of Taichi. `plain`: by the program; then by the user: `exact`
(double precision without fast math), `defaults`, `f32` (defaults, and fields of single
precision). Before them, `settings`: all settings of the user hold again after a call.
"""

import sys
from copy import deepcopy
from functools import partial

import numpy as np

from taichi_disk import run
from taichi_disk.base.engine import owner, ti

INIT = {"exact": {"default_fp": ti.f64, "fast_math": False}, "defaults": {}, "f32": {}}
SINGLE = 0.3333333432674408
SETTINGS = (
    ({}, SINGLE),
    ({"fast_math": False}, SINGLE),
    ({"default_fp": ti.f64}, 1 / 3),
    ({"default_ip": ti.i64, "debug": True}, SINGLE),
    ({"opt_level": 1}, SINGLE),
    ({"real_matrix_scalarize": False, "kernel_profiler": True}, SINGLE),
)
VALUES = np.arange(1.0, 9.0).reshape(4, 2)


def settings():
    names = [name for name in dir(ti.cfg) if not name.startswith("_")]
    return {name: deepcopy(getattr(ti.cfg, name)) for name in names}


@ti.kernel
def third() -> ti.f64:
    i = 1
    return i / 3


def check_settings():
    """Raise AssertionError if a call to the engine changes a setting of the user."""
    for init, expected in SETTINGS:
        ti.init(arch=ti.cpu, **init)
        before = settings()
        assert owner.call(lambda: ti.cfg.default_fp.to_string()) == "f64"
        assert settings() == before and third() == expected, (init, third())


def bits(scenes):
    """Return all bits that a run of each of `scenes` scenes computes."""
    runs = (
        partial(run, "exponential_wall", points=60, viscosity=0.0091, lattices=1),
        partial(run, "compression", points=40, pressure=0.01, lattices=1),
    )
    results = [one() for one in runs[:scenes]]
    return [
        {name: values.tobytes() for name, values in result.series.items()}
        for result in results
    ]


class Own:
    """Fields and kernels of the kinds that people write."""

    def __init__(self, real):
        vec2 = ti.types.vector(2, real)
        x = self.x = ti.Vector.field(2, real, 4)
        v = self.v = ti.Vector.field(2, real, 4)
        m = ti.Matrix.field(2, 2, real, 4)

        @ti.kernel
        def product() -> real:
            total = ti.cast(0.0, real)
            for i in range(4):
                total += x[i].dot(x[i])
            return total

        @ti.kernel
        def attract():
            for i in x:
                force = vec2(0.0, 0.0)
                for j in range(4):
                    away = x[j] - x[i]
                    force += away / (away.norm() + 1.0)
                v[i] = force

        @ti.kernel
        def invert():
            for i in m:
                m[i] = ti.Matrix([[2.0, 0.0], [0.0, 4.0]])
                v[i] = m[i].inverse() @ x[i]

        @ti.kernel
        def scale(a: vec2, k: real):
            for i in x:
                v[i] = a * k

        @ti.kernel
        def total() -> vec2:
            a = vec2(0.0, 0.0)
            for i in range(4):
                a += x[i]
            return a

        self.product = product
        self.attract = attract
        self.invert = invert
        self.scale = lambda: scale(vec2(1.0, 2.0), 3.0)
        self.total = total
        self.real = real

    def check(self):
        """Raise AssertionError if a kernel or an access to a field is wrong."""
        x = self.x
        x.from_numpy(VALUES.astype(ti.lang.util.to_numpy_type(self.real)))
        assert np.array_equal(x.to_numpy(), VALUES)
        x[2] = [7.0, 8.0]
        x[2][1] = 9.0
        assert x.to_numpy()[2].tolist() == [7.0, 9.0] and x[2][1] == 9.0
        x[2] = VALUES[2].tolist()
        assert np.allclose(self.product(), 204.0)
        assert np.allclose(self.total(), VALUES.sum(axis=0))
        self.attract()
        away = VALUES[None] - VALUES[:, None]
        lengths = np.linalg.norm(away, axis=2)[..., None]
        self.expect((away / (lengths + 1.0)).sum(axis=1))
        self.invert()
        self.expect(VALUES / [2.0, 4.0])
        self.scale()
        self.expect([3.0, 6.0])
        self.v.fill(5.0)
        self.expect(5.0)

    def expect(self, values):
        assert np.allclose(self.v.to_numpy(), values, atol=1e-5), self.v.to_numpy()


def main(starts):
    if "settings" in starts:
        check_settings()
        starts.remove("settings")
    alone = None
    scenes = min(len(starts), 2)  # one start is for a quick test
    for start in starts:
        real = ti.f64
        if start == "f32":
            real = ti.f32
        owns = []
        if start != "plain":
            ti.init(arch=ti.cpu, **INIT[start])
            owns.append(Own(real))
            if start == "f32":
                owns[0].check()  # its kernels are compiled before ours
        found = bits(scenes)
        if alone is None:
            alone = found
        assert found == alone, f"{start}: a run has other bits"
        owns.append(Own(real))
        for own in owns:
            own.check()
        assert bits(scenes) == alone, f"{start}: a second run has other bits"
    print("right")


if __name__ == "__main__":
    main(sys.argv[1:])
