"""Who may come to the page: tokens, origins, files."""

import re
from pathlib import Path
from urllib.parse import urljoin

import pytest
from websockets.datastructures import Headers
from websockets.server import ServerProtocol

from taichi_disk.errors import InputError
from taichi_disk.window import door
from taichi_disk.window.door import Door, new_token, split_origin

WEB = Path(__file__).parents[2] / "taichi_disk" / "web"
TOKEN = "secret99"
SOCKET = f"/{TOKEN}/socket"
HERE = "127.0.0.1:1"
PUBLIC = "https://example.org"
PAGE = {"Upgrade": "websocket", "Host": HERE, "Origin": f"http://{HERE}"}


class Request:
    """What `websockets` knows of a request."""

    def __init__(self, path, **headers):
        self.path = path
        self.headers = Headers(**headers)


class Connection:
    respond = staticmethod(ServerProtocol().reject)

    def __init__(self, machine="192.0.2.7"):
        self.remote_address = (machine, 4711)


def answered(path, a_door=None, machine="192.0.2.7", **headers):
    asked = a_door or Door(TOKEN)
    request = Request(path, **headers)
    return asked.answer(Connection(machine), request)


def knock(path, a_door=None, **headers):
    """The status of the answer; 101 where a websocket is opened."""
    response = answered(path, a_door, **headers)
    return response.status_code if response else 101


def test_a_token_is_easily_typed_and_hard_to_guess():
    tokens = {new_token() for _ in range(1000)}
    assert len(tokens) == 1000
    letters = set("".join(tokens))
    assert all(len(one) == 8 and one == one.lower() for one in tokens)
    assert not letters & set("01ilo") and len(letters) ** 8 > 0.7 * 2**40


@pytest.mark.parametrize(
    "path",
    ["/", "//", "/secret9/", "/secret999/", f"//{TOKEN}/", "/ü/", "*", "/secre%7499/"],
)
def test_without_the_token_nothing_is_served(path):
    assert knock(path) == 403
    assert knock(path, **PAGE) == 403
    assert knock(f"/{TOKEN.upper()}/") == 200  # it may be typed in capitals


def test_whoever_guesses_must_wait_and_nobody_else(monkeypatch):
    now = 1000.0
    monkeypatch.setattr(door, "monotonic", lambda: now)
    asked = Door(TOKEN)
    for _ in range(50):  # what a browser asks for by itself is no guess
        assert knock("/favicon.ico", asked) == 403
    for k in range(door.MAX_WRONG):
        assert knock(f"/secret{k:02}/", asked) == 403
    assert knock("/secret98/", asked) == knock(f"/{TOKEN}/", asked) == 429
    assert knock(f"/{TOKEN}/", asked, machine="192.0.2.8") == 200
    now += door.PERIOD + 1.0
    assert knock(f"/{TOKEN}/", asked) == 200
    assert knock("/secret98/", asked) == 403


@pytest.mark.parametrize(
    ("public", "path", "origin", "status"),
    [
        ("", SOCKET, f"http://{HERE}", 101),
        ("", SOCKET, "http://evil.example", 403),
        ("", SOCKET, f"http://{HERE}2", 403),
        ("", SOCKET, f"https://{HERE}", 403),
        ("", SOCKET, "null", 403),
        ("", SOCKET, "", 403),
        ("", f"/{TOKEN}/", f"http://{HERE}", 403),
        (PUBLIC, SOCKET, PUBLIC, 101),  # behind a proxy
        (PUBLIC, SOCKET, f"http://{HERE}", 403),
        (PUBLIC, SOCKET, "http://example.org", 403),
    ],
)
def test_a_websocket_is_for_the_page_s_own_origin(public, path, origin, status):
    a_door = Door(TOKEN, public) if public else Door(TOKEN)
    headers = {"Upgrade": "WebSocket", "Host": HERE, "Origin": origin}
    assert knock(path, a_door, **headers) == status


@pytest.mark.parametrize("name", ["Host", "Origin", "Upgrade"])
def test_a_header_that_comes_twice_is_no_error(name):
    request = Request(SOCKET, **PAGE)
    request.headers[name] = "evil.example"
    response = Door(TOKEN).answer(Connection(), request)
    status = response.status_code if response else 101
    assert status == (101 if name == "Upgrade" else 403)


def test_a_wrong_address_leads_further():
    plain = answered(SOCKET)  # no websocket is asked for
    assert plain.status_code == 426
    assert b"Upgrade" in plain.body
    assert b"--origin" in plain.body
    without_slash = answered(f"/{TOKEN}")
    assert without_slash.status_code == 307
    public = f"https://example.org/disk/{TOKEN}"  # below any path
    assert urljoin(public, without_slash.headers["Location"]) == f"{public}/"


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


@pytest.mark.parametrize(
    ("address", "origin"),
    [
        ("https://A.org/disk/", ("https://a.org", "/disk")),
        ("https://example.org:443", (PUBLIC, "")),
        ("HTTP://Example.org:80/", ("http://example.org", "")),
        ("https://example.org:80", (f"{PUBLIC}:80", "")),
        ("http://[2001:DB8::1]:8000/a", ("http://[2001:db8::1]:8000", "/a")),
    ],
)
def test_an_origin_is_written_as_browsers_send_it(address, origin):
    assert split_origin(address) == origin


NO_ORIGINS = "example.org ftp://a http:// http://a?b http://a#b http://[::1"
MORE = "http://a:99999 https://me:word@example.org https://bücher.example"


@pytest.mark.parametrize("address", [*NO_ORIGINS.split(), *MORE.split()])
def test_an_origin_that_no_browser_sends_is_refused(address):
    with pytest.raises(InputError, match="--origin"):
        split_origin(address)
