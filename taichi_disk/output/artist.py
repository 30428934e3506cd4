"""A second process that draws with Matplotlib, so that this one need not import it
(0.3 s) and need not wait while it draws."""

from __future__ import annotations

import gc
import io
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, TimeoutError
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

from taichi_disk.machine import cores, python_command
from taichi_disk.signals import ignored_by_children

_SERVE = "from taichi_disk.output.artist import serve; serve()"
# after this time a picture is drawn again in this process [s]; it takes 0.5 s, but a
# first import of Matplotlib looks at all fonts
_DRAWING_TIME = 60.0
_ENVIRONMENT = {"MPLBACKEND": "agg", "OPENBLAS_NUM_THREADS": "1"}


class Artist:
    """Calls functions in a second process, one after the other; in this process, if
    there is no second one, or if it fails or does not answer."""

    def __init__(self, process: subprocess.Popen[bytes] | None = None) -> None:
        self._process = process
        # A thread sends and waits, because a process that hangs does not empty the
        # pipe.
        self._thread = ThreadPoolExecutor(1)

    def begin(self, draw: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
        """Begin `draw(*arguments)`, and return a function that waits for its value.
        Function, arguments and value are pickled."""
        here = partial(draw, *arguments)
        if self._process is None:
            return here
        try:
            message = pickle.dumps(here)
        except (pickle.PicklingError, AttributeError):
            return here
        return partial(_finish, self._thread.submit(self._ask, message), here)

    def _ask(self, message: bytes) -> Any:
        """Return (value,), or () after a failure."""
        assert self._process and self._process.stdin and self._process.stdout
        self._process.stdin.write(message)
        self._process.stdin.flush()
        return pickle.load(self._process.stdout)

    def close(self) -> None:
        if self._process:
            self._process.kill()
            self._process.wait()
        self._thread.shutdown(cancel_futures=True)


def _finish(answer: Future[Any], here: Callable[[], Any]) -> Any:
    with suppress(OSError, EOFError, pickle.UnpicklingError, TimeoutError):
        value = answer.result(_DRAWING_TIME)
        if value:
            return value[0]
    return here()


@contextmanager
def drawing_process(film: bool) -> Iterator[Artist]:
    """Yield an `Artist` whose process ends with the block. It has a process if a `film`
    is made, or if this process has not imported Matplotlib yet."""
    process = None
    if film or "matplotlib" not in sys.modules:
        with suppress(OSError), ignored_by_children():
            process = _start()
    artist = Artist(process)
    try:
        yield artist
    finally:
        artist.close()


def _start() -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        python_command(_SERVE),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **_ENVIRONMENT},
    )


def serve() -> None:
    """Call the functions that arrive at standard input, and write (value,), or () after
    a failure, to standard output."""
    gc.disable()  # this process ends before collecting would pay
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # draw a first figure during the run: it loads fonts and fills caches, which takes
    # 0.1 s
    if cores() > 1:
        figure = Figure()
        FigureCanvasAgg(figure)
        ax = figure.subplots()
        ax.plot([0.0, 1.0], label="$x$")
        ax.legend()
        figure.savefig(io.BytesIO())
    with suppress(EOFError):
        while True:
            draw = pickle.load(sys.stdin.buffer)
            answer: tuple[Any, ...] = ()
            with suppress(Exception):
                answer = (draw(),)
            pickle.dump(answer, sys.stdout.buffer)
            sys.stdout.buffer.flush()
    os._exit(0)  # saves 0.1 s of unloading the libraries
