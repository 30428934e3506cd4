"""The site: formulas without the internet, reference pages, and a search."""

import importlib.util
import json
import os
import re
from pathlib import Path

import pytest
import yaml
from programs import printed_by

ROOT = Path(__file__).parents[2]
PAGES = [
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs/notebooks").glob("*.ipynb")),
]


@pytest.fixture(scope="module")
def site():
    spec = importlib.util.spec_from_file_location(
        "site_pages", ROOT / "docs/site_pages.py"
    )
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def formulas(text):
    blocks = re.findall(
        r"^```math\n(.*?)^```$|^\$\$\n(.*?)^\$\$$", text, re.MULTILINE | re.DOTALL
    )
    prose = re.sub(r"^(```|\$\$).*?^\1$", "", text, flags=re.MULTILINE | re.DOTALL)
    return [("".join(block), True) for block in blocks] + [
        (block, False) for block in re.findall(r"\$([^$\n]+)\$", prose)
    ]


def test_every_formula_of_every_page_becomes_mathml(site):
    for page in PAGES:
        text = (
            site.notebook(page) if page.suffix == ".ipynb" else page.read_text("utf-8")
        )
        for formula, block in formulas(text):
            drawn = re.sub(r"<[^>]*>|&#x0007[BD];", "", site.mathml(formula, block))
            assert drawn and not re.search(r"[\\{}$]|&amp;", drawn), formula


def test_formulas_of_a_page_keep_their_numbers_and_their_vectors(site):
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


def test_the_reference_has_a_page_that_leads_to_every_reference(site):
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
def test_the_site_leads_to_the_page_of_its_repository(site, remote, page):
    assert site.web_address(remote) == page


def test_folders_are_links_if_the_repository_has_a_page(site):
    text = "in a clone of this repository, [scenes/](scenes), [CSV files](data)"
    assert site.with_repository(text, None).endswith("`scenes/`, `CSV files`")
    linked = site.with_repository(text, "https://forge.org/disk")
    assert "[this repository](https://forge.org/disk)" in linked
    assert "[`scenes/`](https://forge.org/disk/tree/HEAD/scenes)" in linked
    assert "[`CSV files`](https://forge.org/disk/tree/HEAD/docs/data)" in linked


def test_the_first_screen_has_the_question_the_commands_and_a_film_to_play_with(site):
    shown = site.first_screen(
        (ROOT / "README.md").read_text("utf-8").replace("](docs/", "](")
    )
    first, rest = shown.split("\n</div>\n\n## ", 1)
    assert first.count(f"# {site.QUESTION}") == 1 and "# taichi_disk" not in first
    assert ".venv/bin/taichi-disk run ringing_disk\n" in first
    assert '<iframe class="film"' in first and 'src="films/impact.html"' in first
    # Pictures of the film are for forges.
    assert "download" not in first
    assert "![" not in first and "<iframe" not in rest


def test_forges_offer_films_as_files_and_the_site_plays_them(site):
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        text = page.read_text("utf-8").replace("](docs/", "](")
        links = re.findall(r"^.*\(films/\w+\.html[^)]*\).*$", text, re.MULTILINE)
        for line in links:
            assert " (download" in line, page
            assert site.FILM.fullmatch(line), page


def test_the_site_is_published_by_the_forge_s_own_actions_without_secrets():
    flow = yaml.safe_load((ROOT / ".github/workflows/site.yml").read_text("utf-8"))
    (job,) = flow["jobs"].values()
    used = [step["uses"] for step in job["steps"] if "uses" in step]
    assert used and all(action.startswith("actions/") for action in used)
    assert "secrets" not in json.dumps(flow)
    (build,) = [one for one in job["steps"] if "mkdocs" in one.get("run", "")]
    assert build["run"] == "mkdocs build --strict"
    # The address of the site stands in one place.
    assert build["env"]["SITE_URL"] == "${{ steps.pages.outputs.base_url }}/"
    assert 'site_url: !ENV [SITE_URL, ""]' in (ROOT / "mkdocs.yml").read_text("utf-8")


@pytest.mark.validate
def test_the_site_is_built_fetches_nothing_and_finds_what_a_reader_looks_for(tmp_path):
    build = ["mkdocs", "build", "--strict", "--quiet", "--site-dir", tmp_path]
    environment = os.environ | {"SITE_URL": "https://forge.org/disk/"}
    printed_by("-m", *build, cwd=ROOT, env=environment)
    assert "<loc>https://forge.org/disk/model/</loc>" in (
        tmp_path / "sitemap.xml"
    ).read_text("utf-8")
    first = (tmp_path / "index.html").read_text("utf-8")
    assert re.findall("<title>(.*)</title>", first)[0].count("taichi_disk") == 1
    assert first.count("<h1") == 1 and first.count("images/logo.svg") >= 2
    for page in tmp_path.rglob("*.html"):
        text = page.read_text("utf-8")
        # The address of the page itself is not fetched.
        fetched = re.sub('<link rel="(canonical|prev|next)"[^>]*>', "", text)
        assert not re.search(
            r'<(?:script|link|img)[^>]+(?:src|href)="https?:', fetched
        ), page
        assert 'class="arithmatex"' not in text, page
    assert "<math" in (tmp_path / "model/index.html").read_text("utf-8")
    assert (tmp_path / "reference/index.html").exists()
    assert "a { text-decoration: underline; }" in (tmp_path / "site.css").read_text()
    index = json.loads((tmp_path / "search/search_index.json").read_text("utf-8"))
    for words in ("degrees", "phone", "still picture"):
        assert any(words in page["text"] for page in index["docs"]), words
    assert "dt" in re.split(index["config"]["separator"], "time.dt")
