"""All that the sandbox's page and a film's page draw, show and send, compared with
recordings (see shown.py)."""

import pytest

from tests.staged import PAGES, played

FIREFOX = pytest.param("firefox", marks=pytest.mark.validate)


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("kind", ["chromium", FIREFOX])
def test_a_page_draws_shows_and_sends_what_is_recorded(browsers, record, kind, name):
    lines = played(browsers(kind), PAGES[name]())
    record(name, lines)
