"""What an impact, a command and the page of the sandbox cost on this machine.

    python -m tests.benchmarks kernel        a step, by what the scene models
    python -m tests.benchmarks page          many pages at once
    python -m tests.benchmarks precision     error and wall clock of several programs

Compare times of one call, because machines differ and are disturbed.
"""

import os

from taichi_disk.base.engine import environment

environment.prepare()  # before Taichi is imported
# DOP853 multiplies 13 long rows by a few numbers: on a busy machine two threads of
# OpenBLAS wait for each other. Read when NumPy is imported.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
