"""Generate the pages of the site that are not in docs: README, CONTRIBUTING, notebooks,
and references from the code.

Formulas become MathML, which browsers draw without the internet.
"""

from __future__ import annotations

import json
import re
import subprocess
from html import escape, unescape
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from mkdocs.structure.files import File, Files

# A formula in the output of pymdownx.arithmatex: inline, or a block with a number at
# its end.
FORMULA = re.compile(
    r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL
)
NUMBER = re.compile(r"\\tag\{(\w+)\}")
# In MathML, bold and sans-serif letters are characters of their own, not a style.
STYLED = re.compile(r'<mi mathvariant="(bold|sans-serif)">([A-Za-z])<')
STYLES = {"bold": 0x1D400, "sans-serif": 0x1D5A0}  # the code points of A
# A line that only links to a film.
FILM = re.compile(
    r"^\[(Play[^]]+)\]\((films/\w+\.html(?:#[^)]*)?)\)(?: \(download[^)]*\))?$",
    re.MULTILINE,
)
QUESTION = "How fast does an elastic disk come back?"
ROOT = Path(__file__).parents[1]
PYTHON = {
    "Scenes": (
        "taichi_disk.experiments.scenes.load_scene",
        "taichi_disk.experiments.scenes.load_sweep",
    ),
    "Running": (
        "taichi_disk.runs.api.run",
        "taichi_disk.runs.api.Result",
        "taichi_disk.experiments.computation.driver.State",
    ),
    "Scene objects": tuple(
        f"taichi_disk.experiments.scenes.scene.DiskScene.{name}"
        for name in ("with_", "to_yaml")
    ),
    "Lattices": ("taichi_disk.mechanics.lattice.lattice.Lattice",),
    "Sweeps": (
        "taichi_disk.studies.sweep.sweep.run_sweep",
        "taichi_disk.studies.sweep.sweep.SweepResult",
    ),
    "Fields": (
        "taichi_disk.mechanics.fields.field",
        "taichi_disk.mechanics.fields.Field",
        "taichi_disk.mechanics.fields.stress",
    ),
    "Errors": tuple(
        f"taichi_disk.base.errors.{name}Error"
        for name in ("TaichiDisk", "Input", "Simulation")
    ),
}


def on_config(config: Any) -> Any:
    """Link the site to the forge from which the repository was cloned, if any."""
    call = ["git", "-C", str(ROOT), "remote", "get-url", "origin"]
    try:
        origin = subprocess.run(call, capture_output=True, text=True).stdout
    except FileNotFoundError:  # without git
        origin = ""
    # The theme's own link, `repo_url`, would fetch the number of stars from the forge.
    repository = web_address(origin.strip())
    if repository:
        config.extra["repository"] = repository
        link = {"icon": "fontawesome/brands/git-alt", "link": repository}
        config.extra["social"] = [{**link, "name": "the repository"}]
    return config


def web_address(remote: str) -> str | None:
    """Return the page of a repository, without a name or password in its address, or
    None if it has no page."""
    # git@forge.org:owner/name.git is short for ssh://git@forge.org/owner/name.git
    short = re.fullmatch(r"[\w.-]+@([\w.-]+):(.+)", remote)
    address = urlsplit(f"ssh://{short[1]}/{short[2]}" if short else remote)
    if address.scheme not in ("http", "https", "ssh") or not address.hostname:
        return None
    return f"https://{address.hostname}{address.path.rstrip('/').removesuffix('.git')}"


def on_files(files: Files, config: Any) -> Files:
    pages = {
        "index.md": (ROOT / "README.md").read_text(encoding="utf-8"),
        "contributing.md": (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"),
        "reference/index.md": reference(),
        "reference/scenes.md": scene_keys(),
        "reference/commands.md": commands(),
        "reference/python.md": python(),
    }
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    for path in (ROOT / "docs" / "notebooks").glob("*.ipynb"):
        files.append(
            File.generated(config, f"notebooks/{path.stem}.md", content=notebook(path))
        )
    for path in [*(ROOT / "scenes").glob("*.yaml"), ROOT / "CITATION.cff"]:
        files.append(
            File.generated(config, str(path.relative_to(ROOT)), abs_src_path=str(path))
        )
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, **_: Any) -> str:
    """Return the Markdown of a page with links as the site needs them."""
    # their links are made for the site
    if page.file.src_uri.startswith(("notebooks/", "reference/")):
        return markdown
    is_first = page.file.src_uri == "index.md"
    at_top = is_first or page.file.src_uri == "contributing.md"
    text = re.sub(r"^```(\w+) no-run$", r"```\1", markdown, flags=re.MULTILINE)
    text = text.replace("](../README.md", "](index.md")
    text = text.replace("](../CONTRIBUTING.md", "](contributing.md")
    text = text.replace("](CONTRIBUTING.md", "](contributing.md")
    if at_top:
        text = text.replace("](docs/", "](")
    else:
        text = text.replace("](../", "](")
    text = text.replace(".ipynb)", ".md)")
    if is_first:
        page.meta |= {"title": QUESTION, "hide": ["navigation", "toc"]}
        text = first_screen(text)
    text = FILM.sub(lambda found: frame(found, "" if is_first else "../"), text)
    return with_repository(text, config.extra.get("repository"))


def first_screen(text: str) -> str:
    """Return the README with its beginning as the first screen of the site: a question,
    what the program does and its two commands, beside a film to play with."""
    head, rest = text.split("\n## ", 1)
    film = FILM.search(head)
    words = re.sub(r"^!\[[^]]*\]\([^)]*\)$", "", head, flags=re.MULTILINE)
    words = FILM.sub("", words)
    words = words.replace("# taichi_disk\n", f"# {QUESTION}\n")
    parts = [
        '<div class="first-screen" markdown>',
        f"<div markdown>\n\n{words.strip()}\n\n</div>",
        frame(film, ""),
        f"</div>\n\n## {rest}",
    ]
    return "\n\n".join(parts)


def frame(link: re.Match[str], folder: str) -> str:
    """Return a frame that shows the film of a `link`. Forges show no frames, so there
    the link remains a link."""
    title, path = link.groups()
    return f'<iframe class="film" title="{title}" src="{folder}{path}"></iframe>'


def with_repository(text: str, repository: str | None) -> str:
    """Return the Markdown of a page with links to the repository. Without a repository,
    the name of a folder is no link, because a folder has no page on the site."""
    folder = re.compile(r"\[`?([^]\n`]*)`?\]\((scenes|examples|experiments|data)\)")
    if repository is None:
        return folder.sub(r"`\1`", text)

    def link(found: re.Match[str]) -> str:
        path = found[2] if found[2] == "scenes" else f"docs/{found[2]}"
        return f"[`{found[1]}`]({repository}/tree/HEAD/{path})"

    text = folder.sub(link, text)
    return text.replace(" this repository", f" [this repository]({repository})")


def on_page_content(html: str, **_: Any) -> str:
    """Return the HTML of a page with its formulas in MathML."""
    return FORMULA.sub(
        lambda found: mathml(unescape(found[2]), block=found[1] == "div"), html
    )


def on_post_page(html: str, page: Any, config: Any) -> str:
    """Return a page with what chats show of a link to it, if the site's address is
    known."""
    if not config.site_url:
        return html
    shown = {"title": page.title, "image": f"{config.site_url}images/fringes.png"}
    lines = [
        f'<meta property="og:{name}" content="{escape(text)}">'
        for name, text in shown.items()
    ]
    return html.replace("</head>", "\n".join([*lines, "</head>"]), 1)


def mathml(formula: str, block: bool) -> str:
    """Convert a LaTeX formula to MathML, as a numbered `block` or inline."""
    from latex2mathml.converter import convert

    number = NUMBER.search(formula)
    drawn = convert(
        NUMBER.sub("", formula).strip(), display="block" if block else "inline"
    )
    drawn = STYLED.sub(lambda found: f"<mi>{styled(*found.groups())}<", drawn)
    if not block:
        return drawn
    label = f"<span>({number[1]})</span>" if number else ""
    return f'<div class="formula">{drawn}{label}</div>'


def styled(style: str, letter: str) -> str:
    return chr(STYLES[style] + ord(letter) - ord("A") - 6 * letter.islower())


def notebook(path: Path) -> str:
    """Return the cells of a notebook as Markdown, without outputs."""
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "code":
            parts.append(f"```python\n{text}\n```")
        else:
            parts.append(
                text.replace(".ipynb)", ".md)").replace(
                    "<details>", '<details markdown="1">'
                )
            )
    title, text = parts[0].split("\n", 1)
    parts[0] = f"{title}\n\n[Download this notebook]({path.name})\n{text}"
    return "\n\n".join(parts)


def reference() -> str:
    """Return the first page of the reference."""
    return "\n".join(
        [
            "# Reference",
            "",
            "These pages are generated from the code of this version.",
            "",
            (
                "* [Keys of a scene file](scenes.md): every key with its default, its"
                " range and its unit."
            ),
            (
                "* [Commands](commands.md): arguments and options of `taichi-disk` and"
                " its commands."
            ),
            "* [Python](python.md): functions and classes for scripts and notebooks.",
            "",
            (
                "The files and columns of a run are listed in [output](../output.md),"
                " words in the [glossary](../glossary.md)."
            ),
        ]
    )


def scene_keys() -> str:
    """Return a page with every key of a scene file, by kind of scene and section."""
    from taichi_disk.experiments.scenes import SCENES
    from taichi_disk.experiments.scenes.scene import yaml_scalar

    lines = [
        "# Keys of a scene file",
        "",
        "`taichi-disk check SCENE` prints all keys of a scene.",
        "",
    ]
    lines += [
        (
            "Angles are in radians: 30 degrees are 0.5236, 45 degrees 0.7854. Speeds"
            " are in c, lengths in R."
        ),
        "",
    ]
    for name, kind in SCENES.items():
        lines += [f"## {name}", "", f"{kind.title[0].upper()}{kind.title[1:]}.", ""]
        for section, defaults in kind.sections().items():
            lines += [
                f"### {name}: {section}",
                "",
                "| key | default | allowed | meaning |",
                "|---|---|---|---|",
            ]
            for one, key in defaults.schema().items():
                default = yaml_scalar(getattr(defaults, one))
                lines.append(
                    f"| `{section}.{one}` | `{default}` | {key.allowed()} |"
                    f" {key.meaning} |"
                )
            lines.append("")
    return "\n".join(lines)


def commands() -> str:
    """Return a page with the help text of each command."""
    from argparse import _SubParsersAction

    from taichi_disk.cli import _parser

    (parsers,) = (
        one.choices for one in _parser()._actions if isinstance(one, _SubParsersAction)
    )
    parts = [
        f"## {name}\n\n```text\n{parser.format_help()}```\n"
        for name, parser in parsers.items()
    ]
    return "\n".join(["# Commands\n", *parts])


def python() -> str:
    """Return a page of directives for mkdocstrings."""
    lines = [
        "# Python",
        "",
        "[Examples of all of this](../api.md) are on a page of their own.",
        "",
    ]
    for title, names in PYTHON.items():
        lines += [f"## {title}", ""]
        for name in names:
            lines += [f"::: {name}", "    options: {heading_level: 3}", ""]
    return "\n".join(lines)
