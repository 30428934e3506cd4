"""The HTML film: a small file that needs no network, and in a real browser plays and
shows the computed data."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from taichi_disk import api, load_scene
from taichi_disk.cli import main
from taichi_disk.fields import QUANTITIES
from taichi_disk.web import drawing
from tests.browser import MISSING, Browser

WEB = Path(drawing.__file__).parent


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a run without film, and its HTML film."""
    folder = tmp_path_factory.mktemp("html") / "run"
    scene = load_scene(
        "oblique_impact", ["lattice.points=150", "video.fps=10", "video.seconds=3"]
    )
    api.run(scene, folder, video=False, lattices=1)
    assert (
        main(
            [
                "render",
                str(folder),
                "--out",
                str(folder / "film.html"),
                "--from",
                "contact",
            ]
        )
        == 0
    )
    return folder


def packed(path):
    """Return the JSON and the bytes in a film."""
    text = re.search(r'id="states">([^<]*)<', path.read_text())[1]
    data = zlib.decompress(base64.b64decode(text))
    length = int(np.frombuffer(data[:4], "<u4")[0])
    return json.loads(data[4 : 4 + length]), data[4 + length :]


def test_a_film_is_one_file_that_fetches_nothing_and_carries_its_scene(folder):
    text = (folder / "film.html").read_text()
    assert not re.search(r'(src|href)="|import\s*[{("]|https?://|@import|url\(', text)
    assert "scene: exponential_wall" in text
    assert "spin: 0.4" in text


def test_states_survive_the_packing_to_a_thousandth_of_r(folder):
    film, data = packed(folder / "film.html")
    run = film["runs"][0]
    result = api.Result.load(folder, estimate=False)
    n = run["scene"]["points"]
    count = run["states"]

    def part(name, kind):
        offset, size = run["arrays"][name]
        return np.frombuffer(data, kind, size, offset)

    low, high = (
        part("displacements", np.uint8).reshape(2, count, n, 2).astype(np.uint16)
    )
    moved = (
        np.cumsum(low | high << 8, axis=0, dtype=np.uint16).view(np.int16) * run["unit"]
    )
    captions = [run["captions"][film["cues"].index(k)] for k in range(count)]
    centres = part("centres", "<f4").reshape(count, 2)
    velocities = part("velocities", "<f4").reshape(count, 2)
    rest = result.lattice.positions
    last = result.series["t"][-1]
    times = [float(lines[0].split()[2].replace("−", "-")) for lines in captions]
    inside = [k for k, t in enumerate(times) if 0.0 <= t <= last]  # of the run
    for k in (inside[0], inside[len(inside) // 2], inside[-1]):
        x = rest + moved[k]
        # A caption rounds the time to 0.01 R/c; the path of the centre has it exactly.
        state = result.state(times[k])
        away = centres[k] - result.lattice.mean(state.positions)
        delay = away @ velocities[k] / (velocities[k] @ velocities[k])
        assert abs(delay) < 0.006
        expected = result.state(min(max(times[k] + delay, 0.0), last)).positions
        assert x == pytest.approx(expected, abs=1e-3)
        assert x - x.mean(axis=0) == pytest.approx(
            expected - expected.mean(axis=0), abs=3e-4
        )
    for name, kind in QUANTITIES.items():
        codes = np.cumsum(
            part(name, np.uint8).reshape(count, n), axis=0, dtype=np.uint8
        )
        assert np.ptp(codes) > 100, name
        assert not kind.signed or (codes.min() < 127 < codes.max())


def test_curves_have_units_and_a_value_for_each_time_so_that_a_pause_is_no_plateau(
    folder,
):
    film, _ = packed(folder / "film.html")
    assert film["titles"] == [
        "normal velocity [initial]",
        "wall force [Mc²/R]",
        "energy [Mc²]",
    ]
    assert film["unit"] == "R/c"
    count = film["runs"][0]["states"]
    assert {len(one["values"]) for one in film["curves"]} == {count}
    assert len(film["cues"]) > count  # with pauses
    # the greatest force is a state of its own, between two regular ones
    times = np.array(film["times"])
    steps = np.diff(times)
    assert steps.min() > 0.0
    assert steps.min() < 0.9 * np.median(steps)
    series = api.Result.load(folder, estimate=False).series
    force = np.interp(times, series["t"], series["wall_force"])
    assert film["curves"][1]["values"] == pytest.approx(force, rel=1e-3, abs=1e-6)


@pytest.mark.validate
def test_240_states_of_1099_points_take_less_than_3_mb(tmp_path):
    # rotations lose most
    path = api.run(load_scene("oblique_impact"), lattices=1).film(
        tmp_path / "film.html"
    )
    # 184 of 240 pictures differ; the others repeat the start, the peak and the end
    assert packed(path)[0]["runs"][0]["states"] > 180
    assert path.stat().st_size < 3e6


@pytest.mark.validate
def test_a_film_needs_no_vulkan(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "taichi_disk.render.film.require_film",
        lambda: pytest.fail("Vulkan was asked for"),
    )
    scene = load_scene(
        "compression",
        ["lattice.points=60", "compression.method=newton", "video.format=html"],
    )
    result = api.run(scene, tmp_path / "run", lattices=1)
    assert result.summary["video"] == "video.html"
    assert (tmp_path / "run/video.html").stat().st_size > 1e4
    assert "<iframe" in result.show(seconds=0.2)._repr_html_()


@pytest.mark.skipif(not shutil.which("node"), reason="node is not installed")
@pytest.mark.parametrize("name", [path.name for path in WEB.glob("*.js")])
def test_modules_are_well_formed(name, tmp_path):
    copy = tmp_path / f"{name}.mjs"
    copy.write_text((WEB / name).read_text())
    done = subprocess.run(
        ["node", "--check", str(copy)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


# ---- in a browser


@pytest.fixture(scope="module")
def browser():
    if MISSING:
        if os.environ.get("CI"):
            pytest.fail(f"the film cannot be tested: {MISSING}")
        pytest.skip(f"the film is not tested: {MISSING}")
    driver = Browser().driver
    driver.execute_cdp_cmd("Network.enable", {})
    driver.execute_cdp_cmd(
        "Network.emulateNetworkConditions",
        {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0},
    )
    yield driver
    driver.quit()


WAIT_FOR_FILM = """
const done = arguments[0];
const canvas = document.querySelector("canvas");
const isReady = () => document.querySelector("#moment").max > 9 && canvas.width;
(function ask() { isReady() ? done() : setTimeout(ask, 50); })();
"""


def opened(browser, path, size=(1000, 700)):
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False},
    )
    browser.get(path.as_uri())
    browser.execute_async_script(WAIT_FOR_FILM)


def stop_at(browser, part):
    """Pause the film at a fraction of its length."""
    browser.execute_script(
        "const m = document.getElementById('moment'); m.value = arguments[0] * m.max;"
        " m.oninput()",
        part,
    )


def canvas(browser):
    data = browser.execute_script("return document.querySelector('canvas').toDataURL()")
    return np.asarray(
        Image.open(io.BytesIO(base64.b64decode(data.split(",")[1]))).convert("RGB")
    ).astype(int)


def choose(browser, name, value):
    browser.execute_script(
        "const e = document.querySelector(`#${arguments[0]}, [data-key=${arguments[0]}]"
        " :is(select, input)`);e.type === 'checkbox' ? e.checked = arguments[1] :"
        " e.value = arguments[1];for (const kind of ['input', 'change'])"
        " e.dispatchEvent(new Event(kind, { bubbles: true }))",
        name,
        value,
    )


def curves(browser):
    """Return the curves as drawn (rows, columns, RGBA)."""
    data = browser.execute_script(
        "return document.getElementById('curves').toDataURL()"
    )
    picture = Image.open(io.BytesIO(base64.b64decode(data.split(",")[1])))
    return np.asarray(picture.convert("RGBA")).astype(int)


def present(browser):
    """Return the column of the line that marks the moment in the first panel [px]."""
    picture = curves(browser)
    panel = picture[30:80, : picture.shape[1] // 3, 3]
    return int(panel.min(axis=0).argmax())


def place_of(browser, moment):
    browser.execute_script(
        "const m = document.getElementById('moment'); m.value = arguments[0];"
        " m.oninput()",
        moment,
    )


def test_the_curves_run_over_time_so_that_the_greatest_compression_is_no_corner(
    browser, folder
):
    film, _ = packed(folder / "film.html")
    opened(browser, folder / "film.html")
    times = np.array(film["times"])
    first = max(times[0], 0.0)
    last = min(times[-1], film["end"])
    inside = [k for k, at in enumerate(film["cues"]) if first < times[at] < last]
    chosen = [inside[len(inside) * part // 8] for part in (1, 2, 3, 4, 6)]
    found = []
    for moment in chosen:
        place_of(browser, moment)
        found.append(present(browser))
    wanted = [times[film["cues"][moment]] for moment in chosen]
    slope, start = np.polyfit(wanted, found, 1)
    assert np.polyval([slope, start], wanted) == pytest.approx(found, abs=1.0)
    assert slope * (last - first) > 150.0
    place_of(browser, len(film["cues"]) - 1)
    panel = curves(browser).shape[1] / len(film["titles"])
    assert present(browser) == pytest.approx(panel - 12.0, abs=1.0)  # the axis' end


def test_between_two_states_the_disk_is_between_them(browser, folder):
    opened(browser, folder / "film.html")
    for name in ("forces", "velocity"):
        choose(browser, name, False)
    cues = packed(folder / "film.html")[0]["cues"]
    moment = cues.index(cues[-1]) - 2  # in the flight at the end
    heights = []
    for part in (0.0, 0.5, 1.0):
        place_of(browser, moment + part)
        picture = canvas(browser)[:-120]
        disk = np.abs(picture - picture[1, 1]).sum(axis=2) > 30
        rows = disk.any(axis=1)
        top = rows.argmax()
        bottom = top + rows[top:].argmin()  # the wall is lower
        heights.append(0.5 * (top + bottom))
    assert heights[0] - heights[2] > 4.0
    assert heights[1] == pytest.approx(0.5 * (heights[0] + heights[2]), abs=1.1)


def test_each_theme_has_its_own_colours(browser, folder):
    film, _ = packed(folder / "film.html")
    opened(browser, folder / "film.html")
    for number, theme in enumerate(("light", "dark")):
        choose(browser, "theme", theme)
        script = """
            const rgb = (one) => getComputedStyle(document.querySelector(one)).color;
            return [rgb('.motion'), rgb('#names span'), rgb('h1')]"""
        motion, name, ink = browser.execute_script(script)
        assert motion == rgb(film["curves"][0]["colours"][number])
        first = next(one for one in film["curves"] if one["name"])
        assert name == rgb(first["colours"][number])
        assert ink == ("rgb(33, 36, 41)", "rgb(237, 237, 234)")[number]


def rgb(colour):
    parts = [str(int(colour[k : k + 2], 16)) for k in (1, 3, 5)]
    return f"rgb({', '.join(parts)})"


def test_compared_runs_have_dashes_of_their_own_and_a_key(browser, folder):
    result = api.Result.load(folder, estimate=False)
    path = folder.with_name("two.html")
    result.film(path, compare=[result], labels=["one", "two"], fps=5, seconds=4)
    film, _ = packed(path)
    energies = {(one["run"], one["name"]) for one in film["curves"] if one["name"]}
    assert energies == {(run, name) for run in (0, 1) for _, name in energies}
    opened(browser, path)
    names = browser.execute_script("return document.getElementById('names').innerText")
    assert names.startswith("—— one – – two ")
    assert names.count("elastic") == 1


# smallest height of a picture in a window of a size [px]
HEIGHTS = [
    ((300, 180), 110),
    ((320, 256), 190),
    ((800, 500), 400),
    ((834, 640), 350),
    ((1366, 768), 520),
]


@pytest.mark.parametrize(("size", "least"), HEIGHTS)
def test_in_a_frame_the_picture_has_the_room(browser, folder, size, least):
    opened(browser, folder / "film.html", size)
    height, seen, bar = browser.execute_script(
        "const strip = document.querySelector('.strip').getBoundingClientRect();"
        "return [document.querySelector('canvas').clientHeight, strip.bottom,"
        " document.documentElement.scrollHeight]"
    )
    assert height >= least
    assert seen <= size[1] + 1  # the time line is seen, too
    assert bar == size[1]
    # what does not fit is scrolled to
    browser.execute_script("document.querySelector('details').scrollIntoView()")
    end = "return document.getElementById('names').getBoundingClientRect().bottom"
    assert browser.execute_script(end) <= size[1]


def test_without_a_script_a_sentence_says_so_and_no_control_is_seen(browser, folder):
    shown = """
        const all = [...document.querySelectorAll('p, button, input, summary')];
        return all.filter((one) => one.checkVisibility({ visibilityProperty: true }))
        .map((one) => one.textContent)"""
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        browser.get((folder / "film.html").as_uri())
        found = browser.execute_script(shown)
    finally:
        browser.execute_cdp_cmd(
            "Emulation.setScriptExecutionDisabled", {"value": False}
        )
    assert len(found) == 1
    assert "JavaScript" in found[0]
    opened(browser, folder / "film.html")
    assert not [one for one in browser.execute_script(shown) if "JavaScript" in one]


def test_on_paper_no_circle_is_an_ellipse_and_forced_colours_leave_the_picture(
    browser, folder
):
    opened(browser, folder / "film.html", (834, 640))
    stretched = """return [...document.querySelectorAll('canvas')].filter(e =>
        Math.abs(e.width / e.height / e.clientWidth * e.clientHeight - 1) > 0.02)
        .length"""
    features = [
        {"name": "forced-colors", "value": "active"},
        {"name": "prefers-color-scheme", "value": "dark"},
    ]
    try:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
        browser.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": 500, "height": 700, "deviceScaleFactor": 1, "mobile": False},
        )
        browser.execute_async_script("setTimeout(arguments[0], 200)")
        assert browser.execute_script(stretched) == 0
        control = "return document.getElementById('play').checkVisibility()"
        assert not browser.execute_script(control)
        browser.execute_cdp_cmd(
            "Emulation.setEmulatedMedia", {"media": "", "features": features}
        )
        style = "getComputedStyle(document.getElementById('graphs'))"
        ground = browser.execute_script(f"return {style}.backgroundColor")
        assert ground == "rgb(250, 250, 248)"
    finally:
        browser.execute_cdp_cmd(
            "Emulation.setEmulatedMedia", {"media": "", "features": []}
        )


@pytest.mark.validate
def test_from_a_file_it_plays_scrubs_zooms_magnifies_and_shows_every_quantity(
    browser, folder
):
    opened(browser, folder / "film.html", (1000, 700))
    place = "return Number(document.getElementById('moment').value)"
    before = browser.execute_script(place)
    browser.execute_async_script("setTimeout(arguments[0], 700)")
    assert browser.execute_script(place) != before  # it plays
    stop_at(browser, 0.3)
    there = browser.execute_script(place)
    browser.execute_async_script("setTimeout(arguments[0], 300)")
    assert browser.execute_script(place) == there
    pictures = {
        name: canvas(browser)
        for name in QUANTITIES
        if not choose(browser, "quantity", name)
    }
    assert len({picture.tobytes() for picture in pictures.values()}) == len(QUANTITIES)
    ground = pictures["shear"][1, 1]
    disk = np.abs(pictures["shear"][:-90] - ground).sum(axis=2) > 30
    assert disk.mean() > 0.1
    assert len(np.unique(pictures["shear"].reshape(-1, 3), axis=0)) > 200
    choose(browser, "quantity", "shear")
    for name, value in (
        ("magnify", 10),
        ("draw", "springs"),
        ("draw", "points"),
        ("outline", True),
        ("theme", "dark"),
    ):
        old = canvas(browser)
        choose(browser, name, value)
        assert np.abs(canvas(browser) - old).mean() > 0.2, name
    speed = "document.querySelector('[data-key=speed] [type=text]')"
    browser.execute_script(f"{speed}.value = '-3'; {speed}.onchange()")
    assert browser.execute_script(f"return {speed}.value") == "0.1"
    script = (
        "document.querySelector('canvas').dispatchEvent(new WheelEvent('wheel', "
        "{deltaY: -600, clientX: 300, clientY: 300}))"
    )
    old = canvas(browser)
    browser.execute_script(script)
    assert np.abs(canvas(browser) - old).mean() > 1.0
    assert [
        entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"
    ] == []


@pytest.mark.validate
@pytest.mark.parametrize("size", [(390, 844), (844, 390), (768, 1024), (1280, 800)])
def test_on_a_screen_of_any_size_no_text_is_small_and_nothing_scrolls_sideways(
    browser, folder, size
):
    opened(browser, folder / "film.html", size)
    stop_at(browser, 0.5)
    browser.execute_script("document.querySelector('details').open = true")
    assert (
        browser.execute_script("return document.documentElement.scrollWidth") <= size[0]
    )
    small = """return [...document.querySelectorAll('body *')].filter(e =>
        e.offsetWidth && e.textContent.trim()
        && parseFloat(getComputedStyle(e).fontSize) > 0
        && parseFloat(getComputedStyle(e).fontSize) < 12).map(e => e.outerHTML)"""
    assert browser.execute_script(small) == []
    # the marks on the time line are short cuts of the slider below them
    low = """
        const targets = 'button, select, input[type=range], label';
        return [...document.querySelectorAll(targets)].filter(e =>
        e.offsetWidth && !e.matches('#line button')
        && e.getBoundingClientRect().height < 43.5).map(e => e.outerHTML)"""
    assert browser.execute_script(low) == []
    nameless = """
        const controls = document.querySelectorAll('button, select, input');
        return [...controls].filter(e => !(e.ariaLabel || e.textContent.trim()
        || e.labels?.length)).map(e => e.outerHTML)"""
    assert browser.execute_script(nameless) == []
    names = (
        "const e = document.getElementById('names'); return [e.innerText, "
        "e.scrollWidth - e.clientWidth]"
    )
    text, cut = browser.execute_script(names)
    assert "elastic" in text
    assert "flight" in text
    assert cut <= 0
    # a canvas has the pixels that it covers: no circle is an ellipse
    browser.execute_async_script("setTimeout(arguments[0], 200)")
    stretched = """return [...document.querySelectorAll('canvas')].filter(e =>
        e.offsetWidth && Math.abs(
        e.width / e.height - e.clientWidth / e.clientHeight) > 0.02).length"""
    assert browser.execute_script(stretched) == 0
