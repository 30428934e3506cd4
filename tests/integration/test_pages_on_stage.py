"""All that the sandbox's page and a film's page draw, show and send, compared with
recordings (see shown.py)."""

import pytest
from shown import check

from tests.staged import PAGES, played


@pytest.mark.parametrize("name", PAGES)
def test_a_page_draws_shows_and_sends_what_is_recorded(browser, request, name):
    lines = played(browser, PAGES[name]())
    check(name, lines, request.config.getoption("--record"))
