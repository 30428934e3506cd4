"""What an impact, a command and the page of the sandbox cost on this machine.

    python -m tests.benchmarks kernel        a step, by what the scene models
    python -m tests.benchmarks page          many pages at once
    python -m tests.benchmarks precision     error and wall clock of several programs

Compare times of one call, because machines differ and are disturbed.
"""

from taichi_disk.base.engine import environment

environment.prepare()  # before Taichi is imported
