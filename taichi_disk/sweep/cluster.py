"""A Dask cluster that computes a sweep."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from taichi_disk.errors import InputError, SimulationError, install_extra

CONNECT_TIMEOUT = 8.0  # how long a scheduler may take to answer [s]


class Cluster:
    """The Dask scheduler at `address` with its workers. `say` receives notices about
    the workers."""

    def __init__(self, address: str, say: Callable[[str], None]) -> None:
        """Raises InputError if no scheduler answers."""
        self._address = address
        self._say = say
        try:
            import distributed  # noqa: F401
        except ImportError:
            raise InputError(
                f"Dask needs the package distributed: {install_extra('cluster')}"
            ) from None
        try:
            workers = self._workers()
        except Exception as error:  # a server of another kind may answer anything
            cause = ""
            if isinstance(error, ValueError):
                cause = f" ({error})"
            raise InputError(
                f"no Dask scheduler answers at {address}{cause}; start one with `dask"
                " scheduler`"
            ) from None
        self._describe(workers)

    def _workers(self) -> list[dict[str, Any]]:
        """Return what the scheduler knows about its workers."""
        with ThreadPoolExecutor(1) as thread:  # avoids the event loop of a notebook
            identity = thread.submit(asyncio.run, self._identity()).result()
        return list(identity["workers"].values())

    async def _identity(self) -> Any:
        from distributed import Security
        from distributed.core import rpc

        security = Security().get_connection_args("client")
        async with rpc(self._address, connection_args=security) as scheduler:
            return await asyncio.wait_for(scheduler.identity(), CONNECT_TIMEOUT)

    def _describe(self, workers: list[dict[str, Any]]) -> None:
        if not workers:
            self._say(f"waiting: the scheduler at {self._address} has no workers")
            return
        self._say(f"{len(workers)} Dask workers")
        if any(worker["nthreads"] > 1 for worker in workers):
            self._say(
                "a worker computes one scene at a time, however many threads it has:"
                " start it with --nworkers N --nthreads 1 to use N cores"
            )

    def watch(self) -> None:
        """Say if there are no workers. Raises SimulationError if the scheduler has
        gone."""
        try:
            workers = self._workers()
        except Exception:
            raise self._gone() from None
        if not workers:
            self._describe(workers)

    def _gone(self) -> SimulationError:
        return SimulationError(
            f"the Dask scheduler at {self._address} has gone; finished points are kept:"
            " start a scheduler and workers, and repeat the command to go on"
        )

    @contextmanager
    def executor(self) -> Iterator[Executor]:
        """Open an executor whose tasks the workers compute. Raises SimulationError if
        the scheduler goes."""
        from distributed import Client
        from distributed.comm.core import CommClosedError

        logger = logging.getLogger("distributed.client")
        level = logger.level
        logger.setLevel(logging.CRITICAL)  # a lost connection is reported below
        try:
            with Client(
                self._address, timeout=CONNECT_TIMEOUT, set_as_default=False
            ) as client:
                yield client.get_executor()
        except (CommClosedError, CancelledError):
            raise self._gone() from None
        finally:
            logger.setLevel(level)
