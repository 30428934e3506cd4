"""Long checks of the physics: tests (`pytest --validate`), and two programs (`python -m
tests.validation.NAME`).

estimate_trial: checks whether the error estimate of every run holds, and whether
`time.tolerance` is kept. hard_cases: shows what the program does with extreme scenes;
the table of docs/stability.md.
"""

from taichi_disk.base.engine import environment

environment.prepare()  # before Taichi is imported
