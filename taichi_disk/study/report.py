"""docs/results.md: the sweeps' files set against the paper and the theory.

    python -m taichi_disk.study.report FIGURE2 FIGURE3 FIGURE6 [FURTHER ...] [--continuum COMPRESSION IMPACT]
                                       [--out docs/results.md]

Each argument is a folder that `taichi-disk sweep` has left; figures go into `images/` beside the page. Further
sweeps are experiments: what they show about a difference to the paper is told, and their fits are listed. The two
of docs/experiments/continuum_*.yaml are set against the continuum's laws.
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from taichi_disk.errors import InputError
from taichi_disk.results import write_text
from taichi_disk.study import comparison, continuum, reflection, vibration
from taichi_disk.study.tell import SHOWN, curve_title


def page(figure2: Path, figure3: Path, figure6: Path, further: Sequence[Path], grown: Sequence[Path], out: Path) -> str:
    """The text of the page; copies the figures. Raises InputError for a folder without a finished sweep.

    `grown`: the two sweeps towards the continuum, compression and impact, or none.
    """
    main = [_load(folder) for folder in (figure2, figure3, figure6)]
    experiments = {folder.name: _load(folder) for folder in further}
    others = [curve for sweep in experiments.values() for curve in sweep["curves"]]
    tell = (comparison.compression, comparison.exponential_wall, comparison.absorbing_wall)
    titles = ("Figure 2: force against compression", "Figure 3: the exponential wall", "Figure 6: the absorbing wall")
    lines = [
        "# Results against the paper and the theory",
        "",
        "Made by the commands at its end; not edited by hand.",
        "Units: disk mass M = radius R = reference speed c = 1. Intervals are 95 %, from resampling the lattices.",
        "",
    ]
    for title, folder, sweep, paragraphs in zip(titles, (figure2, figure3, figure6), main, tell, strict=True):
        lines += [f"## {title}", "", f"![{title}]({_image(folder, out)})", ""]
        lines += [*paragraphs(sweep["curves"], others, sweep["rows"]), "", *fit_table(sweep["curves"]), ""]
    lines += [*reflection.table(), ""]
    if grown:
        pressed, thrown = (_load(folder)["rows"] for folder in grown)
        lines += ["## Towards the continuum", "", *continuum.compression(pressed), "", *continuum.impact(thrown), ""]
        lines += [*vibration.table(), ""]
    lines += ["## Moduli", "", *comparison.moduli(main[0]["curves"][0]), "", "## Experiments", ""]
    for name, sweep in experiments.items():
        lines += [f"`docs/experiments/{name}.yaml`", "", *fit_table(sweep["curves"]), ""]
    versions = ", ".join(f"{name} {version}" for name, version in main[0]["versions"].items())
    counts = ", ".join(f"{one['points']} points, {len(one['failed'])} failed" for one in main)
    worst = max(abs(float(row["energy_imbalance"])) for one in main for row in one["rows"] if row["energy_imbalance"])
    ledger = f"Largest energy imbalance of an impact: {worst:.1e} of its kinetic energy."
    lines += ["## Provenance", "", f"{versions}. Figures 2, 3 and 6: {counts}. {ledger}"]
    lines += ["This page is what these commands leave:", ""]
    return "\n".join([*lines, *_commands((figure2, figure3, figure6), further, grown), ""])


def _commands(figures: Sequence[Path], further: Sequence[Path], grown: Sequence[Path]) -> list[str]:
    """The command lines that make the page, as a block of code."""
    swept = [folder.name for folder in figures]
    swept += [f"docs/experiments/{folder.name}.yaml" for folder in (*further, *grown)]
    report = ["python -m taichi_disk.study.report", *(f"out/{folder.name}" for folder in (*figures, *further))]
    report += ["--continuum", *(f"out/{folder.name}" for folder in grown)] if grown else []
    return ["```sh", *(f"taichi-disk sweep {name}" for name in swept), " ".join(report), "```"]


def fit_table(curves: Sequence[dict[str, Any]]) -> list[str]:
    """Every fit of every curve as a Markdown table."""
    lines = ["| curve | law | parameters | rms residual |", "|---|---|---|---|"]
    for curve in curves:
        for law, fit in curve["fits"].items():
            values = ", ".join(f"{name} = {comparison.shown(fit, name)}" for name in fit["values"])
            lines.append(f"| {curve_title(curve)} | {SHOWN[law]} | {values} | {fit['rms_residual']:.2g} |")
    return [line.replace("|R - R'|", "abs(R - R')") for line in lines]


def _load(folder: Path) -> dict[str, Any]:
    try:
        summary: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        with (folder / "points.csv").open(encoding="utf-8", newline="") as file:
            summary["rows"] = list(csv.DictReader(file))
    except (OSError, ValueError) as error:
        raise InputError(f"{folder}: no finished sweep there ({error}); run `taichi-disk sweep` first") from None
    if not summary.get("curves"):
        raise InputError(f"{folder}: this sweep has no curve: it needs speeds or pressures as an axis")
    return summary


def _image(folder: Path, out: Path) -> str:
    images = out.parent / "images"
    images.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(folder / "figure.png", images / f"{folder.name}.png")
    return f"images/{folder.name}.png"


def main() -> None:
    parser = argparse.ArgumentParser(description="Write the page of results from the folders of finished sweeps.")
    for name in ("figure2", "figure3", "figure6"):
        parser.add_argument(name, type=Path)
    parser.add_argument("further", type=Path, nargs="*")
    parser.add_argument("--continuum", type=Path, nargs=2, default=(), metavar=("COMPRESSION", "IMPACT"))
    parser.add_argument("--out", type=Path, default=Path("docs/results.md"))
    given = parser.parse_args()
    try:
        folders = (given.figure2, given.figure3, given.figure6, given.further, given.continuum)
        write_text(given.out, page(*folders, given.out))
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
