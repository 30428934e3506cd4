"""Pages on the stage of tests/stage/stage.js, which is the same on every machine."""

import re
import tempfile
from pathlib import Path

from taichi_disk.pictures.web.drawing import DRAWING, FILM, bundle, source

FOLDER = Path(__file__).with_name("stage")
SANDBOX = (
    "message.js",
    "graphs.js",
    "controls.js",
    "results.js",
    "scenes.js",
    "sandbox.js",
    "page.js",
)
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


def sandbox():
    """Return the sandbox's page, to which sandbox.js plays the program and the user."""
    main = part("index.html", "<main.*</main>")
    modules = bundle(*DRAWING, *SANDBOX)
    return staged(main, f"{modules} {{ {acts('sandbox.js')} }}")


def film():
    """Return a film of film.js, and what a user does with it."""
    main = part("film.html", r"<main.*(?=<script type=.module)")
    modules = bundle(*FILM)
    end = acts("film_acts.js")
    return staged(main, f"{acts('film.js')} await packFilm(); {modules} {{ {end} }}")


def part(name, pattern):
    (found,) = re.findall(pattern, source(name), re.DOTALL)
    return str(found)


def acts(name):
    return (FOLDER / name).read_text(encoding="utf-8")


def staged(main, module):
    """Return a page with a stage, on which a module runs."""
    return (
        f"<!doctype html><meta charset=utf-8><style>{STYLE}</style>{main}"
        f"<script>{acts('stage.js')} {acts('disk.js')}</script>"
        f"<script type=module>{module}</script>"
    )


def played(browser, page):
    """Return the lines that a page notes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "page.html")
        path.write_text(page, encoding="utf-8")
        browser.driver.get(path.as_uri())
        text = browser.wait(lambda: browser.script("return window.recorded"))
    errors = browser.errors()
    assert not errors, errors
    return str(text).splitlines()


PAGES = {"page_of_the_sandbox": sandbox, "page_of_a_film": film}
