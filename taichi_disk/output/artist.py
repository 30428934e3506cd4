"""A second process that draws with Matplotlib, so that this one need not import it
(0.3 s) and need not wait while it draws."""

from __future__ import annotations

import gc
import pickle
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

from taichi_disk.machine import can_start_python
from taichi_disk.processes.pool import Pool, awaited

# after this time a picture is drawn again in this process [s]; it takes 0.5 s, but a
# first import of Matplotlib looks at all fonts
_DRAWING_TIME = 60.0


class Artist:
    """Calls functions in a second process, one after the other; in this process, if
    there is no second one, or if it fails or does not answer."""

    def __init__(self, pool: Pool | None = None) -> None:
        self._pool = pool

    def begin(self, draw: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
        """Begin `draw(*arguments)`, and return a function that waits for its value.
        Function, arguments and value are pickled."""
        here = partial(draw, *arguments)
        if self._pool is not None:
            with suppress(pickle.PicklingError, AttributeError):
                return partial(_finish, self._pool.submit(draw, *arguments), here)
        return here


def _finish(answer: Future[Any], here: Callable[[], Any]) -> Any:
    try:
        return awaited(answer.result, _DRAWING_TIME)
    except Exception:  # an error of the drawing itself comes again here
        return here()


@contextmanager
def drawing_process(film: bool) -> Iterator[Artist]:
    """Yield an `Artist` whose process ends with the block. It has a process if a `film`
    is made, or if this process has not imported Matplotlib yet."""
    pool = None
    if can_start_python() and (film or "matplotlib" not in sys.modules):
        with suppress(OSError):  # there is no room for another process
            pool = Pool(1)
            pool.submit(_import_matplotlib)
    try:
        yield Artist(pool)
    finally:
        if pool is not None:
            pool.kill()


def _import_matplotlib() -> None:
    gc.disable()  # the process ends before collecting would pay
    import matplotlib.backends.backend_agg
    import matplotlib.figure  # noqa: F401
