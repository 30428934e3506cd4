"""All that pages draw, show and send, compared with recordings (see shown.py)."""

import re
from pathlib import Path

import pytest

from taichi_disk.sandbox.session import read_command
from tests.staged import PAGES, played

LOOKS = Path(__file__).parents[1] / "looks"

FIREFOX = pytest.param("firefox", marks=pytest.mark.validate)


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("kind", ["chromium", FIREFOX])
def test_a_page_draws_shows_and_sends_what_is_recorded(browsers, record, kind, name):
    lines = played(browsers(kind), PAGES[name]())
    record(name, lines)


def test_what_a_page_sends_is_what_the_program_knows():
    recorded = (LOOKS / "page_of_the_sandbox.txt").read_text(encoding="utf-8")
    lines = re.findall(r"(?m)^  send (.+)$", recorded)
    sent = re.findall(r"{.+?}", " ".join(lines))
    assert len(sent) > 50
    assert all(map(read_command, sent))
