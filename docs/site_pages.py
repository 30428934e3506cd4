"""Pages of the site that are not pages of docs: README, CONTRIBUTING, notebooks, and references made from the code."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
PYTHON = {
    "Scenes": ("taichi_disk.scenes.load_scene", "taichi_disk.scenes.load_sweep"),
    "Running": ("taichi_disk.api.run", "taichi_disk.api.Result", "taichi_disk.api.State"),
    "Scenes in hand": tuple(f"taichi_disk.config.scene_base.SceneBase.{name}" for name in ("with_", "to_yaml")),
    "Lattices": ("taichi_disk.lattice.lattice.Lattice",),
    "Sweeps": ("taichi_disk.sweep.sweep.run_sweep", "taichi_disk.sweep.sweep.SweepResult"),
    "Fields": ("taichi_disk.fields.field", "taichi_disk.fields.Field", "taichi_disk.fields.stress"),
    "Errors": tuple(f"taichi_disk.errors.{name}Error" for name in ("TaichiDisk", "Input", "Simulation")),
}


def on_files(files: Files, config: Any) -> Files:
    pages = {
        "index.md": (ROOT / "README.md").read_text(encoding="utf-8"),
        "contributing.md": (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"),
        "reference/scenes.md": scene_keys(),
        "reference/commands.md": commands(),
        "reference/python.md": python(),
    }
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    for path in (ROOT / "docs" / "notebooks").glob("*.ipynb"):
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=notebook(path)))
    for path in [*(ROOT / "scenes").glob("*.yaml"), ROOT / "CITATION.cff"]:
        files.append(File.generated(config, str(path.relative_to(ROOT)), abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The links and remarks of a page as the site takes them."""
    if page.file.src_uri.startswith("notebooks/"):
        return markdown
    at_top = page.file.src_uri in ("index.md", "contributing.md")
    text = re.sub(r"^```(\w+) no-run$", r"```\1", markdown, flags=re.MULTILINE)
    text = text.replace("](../README.md", "](index.md").replace("](../CONTRIBUTING.md", "](contributing.md")
    text = text.replace("](docs/", "](") if at_top else text.replace("](../", "](")
    text = text.replace(".ipynb)", ".md)")
    return re.sub(r"\[`?([^]\n`]*)`?\]\((?:scenes|examples|experiments)\)", r"`\1`", text)  # a folder has no page


def notebook(path: Path) -> str:
    """The cells of a notebook, without what they print."""
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "code":
            parts.append(f"```python\n{text}\n```")
        else:
            parts.append(text.replace(".ipynb)", ".md)").replace("<details>", '<details markdown="1">'))
    title, text = parts[0].split("\n", 1)
    parts[0] = f"{title}\n\n[Download this notebook]({path.name})\n{text}"
    return "\n\n".join(parts)


def scene_keys() -> str:
    """Every key of a scene file, by kind of scene and section."""
    from taichi_disk.config.scene_base import yaml_scalar
    from taichi_disk.scenes import SCENES

    lines = ["# Keys of a scene file", "", "`taichi-disk check SCENE` prints these for a scene of yours.", ""]
    for name, kind in SCENES.items():
        lines += [f"## {name}", "", f"{kind.title[0].upper()}{kind.title[1:]}.", ""]
        for section, defaults in kind.sections().items():
            lines += [f"### {name}: {section}", "", "| key | default | may be | meaning |", "|---|---|---|---|"]
            for one, key in defaults.schema().items():
                default = yaml_scalar(getattr(defaults, one))
                lines.append(f"| `{section}.{one}` | `{default}` | {key.allowed()} | {key.meaning} |")
            lines.append("")
    return "\n".join(lines)


def commands() -> str:
    """What `--help` says of each command."""
    from argparse import _SubParsersAction

    from taichi_disk.cli import _parser

    (parsers,) = (one.choices for one in _parser()._actions if isinstance(one, _SubParsersAction))
    parts = [f"## {name}\n\n```text\n{parser.format_help()}```\n" for name, parser in parsers.items()]
    return "\n".join(["# Commands\n", *parts])


def python() -> str:
    """Directives for mkdocstrings."""
    lines = ["# Python", "", "[Examples of all of this](../api.md) are on a page of their own.", ""]
    for title, names in PYTHON.items():
        lines += [f"## {title}", ""]
        for name in names:
            lines += [f"::: {name}", "    options: {heading_level: 3}", ""]
    return "\n".join(lines)
