"""What a request to the server gets: a file of the page, the websocket, or a refusal.

A request needs the token in its address, and a websocket needs the page's own origin.
"""

from __future__ import annotations

import secrets
from collections import Counter
from importlib.resources import files
from time import monotonic
from urllib.parse import urlsplit

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from taichi_disk.errors import InputError
from taichi_disk.web.drawing import source

# Characters of a token, which somebody types into a phone: no two look alike.
ALPHABET = "23456789abcdefghjkmnpqrstuvwxyz"
TOKEN_LENGTH = 8
# wrong tokens from one machine, after which it has to wait until the end of the period
MAX_WRONG = 10
PERIOD = 60.0  # [s]
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
_TOO_MANY = "Too many wrong addresses came from your machine: try again in a minute."
# The page shows this text if its websocket is refused.
_REFUSAL = (
    "the connection came from another address than this page, or without a websocket."
    " Behind a reverse proxy, let it pass Upgrade, and start `taichi-disk view` with"
    " --origin."
)
_PORTS = {"http": 80, "https": 443}  # which browsers leave out of an origin


def new_token() -> str:
    """Return a random token of 40 bits."""
    return "".join(secrets.choice(ALPHABET) for _ in range(TOKEN_LENGTH))


class Door:
    """Answers requests. `token` begins every path; `origin` is where a reverse proxy
    serves the page ("https://example.org"), or "" if there is no proxy."""

    def __init__(self, token: str, origin: str = "") -> None:
        self._token = token
        self._origin = origin
        self._wrong: Counter[str] = Counter()  # wrong tokens by machine
        self._period_ends = 0.0

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return a file of the page, or a refusal; None opens the websocket."""
        path = request.path.partition("?")[0]
        first, slash, name = path.removeprefix("/").partition("/")
        refusal = self._refusal(first.lower(), str(connection.remote_address[0]))
        if refusal:
            return connection.respond(*refusal)
        upgrades = [one.lower() for one in request.headers.get_all("Upgrade")]
        is_upgrade = "websocket" in upgrades
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

    def _refusal(self, token: str, machine: str) -> tuple[int, str] | None:
        """Return status and text for a request with a wrong token, or from a machine
        that guesses tokens; None for all others."""
        now = monotonic()
        if now > self._period_ends:
            self._period_ends = now + PERIOD
            self._wrong.clear()
        if self._wrong[machine] >= MAX_WRONG:
            return 429, _TOO_MANY
        if secrets.compare_digest(token.encode(), self._token.encode()):
            return None
        # browsers ask for /favicon.ico, which is no guess
        if len(token) == TOKEN_LENGTH:
            self._wrong[machine] += 1
        return 403, _WRONG_TOKEN

    def _is_own(self, headers: Headers) -> bool:
        """Whether the request comes from the page itself: a script of another site can
        open a websocket here, but cannot choose its Origin."""
        origins = [self._origin]
        if not self._origin:
            origins = [f"http://{host}" for host in headers.get_all("Host")]
        return len(origins) == 1 and headers.get_all("Origin") == origins


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
    """Return the origin of a page's public address as browsers send it, such as
    "https://example.org", and the path below it, without a final slash.

    Raises InputError if the address is none of the web, or has more parts.
    """
    try:
        parts = urlsplit(address)
        port = parts.port
    except ValueError:
        parts = urlsplit("")
        port = None
    host = parts.hostname or ""
    rest = parts.query or parts.fragment or parts.username
    if parts.scheme not in _PORTS or not host or not host.isascii() or rest:
        raise InputError(
            f"--origin {address}: must be the address at which a proxy serves the page,"
            " such as https://example.org or https://example.org/disk, with the name"
            " of the host as a browser sends it: xn--… for one of other letters"
        )
    origin = f"{parts.scheme}://{bracketed(host)}"
    if port not in (None, _PORTS[parts.scheme]):
        origin += f":{port}"
    return origin, parts.path.rstrip("/")


def bracketed(host: str) -> str:
    """Return a name or an IP address as it stands in a URL."""
    return f"[{host}]" if ":" in host else host
