"""Scatter of e, and the share of bounces with e above 1, by bounce and viscosity.

    taichi-disk sweep docs/experiments/bounces.yaml --out out/bounces
    python docs/experiments/bounces.py out/bounces/points.csv docs/images/bounces.png

prints the table of results.md and draws its figure.
"""

import csv
import sys
from pathlib import Path

import numpy as np

from taichi_disk.pictures.curves import OKABE_ITO
from taichi_disk.pictures.plot import STYLE, matplotlib_style

BOUNCES = 6


def restitutions(rows: list[dict[str, str]], eta_star: float) -> np.ndarray:
    """Return e (lattices, BOUNCES)."""
    names = ["restitution", *(f"restitution_{n}" for n in range(2, BOUNCES + 1))]
    chosen = [row for row in rows if float(row["eta_star"]) == eta_star]
    return np.array([[float(row[name] or "nan") for name in names] for row in chosen])


def main(points: str, picture: str) -> None:
    text = Path(points).read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    print("eta*  bounce  lattices  mean     scatter  above 1")
    with matplotlib_style(STYLE | {"font.size": 13}):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.4, 3.6), dpi=140, layout="constrained")
        FigureCanvasAgg(figure)
        ax = figure.subplots()
        for k, eta_star in enumerate(sorted({float(row["eta_star"]) for row in rows})):
            found = restitutions(rows, eta_star)
            bounce = np.arange(1, BOUNCES + 1) + 0.2 * (k - 1)
            for number, e in enumerate(found.T, 1):
                e = e[np.isfinite(e)]
                share = (e > 1.0).mean()
                print(
                    f"{eta_star:4g}  {number}  {len(e):3}  {e.mean():.4f}"
                    f"  {e.std(ddof=1):.4f}  {share:.2f}"
                )
            colour = OKABE_ITO[k]
            ax.plot(bounce, found.T, ".", color=colour, alpha=0.5)
            ax.plot([], [], ".", color=colour, label=f"η* = {eta_star:g}")
        ax.axhline(1.0, color="0.45", linewidth=1.0)
        ax.set(xlabel="bounce", ylabel="restitution e", xticks=range(1, BOUNCES + 1))
        ax.legend(
            loc="lower center",
            bbox_to_anchor=(0.5, 1.0),
            ncols=3,
            fontsize=13,
            markerscale=1.5,
        )
        figure.savefig(picture, metadata={"Software": None})


if __name__ == "__main__":
    main(*sys.argv[1:])
