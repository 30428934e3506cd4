"""What a request to the server gets: a file of the page, the websocket, or a refusal.

A request needs the token in its address, and a websocket needs the page's own origin.
"""

from __future__ import annotations

import secrets
from importlib.resources import files
from urllib.parse import urlsplit

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from taichi_disk.errors import InputError
from taichi_disk.web.drawing import source

SOCKET = "socket"  # name of the websocket, beside the page's files
# text types by file suffix
_TYPES = {"html": "html", "js": "javascript", "css": "css"}
_POLICY = (
    "default-src 'self' data: blob:; connect-src 'self' ws: wss:; style-src 'self'"
    " 'unsafe-inline'"
)
_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": _POLICY,
}
_WRONG_TOKEN = "Use the whole address that `taichi-disk view` printed."
# The page shows this text if its websocket is refused.
_REFUSAL = (
    "the connection came from another address than this page, or without a websocket."
    " Behind a reverse proxy, let it pass Upgrade and X-Forwarded-Host, or start"
    " `taichi-disk view` with --origin."
)


class Door:
    """Answers requests. `token` begins every path; `origin` is where a reverse proxy
    serves the page ("https://example.org"), or "" if no proxy was named."""

    def __init__(self, token: str, origin: str = "") -> None:
        self._token = token
        self._origin = origin

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return a file of the page, or a refusal; None opens the websocket."""
        path = request.path.partition("?")[0]
        first, slash, name = path.removeprefix("/").partition("/")
        if not secrets.compare_digest(first.encode(), self._token.encode()):
            return connection.respond(403, _WRONG_TOKEN)
        is_upgrade = request.headers.get("Upgrade", "").lower() == "websocket"
        if is_upgrade and name == SOCKET and self._is_own(request.headers):
            return None
        if is_upgrade:
            return connection.respond(403, _REFUSAL)
        if name == SOCKET:
            return connection.respond(426, _REFUSAL)
        if not slash:
            response = connection.respond(307, "")
            # relative, because a proxy may serve the page below another path
            response.headers["Location"] = f"{self._token}/"
            return response
        return _file(connection, name or "index.html")

    def _is_own(self, headers: Headers) -> bool:
        """Whether the request comes from the page itself.

        A script of another site can open a websocket here, but it can neither choose
        its Origin nor send headers of its own, such as X-Forwarded-Host.
        """
        origin = headers.get("Origin", "")
        if origin and origin == self._origin:
            return True
        host = origin.partition("://")[2]
        forwarded = headers.get("X-Forwarded-Host", "").split(",")
        hosts = [headers.get("Host", ""), *(name.strip() for name in forwarded)]
        return bool(host) and host in hosts


def _file(connection: ServerConnection, name: str) -> Response:
    kind = _TYPES.get(name.rpartition(".")[2])
    names = {one.name for one in files("taichi_disk.web").iterdir()}
    if not kind or name not in names:
        return connection.respond(404, "There is no such file.")
    response = connection.respond(200, source(name))
    del response.headers["Content-Type"]
    response.headers["Content-Type"] = f"text/{kind}; charset=utf-8"
    response.headers.update(_HEADERS)
    return response


def split_origin(address: str) -> tuple[str, str]:
    """Return the origin of a page's public address, such as "https://example.org", and
    the path below it, without a final slash.

    Raises InputError if the address has no scheme http or https, or no host.
    """
    parts = urlsplit(address)
    is_web = parts.scheme in ("http", "https") and parts.hostname
    if not is_web or parts.query or parts.fragment:
        raise InputError(
            f"--origin {address}: must be the address at which a proxy serves the page,"
            " such as https://example.org or https://example.org/disk"
        )
    return f"{parts.scheme}://{parts.netloc.lower()}", parts.path.rstrip("/")
