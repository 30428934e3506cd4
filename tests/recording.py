"""Record what pages draw, show and send: `python -m tests.recording` writes
tests/recorded/*.txt anew.

A page runs on the stage of tests/recorded/stage.js, which has no fonts, no time and no
graphics, so that a record is the same on every machine.
"""

from __future__ import annotations

import re
import tempfile
from difflib import unified_diff
from math import isclose
from pathlib import Path

from taichi_disk.web.drawing import DRAWING, SANDBOX, bundle, source
from tests.browser import Browser

FOLDER = Path(__file__).with_name("recorded")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
# sizes that do not depend on fonts
STYLE = """
.sandbox { width: 1000px; height: 700px; }
canvas { display: block; width: 500px; height: 150px; }
#disk { width: 640px; height: 480px; }
dialog { position: fixed; inset: 50px; }
.film #disks { height: 400px; }
.film #curves { width: 900px; }
figure canvas { width: 400px; height: 350px; }
.plot canvas { width: 500px; height: 150px; }
"""


def sandbox() -> str:
    """Return the sandbox's page, to which page.js plays the program and the user."""
    main = part("index.html", "<main.*</main>")
    return staged(main, f"{bundle(*SANDBOX, 'page.js')} {{ {recorded('page.js')} }}")


def film() -> str:
    """Return a film of film.js, and what a user does with it."""
    main = part("film.html", r"<main.*(?=<script type=.module)")
    modules = bundle(*DRAWING, "controls.js", "film.js")
    acts = recorded("film_acts.js")
    return staged(
        main, f"{recorded('film.js')} await packFilm(); {modules} {{ {acts} }}"
    )


def part(name: str, pattern: str) -> str:
    (found,) = re.findall(pattern, source(name), re.DOTALL)
    return str(found)


def recorded(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def staged(main: str, module: str) -> str:
    """Return a page with a stage, on which a module runs."""
    return (
        f"<!doctype html><meta charset=utf-8><style>{STYLE}</style>{main}"
        f"<script>{recorded('stage.js')} {recorded('disk.js')}</script>"
        f"<script type=module>{module}</script>"
    )


def played(browser: Browser, page: str) -> list[str]:
    """Return the lines that a page records."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "page.html")
        path.write_text(page, encoding="utf-8")
        browser.driver.get(path.as_uri())
        text = browser.wait(lambda: browser.script("return window.recorded"))
    assert not browser.errors()
    return str(text).splitlines()


def differences(name: str, lines: list[str]) -> list[str]:
    """Return where lines differ from a record by more than rounding."""
    known = recorded(f"{name}.txt").splitlines()
    close = [
        line if is_close(line, other) else other
        for line, other in zip(known, lines, strict=False)
    ]
    found = [*close, *lines[len(close) :]]
    return [*unified_diff(known, found, "recorded", "now", n=0, lineterm="")]


def is_close(line: str, other: str) -> bool:
    """Whether two lines are equal but for the last digit of their numbers."""
    if NUMBER.split(line) != NUMBER.split(other):
        return False
    pairs = zip(NUMBER.findall(line), NUMBER.findall(other), strict=True)
    return all(
        isclose(float(a), float(b), rel_tol=1e-4, abs_tol=0.011) for a, b in pairs
    )


def main() -> None:
    browser = Browser()
    try:
        for name, page in PAGES.items():
            text = "\n".join(played(browser, page())) + "\n"
            (FOLDER / f"{name}.txt").write_text(text, encoding="utf-8")
    finally:
        browser.driver.quit()


PAGES = {"page": sandbox, "film": film}

if __name__ == "__main__":
    main()
