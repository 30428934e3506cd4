"""Entry point of the command line. Signals are handled before the imports, which take a
while."""

from __future__ import annotations

from taichi_disk.base.signals import listen


def process() -> None:
    """Run the command line and end the process with its exit status."""
    listen()
    import gc
    import os
    import sys

    # Imports make many objects that stay; collecting among them takes 1 to 2 %.
    gc.set_threshold(100_000)
    # Set this before NumPy is imported: idle threads of OpenBLAS would use the cores,
    # and nothing here needs them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from taichi_disk.base.runtime import leave
    from taichi_disk.cli import main

    # draws into files; the user's backend may need a display or not exist
    os.environ["MPLBACKEND"] = "agg"
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:  # a closed stream is None
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]  # a CP1252 console cannot show η
    leave(main(sys.argv[1:]))


if __name__ == "__main__":
    process()
