"""What the page shows, and what a user's act changes in it: where, how far, which."""

import asyncio
import socket
import time
from threading import Thread

import pytest

from taichi_disk import load_scene
from taichi_disk.base import runtime
from taichi_disk.sandbox import server
from taichi_disk.sandbox.app import list_presets
from taichi_disk.sandbox.history import Timeline, start_of
from tests.browser import SETTINGS

HOST = ("127.0.0.1", 0)


@pytest.fixture(scope="module")
def address():
    """Return the address of a server that shares its kernels with other tests."""
    runtime.start()
    playlist = list_presets(load_scene("exponential_wall", SETTINGS))
    sessions = server.Sessions(playlist)
    for entry in (playlist[0], playlist[3]):
        # the thread of the server cannot compile
        Timeline(start_of(entry.load()))
    loop = asyncio.new_event_loop()
    with pytest.MonkeyPatch.context() as patch, socket.create_server(HOST) as listening:
        patch.setattr(server, "QUIET_TIME", 100.0)
        serving = loop.create_task(server.run(sessions, "secret", listening))
        thread = Thread(target=loop.run_until_complete, args=[asyncio.wait([serving])])
        thread.start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}/secret/"
        loop.call_soon_threadsafe(serving.cancel)
        thread.join()
        loop.close()


@pytest.fixture
def browser(browsers, address):
    """The page as a new visitor sees it."""
    browser = browsers("chromium")
    browser.open(address)
    return browser


def entry(browser):
    """Return the number of the list's entry that is marked as the present one."""
    return browser.script(
        "return document.querySelector('#entries [aria-current=true]').dataset.play"
    )


def test_a_drag_of_40_pixels_moves_the_disk_by_40_and_a_scene_chosen_is_thrown_by_space(
    browser,
):
    (x, y), radius = browser.disk()
    browser.drag((x + radius + 30, y), (x + radius + 70, y + 25), 0.05, button=2)
    assert browser.disk() == ((x + 40, y + 25), radius)
    browser.click("all")
    assert browser.wait(lambda: browser.disk() == ((x, y), radius))
    browser.type("impact.velocity", "1/50")
    browser.wait(lambda: browser.setting("velocity") == 0.02)
    assert entry(browser) == "0"
    browser.driver.find_element("id", "scenes").click()
    assert browser.script("return document.getElementById('list').open")
    browser.driver.find_element("css selector", "#entries [data-play='3']").click()
    browser.wait(lambda: browser.text("sentence").endswith("?"))
    browser.wait(lambda: entry(browser) == "3")
    assert not browser.script("return document.getElementById('list').open")
    assert browser.script("return sandbox.panel.paused")
    browser.key(" ")
    browser.wait(lambda: not browser.script("return sandbox.panel.paused"))
    browser.wait(lambda: browser.state("t") > 0.0)
    assert browser.colours() > 50  # field, wall, scale
    assert browser.errors() == []


STRETCHED = """
return [...document.querySelectorAll("canvas")].filter((one) =>
  one.checkVisibility() && Math.abs(
  one.width / one.height / one.clientWidth * one.clientHeight - 1) > 0.03).length"""


@pytest.mark.validate
def test_on_paper_are_the_picture_the_parameters_and_the_curves_unstretched(browser):
    browser.choose("video.theme", "dark")
    ground = "return getComputedStyle(document.querySelector('main')).backgroundColor"
    browser.wait(lambda: browser.script(ground) == "rgb(13, 14, 17)")
    browser.script("window.dispatchEvent(new Event('beforeprint'))")
    assert browser.script(ground) == "rgb(250, 250, 248)"
    browser.emulate(media="print")
    assert browser.script(STRETCHED) == 0
    for name in ("disk", "caption", "energy", "motion", "material.eta_star"):
        assert browser.visible(name), name
    for name in ("drop", "help", "forces"):
        assert not browser.visible(name), name
    browser.emulate()
    browser.script("window.dispatchEvent(new Event('afterprint'))")
    assert browser.script(ground) == "rgb(13, 14, 17)"


@pytest.mark.validate
def test_forced_colours_leave_the_picture_and_the_curves_on_their_own_ground(browser):
    dark = {"name": "prefers-color-scheme", "value": "dark"}
    browser.emulate(features=[{"name": "forced-colors", "value": "active"}, dark])
    browser.resize((1280, 900))
    style = "getComputedStyle(document.querySelector('.plot > i'))"  # beside the ground
    colour = f"return document.querySelector('.plot > i') && {style}.color"
    assert browser.wait(lambda: browser.script(colour) == "rgb(255, 255, 255)")
    themes = browser.script("return sandbox.drawing.scene.themes")
    for name in (".stage", ".plot"):
        style = f"getComputedStyle(document.querySelector('{name}'))"
        ground = browser.script(f"return {style}.backgroundColor")
        assert ground == themes[browser.look("theme")]["ground"]
        assert browser.script(f"return {style}.color") != ground


PROJECTORS = [((1920, 1080), 730), ((3840, 2160), 1450), ((1024, 768), 380)]


@pytest.mark.validate
@pytest.mark.parametrize(("size", "least"), PROJECTORS)
def test_on_a_projector_the_disk_is_large_and_letters_grow_too(browser, size, least):
    browser.resize(size)
    smallest = """
return Math.min(...[...document.querySelectorAll("main *")].filter((one) =>
  one.checkVisibility({ visibilityProperty: true })
  && [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim()))
  .map((one) => parseFloat(getComputedStyle(one).fontSize)))"""
    time.sleep(0.5)
    assert browser.script(smallest) >= 0.009 * size[1]
    assert 12.0 * browser.script("return sandbox.letters") >= 0.009 * size[1]
    browser.script("sandbox.project(true)")
    browser.wait(lambda: browser.visible("timeline"))
    time.sleep(0.5)
    assert 2 * browser.disk()[1] >= least
    assert browser.script(smallest) >= 0.009 * size[1]


@pytest.mark.validate
@pytest.mark.parametrize(("height", "is_open"), [(844, True), (660, False)])
def test_a_phone_begins_with_a_disk_and_if_it_is_tall_with_speed_and_viscosity(
    browser, height, is_open
):
    browser.resize((390, height))
    browser.driver.refresh()
    browser.wait(
        lambda: browser.script("return Boolean(window.sandbox?.drawing.state)")
    )
    time.sleep(0.3)
    shown = (
        "return [...document.querySelectorAll('#numbers input')].filter((one) =>"
        " one.checkVisibility({ visibilityProperty: true })"
        " && one.getBoundingClientRect().bottom < innerHeight).length"
    )
    assert browser.script(shown) == 4 * is_open  # two sliders, two fields
    assert 2 * browser.disk()[1] > 200
    browser.script("document.querySelector('nav [data-tab=experiment]').click()")
    assert browser.wait(lambda: browser.script(shown))


@pytest.mark.validate
@pytest.mark.parametrize("size", [(683, 384), (720, 450), (960, 540)])
def test_at_a_zoom_of_200_per_cent_no_tab_runs_into_the_next(browser, size):
    browser.resize(size)
    time.sleep(0.3)
    overlong = """
return [...document.querySelectorAll("nav button")].filter((one) =>
  one.checkVisibility() && (one.scrollWidth > one.clientWidth + 1
  || one.getBoundingClientRect().right > innerWidth)).map((one) => one.id)"""
    assert browser.script(overlong) == []
    assert browser.script("return document.documentElement.scrollWidth") <= size[0]


def test_no_style_and_no_script_needs_what_chrome_109_lacks():
    from taichi_disk.pictures.web.drawing import source

    names = "style.css film.css index.html film.html sandbox.js page.js graphs.js"
    for name in (*names.split(), "results.js", "film.js"):
        text = source(name).replace("know light-dark()", "")
        assert "light-dark(" not in text, name
        assert ":popover" not in text and "popover=" not in text, name
