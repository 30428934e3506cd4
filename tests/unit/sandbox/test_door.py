"""Who may come to the page: token, origin, files."""

import re
from pathlib import Path
from urllib.parse import urljoin

import pytest
from websockets.datastructures import Headers
from websockets.server import ServerProtocol

from taichi_disk.sandbox.door import answer

WEB = Path(__file__).parents[3] / "taichi_disk" / "pictures" / "web"
TOKEN = "secret99"
SOCKET = f"/{TOKEN}/socket"
HERE = "127.0.0.1:1"
PAGE = {"Upgrade": "websocket", "Host": HERE, "Origin": f"http://{HERE}"}


class Request:
    """What `websockets` knows of a request."""

    def __init__(self, path, **headers):
        self.path = path
        self.headers = Headers(**headers)


class Connection:
    respond = staticmethod(ServerProtocol().reject)


def answered(path, **headers):
    return answer(TOKEN, Connection(), Request(path, **headers))


def knock(path, **headers):
    """The status of the answer; 101 where a websocket is opened."""
    response = answered(path, **headers)
    return response.status_code if response else 101


@pytest.mark.parametrize(
    "path",
    ["/", "//", "/secret9/", "/secret999/", f"//{TOKEN}/", "/ü/", "*", "/secre%7499/"],
)
def test_without_the_token_nothing_is_served(path):
    assert knock(path) == 403
    assert knock(path, **PAGE) == 403
    assert knock(f"/{TOKEN}/") == 200


@pytest.mark.parametrize(
    ("path", "origin", "status"),
    [
        (SOCKET, f"http://{HERE}", 101),
        (SOCKET, "http://evil.example", 403),
        (SOCKET, f"http://{HERE}2", 403),
        (SOCKET, f"https://{HERE}", 101),  # behind a proxy
        (SOCKET, "null", 403),
        (SOCKET, "", 403),
        (f"/{TOKEN}/", f"http://{HERE}", 403),
    ],
)
def test_a_websocket_is_for_the_page_s_own_origin(path, origin, status):
    headers = {"Upgrade": "WebSocket", "Host": HERE, "Origin": origin}
    assert knock(path, **headers) == status


def test_without_a_host_no_websocket_is_opened():
    assert knock(SOCKET, Upgrade="websocket") == 403


@pytest.mark.parametrize("name", ["Host", "Origin", "Upgrade"])
def test_a_header_that_comes_twice_is_no_error(name):
    request = Request(SOCKET, **PAGE)
    request.headers[name] = "evil.example"
    response = answer(TOKEN, Connection(), request)
    status = response.status_code if response else 101
    assert status == (101 if name == "Upgrade" else 403)


def test_a_wrong_address_leads_further():
    plain = answered(SOCKET)  # no websocket is asked for
    assert plain.status_code == 403
    without_slash = answered(f"/{TOKEN}")
    assert without_slash.status_code == 307
    address = f"http://{HERE}/{TOKEN}"
    assert urljoin(address, without_slash.headers["Location"]) == f"{address}/"


def test_the_page_s_own_files_are_served_and_no_others():
    response = answered(f"/{TOKEN}/")
    assert response.status_code == 200
    index = (WEB / "index.html").read_bytes()
    assert response.body == index
    assert response.headers["Content-Type"] == "text/html; charset=utf-8"
    linked = re.findall(r'(?:src=|href=)"([\w.]+)"', index.decode())
    assert "style.css" in linked
    for name in {*linked, *(one.name for one in WEB.glob("*.js"))}:
        assert knock(f"/{TOKEN}/{name}") == 200
    others = ("drawing.py", "../cli.py", "%2e%2e/cli.py", "9" * 4000, "./page.js")
    for name in others:
        assert knock(f"/{TOKEN}/{name}") == 404
