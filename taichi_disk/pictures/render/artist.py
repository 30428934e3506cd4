"""A second process that draws curves with Matplotlib, and finishes and encodes the
pictures of a film, so that this one need not import what that takes (0.5 s) and need
not wait."""

from __future__ import annotations

import gc
import os
import sys
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.errors import NoPictures, SimulationError
from taichi_disk.base.machine import can_start_python, driver_problem, driver_state
from taichi_disk.base.processes.pool import Pool, result_of

# after this time a picture is drawn again in this process [s]; it takes 0.5 s, but a
# first import of Matplotlib looks at all fonts
_DRAWING_TIME = 60.0
_TRIAL_TIME = 20.0  # after this time a driver hangs [s]; to load all takes 0.1 s
WAITING = 6  # calls that may wait for the second process

# whether this system has given memory for every SharedArray
_shares_memory = True
# the object whose methods this process calls, see `Artist.employ`
_employed: list[Any] = []


class Artist:
    """Calls functions in a second process, one after the other; in this process, if
    there is no second one, or if it fails or does not answer."""

    def __init__(
        self, pool: Pool | None = None, trial: Callable[[], str] = driver_state
    ) -> None:
        self._pool = pool
        self._trial = trial

    def require_film(self) -> None:
        """Raise NoPictures, with what helps, unless this machine can make films. Needs
        no `ti.init`. The Vulkan drivers are tried in the second process, if it makes a
        film."""
        from taichi_disk.base.engine import internals, ti

        try:
            state = self._trial()
        except BrokenExecutor as error:
            state = f"crashed with {error}"
        except TimeoutError:
            state = f"did not answer for {_TRIAL_TIME:g} s"
        if not state and not internals.has_vulkan(ti):
            state = "cannot be used by Taichi"
        if state:
            raise NoPictures(driver_problem(state))

    def begin(self, draw: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
        """Begin `draw(*arguments)`, and return a function that waits for its value.
        Function, arguments and value are pickled."""
        here = partial(draw, *arguments)
        if self._pool is None:
            return here
        return partial(_finish, self._pool.submit(draw, *arguments), here)

    @contextmanager
    def employ(self, worker: Any, *arguments: Any) -> Iterator[Callable[..., None]]:
        """Send `worker` to the second process, and yield a function `call(name,
        *values)` that calls its methods there while this process goes on. Its methods
        `open`, with `arguments`, and `close` are called first and last.

        If there is no second process or no SharedArray, a thread takes its part. At
        most WAITING calls wait. An error of a call is raised by a later call or at the
        end; then the second process ends, so that it writes nothing any more.
        """
        executor: Any = self._pool
        if executor is None or not _shares_memory:
            executor = _Thread(1)
        waiting = deque[Future[None]]()

        def submit(function: Callable[..., None], *values: Any) -> None:
            if len(waiting) == WAITING:
                result_of(waiting.popleft())
            waiting.append(executor.submit(function, *values))

        try:
            submit(_open, worker, *arguments)
            yield partial(submit, _call)
            submit(_call, "close")
            for call in waiting:
                result_of(call)
        except BaseException as error:
            executor.kill()
            self._pool = None
            if isinstance(error, BrokenExecutor):
                raise SimulationError(
                    "the process that encodes the film was ended by something else"
                    f" ({error}), perhaps for lack of memory; film the run again with"
                    " `taichi-disk render`"
                ) from None
            raise
        finally:
            _employed.clear()


class _Thread(ThreadPoolExecutor):
    def kill(self) -> None:
        self.shutdown(cancel_futures=True)


class SharedArray(np.memmap[Any, Any]):
    """An array of bytes in memory that has no name in any folder. If it is pickled,
    another process of the same user sees it, too."""

    def __reduce__(self) -> tuple[Any, ...]:
        return np.memmap, (self.filename, np.uint8, "r", 0, self.shape)


def shared_array(shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return a new SharedArray, or another array if this system has none."""
    global _shares_memory
    try:  # other systems than Linux have none; a sandbox or `ulimit -f` may refuse it
        file = os.fdopen(os.memfd_create("pictures"), "w+b")
        name = f"/proc/{os.getpid()}/fd/{file.fileno()}"
        array = SharedArray(name, np.uint8, "w+", 0, shape)
    except (AttributeError, OSError):
        _shares_memory = False
        return np.empty(shape, np.uint8)
    finalize(array, file.close)
    return array


def _open(worker: Any, *arguments: Any) -> None:
    _employed[:] = [worker]
    worker.open(*arguments)


def _call(name: str, *values: Any) -> None:
    getattr(_employed[0], name)(*values)


def _finish(answer: Future[Any], here: Callable[[], Any]) -> Any:
    try:
        return result_of(answer, _DRAWING_TIME)
    except Exception:  # an error of the drawing itself comes again here
        return here()


@contextmanager
def drawing_process(film: bool) -> Iterator[Artist]:
    """Yield an `Artist` whose process ends with the block. It has a process if a `film`
    is made, or if this process has not imported Matplotlib yet. For a film it tries the
    Vulkan drivers, which may crash."""
    pool = None
    trial = driver_state
    if can_start_python() and (film or "matplotlib" not in sys.modules):
        with suppress(OSError):  # there is no room for another process
            pool = Pool(1)
            if film:
                tried = pool.submit(driver_state)
                trial = partial(result_of, tried, _TRIAL_TIME)
            pool.submit(_import, film)
    try:
        yield Artist(pool, trial)
    finally:
        if pool is not None:
            pool.kill()


def _import(film: bool) -> None:
    gc.disable()  # the process ends before collecting would pay
    import matplotlib.backends.backend_agg
    import matplotlib.figure  # noqa: F401

    if film:
        import av  # noqa: F401

        import taichi_disk.pictures.render.finisher  # noqa: F401
