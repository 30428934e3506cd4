"""The documentation site: formulas without the internet, reference pages, and a search
that finds words."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs/notebooks").glob("*.ipynb")),
]


@pytest.fixture(scope="module")
def site() -> Any:
    spec = importlib.util.spec_from_file_location(
        "site_pages", ROOT / "docs/site_pages.py"
    )
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def formulas(text: str) -> list[tuple[str, bool]]:
    blocks = re.findall(
        r"^```math\n(.*?)^```$|^\$\$\n(.*?)^\$\$$", text, re.MULTILINE | re.DOTALL
    )
    prose = re.sub(r"^(```|\$\$).*?^\1$", "", text, flags=re.MULTILINE | re.DOTALL)
    return [("".join(block), True) for block in blocks] + [
        (block, False) for block in re.findall(r"\$([^$\n]+)\$", prose)
    ]


def test_every_formula_of_every_page_becomes_mathml(site: Any) -> None:
    for page in PAGES:
        text = (
            site.notebook(page) if page.suffix == ".ipynb" else page.read_text("utf-8")
        )
        for formula, block in formulas(text):
            drawn = re.sub(r"<[^>]*>|&#x0007[BD];", "", site.mathml(formula, block))
            assert drawn and not re.search(r"[\\{}$]|&amp;", drawn), formula


def test_formulas_of_a_page_keep_their_numbers_and_their_vectors(site: Any) -> None:
    html = (
        r'<p>at <span class="arithmatex">\(x &lt; \mathbf v\)</span></p><div'
        r' class="arithmatex">\[e = 1 \tag{5}\]</div>'
    )
    made = site.on_page_content(html)
    assert made.count("<math") == 2
    assert "arithmatex" not in made
    assert (
        "\N{MATHEMATICAL BOLD SMALL V}" in made
        and "<span>(5)</span>" in made
        and "&#x0003C;" in made
    )


def test_the_reference_has_a_page_that_leads_to_every_reference(site: Any) -> None:
    targets = re.findall(r"\]\(([^)]*)\)", site.reference())
    own = {"scenes.md", "commands.md", "python.md"}
    assert own <= set(targets)
    assert all((ROOT / "docs" / target[3:]).exists() for target in set(targets) - own)


@pytest.mark.parametrize(
    ("remote", "page"),
    [
        ("git@forge.org:group/disk.git", "https://forge.org/group/disk"),
        ("https://name:word@forge.org/disk.git", "https://forge.org/disk"),
        ("ssh://git@forge.org:22/disk/", "https://forge.org/disk"),
        ("/home/me/disk", None),
        ("C:\\disk", None),
        ("", None),
    ],
)
def test_the_site_leads_to_the_page_of_its_repository(
    site: Any, remote: str, page: str | None
) -> None:
    assert site.web_address(remote) == page


def test_folders_are_links_if_the_repository_has_a_page(site: Any) -> None:
    text = "in a clone of this repository, [scenes/](scenes), [CSV files](data)"
    assert site.with_repository(text, None).endswith("`scenes/`, `CSV files`")
    linked = site.with_repository(text, "https://forge.org/disk")
    assert "[this repository](https://forge.org/disk)" in linked
    assert "[`scenes/`](https://forge.org/disk/tree/HEAD/scenes)" in linked
    assert "[`CSV files`](https://forge.org/disk/tree/HEAD/docs/data)" in linked


@pytest.mark.validate
def test_the_site_is_built_fetches_nothing_and_finds_what_a_reader_looks_for(
    tmp_path: Path,
) -> None:
    call = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "--quiet",
        "--site-dir",
        str(tmp_path),
    ]
    done = subprocess.run(call, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    for page in tmp_path.rglob("*.html"):
        text = page.read_text("utf-8")
        assert not re.search(r'<(?:script|link|img)[^>]+(?:src|href)="https?:', text), (
            page
        )
        assert 'class="arithmatex"' not in text, page
    assert "<math" in (tmp_path / "model/index.html").read_text("utf-8")
    assert (tmp_path / "reference/index.html").exists()
    found = json.loads((tmp_path / "search/search_index.json").read_text("utf-8"))[
        "docs"
    ]
    for words in ("degrees", "phone", "still picture"):
        assert any(words in page["text"] for page in found), words
