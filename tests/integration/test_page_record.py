"""All that the pages draw, show and send, against a record."""

import pytest

from tests.recording import PAGES, differences, played


@pytest.mark.parametrize("name", PAGES)
def test_a_page_draws_shows_and_sends_what_was_recorded(browser, name):
    found = differences(name, played(browser, PAGES[name]()))
    assert not found, (
        "a page has changed. If it should, record it anew with `python -m"
        " tests.recording`, and read the difference:\n" + "\n".join(found[:60])
    )
