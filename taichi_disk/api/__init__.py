"""Running scenes from Python: what `taichi_disk` exports, the commands and the sweeps build on."""

from taichi_disk.api.job import shared_kernels
from taichi_disk.api.result import Result, State, run

__all__ = ["Result", "State", "run", "shared_kernels"]
