"""The process of a command. It listens to signals before anything is imported, which takes a while."""

from __future__ import annotations

from taichi_disk.signals import listen


def process() -> None:
    """Carry out the command that was given, and end with its exit status."""
    listen()
    import gc
    import os
    import sys

    # Before NumPy is imported: the idle threads of its OpenBLAS spin, and nothing here has work for them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from taichi_disk.cli import main
    from taichi_disk.runtime import leave

    os.environ["MPLBACKEND"] = "agg"  # curves go into files; another one, or one that is none, would fail on import
    gc.set_threshold(100_000)  # by default 3 % of a run's time goes into searches for garbage that is not there
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:  # it may be closed
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]  # a console of CP1252 has no η
    leave(main())


if __name__ == "__main__":
    process()
