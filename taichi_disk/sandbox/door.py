"""What a request to the server gets: a file of the page, the websocket, or a refusal.

A request needs the token in its address, and a websocket needs the page's own origin.
"""

from __future__ import annotations

import secrets
from importlib.resources import files

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from taichi_disk.pictures.web.drawing import source

SOCKET = "socket"  # name of the websocket, beside the page's files
# text types by file suffix
_TYPES = {"html": "html", "js": "javascript", "css": "css"}
_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": (
        "default-src 'self' data: blob:; connect-src 'self' ws: wss:; style-src 'self'"
        " 'unsafe-inline'"
    ),
}
# The page shows this text if its websocket is refused.
_REFUSAL = (
    "the connection came from another address than this page, or without a websocket:"
    " a proxy must pass on Host and Upgrade."
)


def answer(
    token: str, connection: ServerConnection, request: Request
) -> Response | None:
    """Return a file of the page, or a refusal; None opens the websocket. Every path
    begins with the token."""
    path = request.path.partition("?")[0]
    first, slash, name = path.removeprefix("/").partition("/")
    if not secrets.compare_digest(first.encode(), token.encode()):
        return connection.respond(
            403, "Use the whole address that `taichi-disk view` printed."
        )
    upgrades = [one.lower() for one in request.headers.get_all("Upgrade")]
    is_upgrade = "websocket" in upgrades
    if is_upgrade and name == SOCKET and _is_own(request.headers):
        return None
    if is_upgrade or name == SOCKET:
        return connection.respond(403, _REFUSAL)
    if not slash:
        response = connection.respond(307, "")
        response.headers["Location"] = f"{token}/"
        return response
    return _file(connection, name or "index.html")


def _is_own(headers: Headers) -> bool:
    """Whether a request comes from the page itself: a script of another site can open a
    websocket here, but cannot choose its Origin."""
    hosts = headers.get_all("Host")  # a proxy may serve it by https
    origins = [one.partition("://")[2] for one in headers.get_all("Origin")]
    return bool(hosts) and origins == hosts


def _file(connection: ServerConnection, name: str) -> Response:
    kind = _TYPES.get(name.rpartition(".")[2])
    names = {one.name for one in files("taichi_disk.pictures.web").iterdir()}
    if not kind or name not in names:
        return connection.respond(404, "There is no such file.")
    response = connection.respond(200, source(name))
    # an assignment alone adds a second header
    del response.headers["Content-Type"]
    response.headers["Content-Type"] = f"text/{kind}; charset=utf-8"
    response.headers.update(_HEADERS)
    return response
