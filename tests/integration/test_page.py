"""The page of the sandbox, played with in Chromium and Firefox."""

import random
import signal
import socket
import time
from functools import partial

import numpy as np
import pytest

from taichi_disk import run
from taichi_disk.cli import main
from tests.browser import ended


def test_a_port_that_is_taken_is_named(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        command = ["view", "--set", "lattice.points=60", "--no-open", "--port", port]
        assert main(command) == 2
    message = capsys.readouterr().err
    assert f"port {port}" in message
    assert "--port" in message


@pytest.mark.validate
def test_a_signal_right_after_the_address_ends_the_program(served):
    ended(served[0])


@pytest.mark.validate
def test_a_page_opens_obeys_and_computes_what_run_does(served, each_browser, tmp_path):
    browser = each_browser
    program, url = served
    browser.resize((1366, 768))
    browser.open(url)
    assert browser.colours() > 50  # field, wall, scale
    assert 2 * browser.disk()[1] > 420
    browser.click("more")

    # A slider, a typed number, degrees, a drag that turns the disk, one that aims.
    browser.lead("material.eta_star", 300)
    assert browser.wait(lambda: browser.number("material.eta_star") == 30)
    browser.type("material.eta_star", "2,5")
    assert browser.wait(lambda: browser.setting("eta_star") == 2.5)
    (left, top), disk = browser.disk()
    browser.drag((left, top - 60), (left + 70, top - 20))
    assert browser.wait(lambda: 0.1 < abs(browser.setting("turn")) < 3.0)
    browser.drag((left + disk + 20, top), (left + disk + 50, top + 60))
    aimed = pytest.approx(np.arctan2(30, 60), abs=0.02)
    assert browser.wait(lambda: browser.setting("angle") == aimed)
    browser.type("impact.angle", "0")
    browser.wait(lambda: browser.setting("angle") == 0.0)

    # A space throws it, also from a slider, to the end of `run` in all digits.
    stored = tmp_path / "scene.yaml"
    stored.write_text(browser.script("return sandbox.scene"), encoding="utf-8")
    browser.click("start")
    assert browser.script("return document.activeElement.id") == "drop"
    slider = "[data-key='material.eta_star'] input[type=range]"
    browser.script(f'document.querySelector("{slider}").focus()')
    browser.key(" ")
    (result,) = browser.wait(browser.results, 60.0)
    assert result["value"] == run(stored, lattices=1).restitution
    assert result["disturbance"] == ""

    # A change after it leaves it as it is, and the next throw takes one press.
    browser.say("set", key="material.eta_star", value=1.5)
    browser.wait(lambda: browser.text("status") == "disturbed")
    assert browser.text("drop") == "Throw again"
    browser.key(" ")
    first, second = browser.wait(lambda: browser.results()[1:] and browser.results())
    assert first == result
    assert (second["eta_star"], second["disturbance"]) == (1.5, "")

    # Back in time by a graph and by a key; pulling from there is a disturbance.
    end = browser.state("t")
    browser.drag_in("energy", 0.3, 0.15)
    assert browser.wait(lambda: 0.0 < browser.state("t") < 0.8 * end)
    there = browser.state("t")
    browser.key("\ue012")  # the left arrow
    assert browser.wait(lambda: browser.state("t") < there)
    (left, top), _ = browser.disk()
    browser.drag((left, top), (left + 80, top - 60))
    assert browser.wait(lambda: "disturbed" in browser.text("status"))

    # A film is saved, and the projector shows larger letters until Escape.
    browser.click("film-page")
    browser.key("f")
    assert browser.wait(lambda: browser.script("return sandbox.letters") > 1.1)
    browser.key("\ue00c")
    assert browser.wait(lambda: browser.script("return sandbox.letters") == 1.0)
    page = browser.wait(lambda: browser.downloaded("disk.html"), 60.0)
    assert "states" in page.read_text(encoding="utf-8")
    assert browser.errors() == []
    ended(program)


@pytest.mark.validate
def test_a_page_keeps_its_disk_over_a_reload_and_while_nobody_answers(
    served, each_browser
):
    browser = each_browser
    program, url = served
    browser.open(url)
    browser.click("drop")
    browser.wait(lambda: browser.state("t") > 0.5)
    browser.click("drop")
    browser.wait(lambda: browser.text("drop") == "Go on")
    t = browser.state("t")
    browser.open(url)  # again
    program.send_signal(signal.SIGSTOP)  # as a cable that is pulled: no word, no end
    browser.script("window.dispatchEvent(new Event('online'))")
    browser.wait(lambda: "does not answer" in browser.text("role"))
    program.send_signal(signal.SIGCONT)
    browser.wait(lambda: browser.text("role") == "")
    assert browser.state("t") == t
    assert browser.text("drop") == "Go on"


LAYOUTS = [(1920, 1080), (1400, 900), (1024, 768), (768, 1024), (390, 844), (844, 390)]
# Whether the picture has the size of its place: a busy browser draws it later.
IS_DRAWN = """
const { canvas, width, height } = window.sandbox.drawing;
return canvas.clientWidth === width && canvas.clientHeight === height;
"""


@pytest.mark.validate
def test_each_layout_is_free_of_overlaps_and_small_letters_and_targets(served, browser):
    from axe_selenium_python import Axe

    def faults():
        time.sleep(0.3)
        browser.wait(lambda: browser.script(IS_DRAWN))
        return browser.script(FAULTS)

    def serious():
        found = [
            (one["id"], one["nodes"][0]["html"][:200])
            for one in axe.run()["violations"]
            if one["impact"] in ("serious", "critical")
        ]
        browser.close_lists()
        return found

    browser.open(served[1])
    browser.say("set", key="speed", value=20)
    browser.click("drop")
    browser.wait(browser.results, 60.0)  # the disk has risen, and its read-out is long
    for size in LAYOUTS:
        browser.resize(size)
        for tab in ("experiment", "view", "graphs", "results"):
            browser.script(f"window.sandbox.showTab('{tab}')")
            assert faults() == [], (size, tab)
        browser.script("window.sandbox.project(true)")
        assert faults() == [], (size, "projector")
        browser.script("window.sandbox.project(false)")
    axe = Axe(browser.driver)
    axe.inject()
    browser.resize(LAYOUTS[0])
    for theme in ("light", "dark"):
        browser.choose("video.theme", theme)
        assert serious() == [], (theme, "results")
        for opening in ("scenes", "help"):
            browser.click(opening)
            assert serious() == [], (theme, opening)


FAULTS = """
const found = [];
const box = (one) => one.getBoundingClientRect();
const root = document.documentElement;
const start = (one) => one.outerHTML.slice(0, 80);
if (root.scrollWidth > innerWidth || root.scrollHeight > innerHeight)
  found.push("the page scrolls");
const seen = [...document.querySelectorAll("main *")].filter((one) =>
  one.checkVisibility({ visibilityProperty: true }) && !one.closest("dialog"));
for (const one of seen) {
  const hasWords = (node) => node.nodeType === 3 && node.data.trim();
  const size = parseFloat(getComputedStyle(one).fontSize);
  if ([...one.childNodes].some(hasWords) && size < 12)
    found.push("small letters: " + start(one));
}
const controls = seen.filter((one) => one.matches("button, select, input"));
for (const one of controls) {
  const { width, height } = box(one.closest("label") ?? one);
  if (width < 43.9 || height < 43.9)
    found.push(`small target ${width} x ${height}: ${start(one)}`);
}
const across = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left);
const down = (a, b) => Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
const place = (one) => one.closest("section, nav, header");
const names = ["caption", "message", "sentence", "role", "status"];
const texts = names.map((id) => document.getElementById(id));
const words = texts.filter((one) => seen.includes(one) && one.textContent);
const things = [...controls, ...words];
things.forEach((one, k) => things.slice(0, k).forEach((other) => {
  const width = across(box(one), box(other));
  const height = down(box(one), box(other));
  if (place(one) === place(other) && width >= 1 && height >= 1)
    found.push("overlap: " + start(one) + " and " + start(other));
}));
const { drawing, state } = window.sandbox, { left, top } = box(drawing.canvas);
const [x, y] = drawing.toScreen(state.row.com_x, state.row.com_y);
const legend = top + 2 * drawing.middle[1];
for (const one of texts.slice(0, 2).filter((text) => text.textContent).map(box)) {
  const dx = Math.max(one.left - left - x, left + x - one.right, 0);
  const dy = Math.max(one.top - top - y, top + y - one.bottom, 0);
  if (Math.hypot(dx, dy) < drawing.camera.scale) found.push("a text is on the disk");
  if (one.bottom > legend) found.push("a text is on the legend");
}
return found;
"""
# A control by chance: a slider is led, a choice made, a button pressed unless it saves
# a file. Arguments: which control, and which of its values, from 0 to 1.
ANY_CONTROL = """
const [which, part] = arguments;
const controls = [...document.querySelectorAll("main button, main input, main select")];
const all = controls.filter((one) => one.checkVisibility());
const one = all[Math.floor(which * all.length)];
if (!one) return;
if (one.type === "range") {
  one.value = Number(one.min) + 0.6 * part * (one.max - one.min);
  one.dispatchEvent(new Event("change"));
} else if (one.matches("select")) {
  one.selectedIndex = Math.floor(part * one.length);
  one.onchange();
} else if (!/picture|film|yaml|csv/.test(one.id)) one.click();
"""
# Delete, Tab, Enter, Escape, arrows and others, as selenium writes them
OTHER_KEYS = "\ue003\ue006\ue00c\ue012\ue013\ue014\ue015"
ANY_KEY = [*"rhbnlxedazjksfycotiug ?5", *OTHER_KEYS]
EVENTS = 6  # for each scene
# A disk may be large by now, and its state is computed before the next event.
ANSWER_TIME = 60.0


def interfere(browser, choose):
    """Do one thing that a user may do."""
    kind = choose.random()
    if kind < 0.3:
        browser.key(choose.choice(ANY_KEY), choose.choice([0.02, 0.4]))
    elif kind < 0.6:
        ends = [(choose.randrange(1, 990), choose.randrange(60, 750)) for _ in range(2)]
        button = choose.choice([0, 0, 2])
        is_touch = choose.random() < 0.3
        browser.drag(*ends, pause=0.05, button=button, touch=is_touch)
    elif kind < 0.85:
        browser.script(ANY_CONTROL, choose.random(), choose.random())
    elif kind < 0.9:
        browser.resize((choose.randrange(200, 1600), choose.randrange(200, 1100)))
        browser.resize((1000, 760))
    else:
        browser.close_lists()


def answers_after(browser, number):
    return browser.state("number") > number


@pytest.mark.validate
def test_anything_that_a_user_does_to_any_scene_leaves_the_page_alive(served, browser):
    program, url = served
    browser.open(url)
    choose = random.Random(3)
    for number in range(browser.script("return sandbox.hello.playlist.length")):
        browser.say("play", number=number)
        browser.say("press", key="space")
        for _ in range(EVENTS):
            interfere(browser, choose)
            assert program.poll() is None, f"scene {number}"
        browser.close_lists()
        before = browser.state("number")
        browser.say("press", key="r")
        assert browser.wait(partial(answers_after, browser, before), ANSWER_TIME)
        message = browser.script("return sandbox.panel.message")
        assert browser.errors() == [], f"scene {number}"
        assert "error of the program" not in message, f"scene {number}: {message}"
        assert browser.script("return sandbox.ui.fault.hidden")
    ended(program, signal.SIGINT)


@pytest.mark.validate
def test_a_swipe_of_a_finger_does_not_leave_the_page(served, browser):
    browser.open(served[1])
    for height in range(80, 740, 60):
        browser.drag((20, height), (980, height), pause=0.05, touch=True)
    assert browser.driver.current_url == served[1]
