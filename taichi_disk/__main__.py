"""Entry point of the command line. Signals are handled before the imports, which take a while."""

from __future__ import annotations

from taichi_disk.signals import listen


def process() -> None:
    """Run the command line and end the process with its exit status."""
    listen()
    import gc
    import os
    import sys

    # Must be set before NumPy is imported: idle threads of OpenBLAS spin, and nothing here uses them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from taichi_disk.cli import main
    from taichi_disk.runtime import leave

    os.environ["MPLBACKEND"] = "agg"  # curves go into files; the user's backend may need a display or not exist
    gc.set_threshold(100_000)  # by default Python spends 3 % of a run searching for garbage, and finds none
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:  # None if closed
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]  # a console of CP1252 has no η
    leave(main())


if __name__ == "__main__":
    process()
