"""The time integrators, one to a file, by the name that a scene gives them."""

from taichi_disk.model.integrators.splitting import Splitting
from taichi_disk.model.integrators.vefrl import VEFRL
from taichi_disk.model.integrators.velocity_verlet import VELOCITY_VERLET

# The trapezoidal dashpot rides on velocity Verlet: its kernels are in `trapezoidal`.
SPLITTINGS: dict[str, Splitting] = {"velocity_verlet": VELOCITY_VERLET, "trapezoidal": VELOCITY_VERLET, "vefrl": VEFRL}
