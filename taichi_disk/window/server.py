"""The sandbox as a page: one server, and a sandbox for each page.

`websockets` serves the page's files and its messages. `door.py` decides who may come.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import socket
import sys
import webbrowser
from contextlib import suppress
from functools import partial
from ipaddress import ip_address
from threading import Thread
from urllib.parse import urlsplit

from websockets.asyncio import server
from websockets.frames import CloseCode

from taichi_disk.errors import InputError
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.audience import MAX_SEATS, Audience, Full
from taichi_disk.window.controls import Preset
from taichi_disk.window.door import Door, bracketed, new_token, split_origin
from taichi_disk.window.session import MAX_BYTES, Common

LOCAL_HOST = "127.0.0.1"
_EVERYWHERE = ("0.0.0.0", "::")  # hosts that stand for all addresses of the machine
# An address of documentation by family: to connect a UDP socket there sends nothing.
_PROBES = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}
_POLL_INTERVAL = 0.1  # time between two checks for a signal [s]
_CLOSE_TIME = 0.5  # time that pages get for saying goodbye at the end [s]


def serve(
    playlist: list[Preset],
    host: str = LOCAL_HOST,
    port: int = 0,
    open_browser: bool = False,
    origin: str = "",
    disks: int = MAX_SEATS,
) -> None:
    """Serve the sandbox until Ctrl-C, at a free port if `port` is 0.

    Prints the address, with the token that every request needs. `origin`: public
    address of the page behind a reverse proxy, "" for none. `disks`: most pages that
    can play. Raises InputError if the server cannot listen there, KeyboardInterrupt
    after Ctrl-C.
    """
    public, path = split_origin(origin) if origin else ("", "")
    listening = _listen(host, port)
    token = new_token()
    bound_port = listening.getsockname()[1]
    roots = [f"http://{name}:{bound_port}" for name in _names(host, listening)]
    if public:
        roots = [public + path]
    addresses = [f"{root}/{token}/" for root in roots]
    is_shared = bool(public) or not _is_local(listening)
    common = Common(playlist, KernelCache(), addresses[0] if is_shared else "")
    audience = Audience(common, max_seats=disks)
    # A pass of the garbage collector over all modules would hold up the disks.
    gc.collect()
    gc.freeze()
    print("the sandbox is at", "\n               or ".join(addresses))
    print("Ctrl-C ends it", flush=True)
    if is_shared:
        _print_code(addresses[0])
        print(
            "note: whoever has this address and reaches this machine can play; nothing"
            " is encrypted by this program",
            flush=True,
        )
    if open_browser:
        # A browser in the foreground returns when it is closed.
        Thread(target=webbrowser.open, args=addresses[:1], daemon=True).start()
    try:
        asyncio.run(run(audience, Door(token, public), listening))
    finally:
        if audience.ignored:
            print(
                f"note: {audience.ignored} malformed messages were ignored",
                file=sys.stderr,
            )


# ---- addresses


def _print_code(address: str) -> None:
    """Print a QR code of the address, if a terminal can show it."""
    try:
        "█▀▄".encode(sys.stdout.encoding)
    except (UnicodeEncodeError, LookupError, TypeError):
        return
    if sys.stdout.isatty():
        import segno  # an import that few need

        segno.make(address, error="l", micro=False).terminal(compact=True)


def _listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens at a name or address, of IPv4 if it has one.

    Raises InputError if it cannot listen there.
    """
    if not host:
        raise InputError(
            "--host is empty: write 127.0.0.1 for this machine alone, or 0.0.0.0 for"
            " everybody who can reach it"
        )
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        found.sort(key=lambda one: one[0] != socket.AF_INET)
        family, *_, address = found[0]
        return socket.create_server(address, family=family)
    except (OSError, OverflowError, UnicodeError) as error:
        raise InputError(
            f"cannot listen at {host}, port {port}: {error}; choose another --host or"
            " --port"
        ) from None


def _is_local(listening: socket.socket) -> bool:
    """Whether only this machine can reach the server."""
    return _is_loopback(listening.getsockname()[0])


def _is_loopback(address: str) -> bool:
    return ip_address(address.partition("%")[0]).is_loopback


def _names(host: str, listening: socket.socket) -> list[str]:
    """Return the names and addresses of the server, as they stand in a URL."""
    if listening.getsockname()[0] not in _EVERYWHERE:
        return [bracketed(host)]
    own = _own_addresses(listening.family)
    return [*map(bracketed, own), socket.gethostname()]


def _own_addresses(family: int) -> list[str]:
    """Return the addresses at which others reach this machine: the one it uses for the
    internet, then those of its name."""
    found: dict[str, None] = {}
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((_PROBES[socket.AddressFamily(family)], 9))
        found[probe.getsockname()[0]] = None
    with suppress(OSError):
        rows = socket.getaddrinfo(socket.gethostname(), None, family)
        found |= dict.fromkeys(str(address[0]) for *_, address in rows)
    return [one for one in found if not _is_loopback(one)]


# ---- serving


async def run(audience: Audience, door: Door, listening: socket.socket) -> None:
    """Serve until a signal, which raises KeyboardInterrupt, or until an error has ended
    `audience`."""
    # what strangers send is not logged
    logger = logging.Logger("page", logging.CRITICAL + 1)
    serving = await server.serve(
        partial(_meet, audience),
        sock=listening,
        process_request=door.answer,
        max_size=MAX_BYTES,
        close_timeout=_CLOSE_TIME,
        compression=None,
        server_header=None,
        logger=logger,
    )
    playing = asyncio.create_task(audience.run())
    compiling = asyncio.create_task(audience.compile())
    try:
        while not playing.done():
            raise_if_interrupted()
            await asyncio.wait([playing], timeout=_POLL_INTERVAL)
        playing.result()
    finally:
        compiling.cancel()
        serving.close()
        # Connections that have asked for nothing yet would be waited for.
        closed = asyncio.ensure_future(serving.wait_closed())
        await asyncio.wait([closed], timeout=2.0 * _CLOSE_TIME)


async def _meet(audience: Audience, connection: server.ServerConnection) -> None:
    request = connection.request
    key = urlsplit(request.path).query if request else ""
    try:
        await audience.prepare(key)
        page = audience.join(
            partial(server.broadcast, [connection]),
            connection.transport.get_write_buffer_size,
            key,
        )
    except Full as full:
        await connection.close(CloseCode.TRY_AGAIN_LATER, str(full))
        return
    try:
        async for text in connection:
            audience.hear(page, text)
    finally:
        audience.leave(page)
