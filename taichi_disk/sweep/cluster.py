"""The workers of a Dask cluster, which compute a sweep."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from taichi_disk.errors import InputError, install_extra

REPORTERS = ("distributed.client", "tornado.application")  # loggers
CONNECT_TIMEOUT = 8.0  # how long a scheduler may take to answer [s]


@contextmanager
def dask_executor(address: str, say: Callable[[str], None]) -> Iterator[Executor]:
    """Open an executor whose tasks the workers of the Dask scheduler at `address`
    compute. `say` receives notices about the workers. Raises InputError if no scheduler
    answers."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            f"Dask needs the package distributed: {install_extra('cluster')}"
        ) from None
    try:
        with ThreadPoolExecutor(1) as thread:  # avoids the event loop of a notebook
            identity = thread.submit(asyncio.run, _identity(address)).result()
    except Exception as error:  # a server of another kind may answer anything
        raise InputError(
            f"no Dask scheduler answers at {address} ({error!r:.100}); start one with"
            " `dask scheduler`"
        ) from None
    workers = identity["workers"].values()
    say(f"{len(workers)} Dask workers; while there are none, the sweep waits")
    if any(worker["nthreads"] > 1 for worker in workers):
        say(
            "a worker computes one scene at a time, however many threads it has: start"
            " it with --nworkers N --nthreads 1 to use N cores"
        )
    options: dict[str, Any] = {"timeout": CONNECT_TIMEOUT, "set_as_default": False}
    with _without_reports(), Client(address, **options) as client:
        yield client.get_executor()


@contextmanager
def _without_reports() -> Iterator[None]:
    """Keep Dask's client and its event loop from writing about lost connections, which
    the sweep reports itself."""
    loggers = [logging.getLogger(name) for name in REPORTERS]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


async def _identity(address: str) -> Any:
    """Return what the scheduler says about itself. Unlike `Client`, this does not wait
    for ever for a server of another kind."""
    from distributed import Security
    from distributed.core import rpc

    security = Security().get_connection_args("client")
    async with rpc(address, connection_args=security) as scheduler:
        return await asyncio.wait_for(scheduler.identity(), CONNECT_TIMEOUT)
