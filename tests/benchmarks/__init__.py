"""What a step, a run and a command cost on this machine.

    python -m tests.benchmarks                                everything but `sweep`
    python -m tests.benchmarks kernel --set lattice.seed=1    a part; --help lists them

Runs take turns, so that disturbances of the machine affect all of them equally. Compare
ratios, not times.
"""

from taichi_disk.engine import environment

environment.prepare()  # before Taichi is imported
