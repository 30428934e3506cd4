"""Chromium on a page of the sandbox, for tests and benchmarks."""

from __future__ import annotations

import re
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

TOOLS = [tool for tool in ("chromium", "chromedriver") if not shutil.which(tool)]
MISSING = (
    f"not installed: {', '.join(TOOLS)} (apt-get install chromium chromium-driver)"
    if TOOLS
    else ""
)
# The page needs no graphics driver.
OPTIONS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu")


class Browser:
    """A browser on the page. `driver` is selenium's; the page's object of class Sandbox
    is `window.sandbox`."""

    def __init__(self, size: tuple[int, int] = (1000, 760)) -> None:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        options = webdriver.ChromeOptions()
        for option in OPTIONS:
            options.add_argument(option)
        options.binary_location = shutil.which("chromium")
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self._folder = tempfile.TemporaryDirectory()
        self.driver = webdriver.Chrome(options, Service(shutil.which("chromedriver")))
        folder = {"behavior": "allow", "downloadPath": self._folder.name}
        self.driver.execute_cdp_cmd("Browser.setDownloadBehavior", folder)
        self.resize(size)

    def open(self, url: str) -> None:
        """Open the page, and wait for its first picture."""
        self.driver.get(url)
        self.wait(lambda: self.script("return Boolean(window.sandbox?.drawing.state)"))

    def resize(self, size: tuple[int, int]) -> None:
        metrics = {
            "width": size[0],
            "height": size[1],
            "deviceScaleFactor": 1,
            "mobile": False,
        }
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def script(self, code: str) -> Any:
        return self.driver.execute_script(code)

    @staticmethod
    def wait(until: Callable[[], Any], seconds: float = 30.0) -> Any:
        """Call `until` until its value is true, and return it."""
        end = time.monotonic() + seconds
        while not (found := until()):
            assert time.monotonic() < end, "the condition did not become true"
            time.sleep(0.1)
        return found

    def errors(self) -> list[Any]:
        return [
            entry
            for entry in self.driver.get_log("browser")
            if entry["level"] == "SEVERE"
        ]

    # ---- what the page shows

    def text(self, identity: str) -> str:
        return str(
            self.script(f"return document.getElementById('{identity}').textContent")
        )

    def state(self, name: str) -> float:
        return float(self.script(f"return window.sandbox.state.{name}"))

    def results(self) -> list[dict[str, Any]]:
        return list(self.script("return window.sandbox.panel.results"))

    def setting(self, name: str, word: bool = False) -> Any:
        """Return a value of the scene that would be saved."""
        found = re.search(
            rf"^  {name}:( \S+)",
            self.script("return window.sandbox.scene"),
            re.MULTILINE,
        )
        assert found
        return found[1] if word else float(found[1])

    def number(self, key: str) -> float:
        """Return the number in the field beside a slider."""
        text = self.script(
            f'return document.querySelector(\'[data-key="{key}"]'
            " input[type=text]').value"
        )
        return float(text.replace(",", "."))

    def colours(self) -> int:
        """Return the number of colours on the canvas."""
        return int(
            self.script(
                "const { canvas, context } = window.sandbox.drawing;const { data } ="
                " context.getImageData(0, 0, canvas.width, canvas.height);return new"
                " Set(new Uint32Array(data.buffer)).size"
            )
        )

    def disk(self) -> tuple[tuple[int, int], int]:
        """Return the centre of the disk and its radius [px]."""
        x, y, radius = self.script(
            "const { drawing, state } = window.sandbox, box ="
            " drawing.canvas.getBoundingClientRect();const [x, y] ="
            " drawing.toScreen(state.row.com_x, state.row.com_y);return [box.left + x,"
            " box.top + y, drawing.camera.scale]"
        )
        return (round(x), round(y)), round(radius)

    def downloaded(self, name: str) -> Path | None:
        return path if (path := Path(self._folder.name, name)).exists() else None

    # ---- what a user does

    def click(self, identity: str) -> None:
        self.script(f"document.getElementById('{identity}').click()")

    def close_lists(self) -> None:
        self.script(
            "for (const one of document.querySelectorAll(':popover-open'))"
            " one.hidePopover()"
        )

    def key(self, name: str, seconds: float = 0.05) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.driver).key_down(name).pause(seconds).key_up(name).perform()

    def lead(self, key: str, place: int) -> None:
        """Move a slider to a place from 0 to 1000."""
        self.script(
            f'const one = document.querySelector(\'[data-key="{key}"]'
            " input[type=range]'), low = Number(one.min);one.value = low + (one.max -"
            f" low) * {place / 1000};one.dispatchEvent(new Event('input'));"
            " one.dispatchEvent(new Event('change'))"
        )
        time.sleep(0.5)

    def type(self, key: str, text: str) -> None:
        field = self.driver.find_element(
            "css selector", f"[data-key='{key}'] input[type=text]"
        )
        self.driver.execute_script("arguments[0].select()", field)
        field.send_keys(text + "\ue007")

    def choose(self, key: str, word: str) -> None:
        self.script(
            f"const one = document.querySelector('.choice[data-key=\"{key}\"] select');"
            f"one.value = '{word}'; one.onchange()"
        )
        time.sleep(0.5)

    def drag(
        self,
        start: tuple[int, int],
        end: tuple[int, int],
        pause: float = 0.3,
        button: int = 0,
        touch: bool = False,
    ) -> None:
        from selenium.webdriver.common.actions.action_builder import ActionBuilder
        from selenium.webdriver.common.actions.pointer_input import PointerInput

        builder = ActionBuilder(
            self.driver,
            mouse=PointerInput(*(("touch", "finger") if touch else ("mouse", "hand"))),
        )
        pointer = builder.pointer_action
        pointer.move_to_location(*start).pointer_down(button=button).pause(
            pause
        ).move_to_location(*end).pause(pause)
        pointer.pointer_up(button=button)
        builder.perform()

    def drag_in(self, identity: str, start: float, end: float) -> None:
        """Drag across a graph, from one fraction of its width to another."""
        left, top, width, height = self.script(
            "const box ="
            f" document.getElementById('{identity}').getBoundingClientRect();return"
            " [box.left, box.top, box.width, box.height]"
        )
        row = round(top + height / 2)
        self.drag((round(left + start * width), row), (round(left + end * width), row))

    def yaml(self, path: Path) -> Path:
        """Write the scene as the page would save it, and return the path."""
        path.write_text(self.script("return window.sandbox.scene"), encoding="utf-8")
        return path
