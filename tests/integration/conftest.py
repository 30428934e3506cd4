"""The browsers of all tests, the program that serves the page, runs without plots."""

import os
from contextlib import nullcontext

import pytest

from taichi_disk.pictures.render.artist import drawing_process
from tests.browser import BROWSERS, MISSING_BROWSERS, SETTINGS, ended, serving


@pytest.fixture(scope="session")
def browsers():
    """Return a function that returns the browser of a name as it was at its start."""
    started = {}

    def browser_of(name):
        missing = MISSING_BROWSERS[name]
        if missing and os.environ.get("CI"):
            pytest.fail(f"the page cannot be tested: {missing}")
        if missing:
            pytest.skip(f"the page is not tested: {missing}")
        if name not in started:
            started[name] = BROWSERS[name]()
        started[name].clear()
        return started[name]

    yield browser_of
    for browser in started.values():
        browser.driver.quit()


@pytest.fixture
def browser(browsers):
    return browsers("chromium")


@pytest.fixture(params=BROWSERS)
def each_browser(browsers, request):
    return browsers(request.param)


@pytest.fixture
def served(tmp_path):
    """The program and its address; it must end by a signal without a traceback."""
    settings = (f"--set={one}" for one in SETTINGS)
    with serving(tmp_path, *settings) as (program, url):
        yield program, url
        if program.poll() is None:
            ended(program)


@pytest.fixture(scope="session")
def artist():
    """Return an artist with a second process."""
    with drawing_process(True) as artist:
        yield artist


@pytest.fixture
def one_artist(monkeypatch, artist):
    """Let `artist` draw all films: to start a process takes as long as a film."""
    draws = "taichi_disk.runs.api.drawing_process"
    monkeypatch.setattr(draws, lambda film: nullcontext(artist))


@pytest.fixture
def without_plots(monkeypatch):
    """Leave plot.png empty: to draw it takes longer than most runs of the tests."""
    import matplotlib  # noqa: F401 (then this process draws, which is patched)

    draw = "taichi_disk.runs.api.work.plot_run"
    monkeypatch.setattr(draw, lambda path, *_: path.touch())


@pytest.fixture
def without_figures(monkeypatch):
    """Let sweeps draw no figures: one takes a second."""
    draw = "taichi_disk.studies.figures.drawing.draw"
    monkeypatch.setattr(draw, lambda diagram, out: None)
