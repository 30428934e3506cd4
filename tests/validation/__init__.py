"""Long checks of the physics: tests (`pytest --validate`), and two programs (`python -m tests.validation.NAME`).

estimate_trial: does the error estimate that every run reports hold, and is `time.tolerance` kept?
hard_cases: what the program does at the edge of what it can; the table of docs/stability.md.
"""

from taichi_disk.engine import environment

environment.prepare()  # before Taichi is imported
