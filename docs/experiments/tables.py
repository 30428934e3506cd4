"""The tables of docs/results.md, from its sweeps: CSV files in docs/data.

    python docs/experiments/tables.py [folder of the sweeps] [folder of the tables]

About two minutes of one core, nearly all of it for the vibrations of the continuum.
"""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from disk_modes import YOUNG as YOUNG_OF_FINE_LATTICES, Disk
from quasistatic import quasistatic_impact

from taichi_disk.experiments.scenes.compression import (
    exact_compression,
    paper_compression,
)
from taichi_disk.runs.api.lattices import half_width_95
from taichi_disk.studies.figures import theory

YOUNG = 1.107  # mean of 32 lattices of 1099 points [M c^2/R^2]
# tau0 of a pressed contact per unit of eta*, by the number of points [R/c], from
# contact_viscosity.py with the arguments 1099 4, 4396 2 12000 and 17584 1 48000.
TAU0 = {1099: 3.9e-3, 4396: 9.94e-4, 17584: 2.62e-4}
# [c] the paper's range, as in scenes/figure3.yaml
SPEEDS = np.geomspace(3e-3, 5e-2, 12)
PAPER = {"b": 1.55, "nu": 0.075, "d1": 0.973, "d2": 0.119}  # values of figures 2 and 6

Row = dict[str, Any]


def curves(sweep: str) -> list[Row]:
    return json.loads((SWEEPS / sweep / "summary.json").read_text())["curves"]


def write(name: str, rows: list[Row]) -> None:
    with (TABLES / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(
            file,
            list(dict.fromkeys(key for row in rows for key in row)),
            lineterminator="\n",
        )
        table.writeheader()
        for row in rows:
            table.writerow(
                {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()}
            )


def fitted(curve: Row, law: str, prefix: str = "") -> Row:
    """Return the parameters of a fit with their intervals, the root mean square of its
    residuals, and how often chance makes the law fit as badly."""
    fit = curve["fits"][law]
    row: Row = {}
    for name, value in fit["values"].items():
        row[prefix + name] = value
        if name in fit["intervals_95"]:
            row[f"{prefix}{name}_low"], row[f"{prefix}{name}_high"] = fit[
                "intervals_95"
            ][name]
    for name in ("rms_residual", "p_value"):
        if fit[name] is not None:
            row[prefix + name] = fit[name]
    return row


def points(*sweeps: str) -> list[Row]:
    """Return mean, standard deviation and half the 95 % interval of the primary result
    at each speed or force."""
    rows = []
    for curve in [curve for sweep in sweeps for curve in curves(sweep)]:
        label = {k: v for k, v in curve.items() if isinstance(v, (str, int, float))}
        unknown = [None] * len(curve["x"])
        deviations = curve["standard_deviation"] or unknown
        half_widths = curve["half_width_95"] or unknown
        for x, mean, deviation, half_width in zip(
            curve["x"], curve["mean"], deviations, half_widths, strict=True
        ):
            row = {"x": x, "mean": mean, "deviation": deviation}
            rows.append(label | row | {"half_width_95": half_width})
    return rows


def compression() -> None:
    default = {"a": 300.0, "points": 1099, "rim": True, "min_spacing": 0.7}
    rows = []
    for curve in [
        *curves("figure2")[:1],
        *curves("figure2_lattices"),
        *curves("figure2_variants"),
    ]:
        setting = {key: curve.get(key, value) for key, value in default.items()}
        rows.append(setting | {"lattices": curve["lattices"]} | fitted(curve, "eq2"))
        rows[-1] |= fitted(curve, "eq2_nominal", "nominal_")
    write("figure2_fits", rows)
    rows = []
    for row in points("figure2", "figure2_lattices", "continuum_compression"):
        exact = float(exact_compression(row["x"], row["young"], row["poisson"]))
        row |= {"exact_law": exact, "percent_above": 100 * (row["mean"] / exact - 1)}
        if row["lattices"] > 1:
            row["percent_half_width_95"] = 100 * row["half_width_95"] / exact
        row["eq2_with_b_1"] = float(
            paper_compression(row["x"], row["young"], row["poisson"])
        )
        rows.append({"a": 300.0, "points": 1099} | row)
    write("figure2_points", rows)


def impacts() -> None:
    write("figure3_points", points("figure3", "figure3_hardness"))
    rows = []
    for curve in [
        *curves("figure3"),
        *curves("figure3_hardness"),
        *curves("continuum_impact"),
    ]:
        setting = {
            "points": curve.get("points", 1099),
            "a": curve.get("a", 300.0),
            "eta_star": curve["eta_star"],
        }
        if setting["points"] == 1099 and len(curve["x"]) < 12:
            continue
        row = (
            setting
            | {"lattices": curve["lattices"], "speeds": len(curve["x"])}
            | fitted(curve, "eq5")
        )
        row |= {"e_slowest": curve["mean"][0], "e_fastest": curve["mean"][-1]}
        if "curvature" in curve["fits"]:
            row |= fitted(curve, "curvature")
        if tau0 := TAU0[row["points"]] * curve["eta_star"]:
            row["tau0"] = tau0
            e = np.array(
                [[quasistatic_impact(v, tau0, YOUNG).restitution for v in SPEEDS]]
            )
            row["eq4_d1"], row["eq4_d2"] = theory.fit_restitution(
                SPEEDS, e
            ).values.values()
            c = (np.pi * YOUNG) ** 0.5
            row["first_order_d2"], row["paper_d2"] = (
                np.pi * tau0 * c,
                2.0 * np.pi * tau0 * c,
            )
            row |= fitted(curve, "eq4", "fitted_")
        rows.append(row)
    write("figure3_fits", rows)


def towards_eq4() -> None:
    """Write impacts of finer lattices on harder walls, compared with equation (4)."""
    with (SWEEPS / "continuum_impact" / "points.csv").open() as file:
        measured = list(csv.DictReader(file))
    rows = []
    for row in points("continuum_impact"):
        tau0 = TAU0[row["points"]] * row["eta_star"]
        theirs = quasistatic_impact(row["x"], tau0, row["young"])
        same = [
            float(run["contact_time"])
            for run in measured
            if all(float(run[key]) == row[key] for key in ("points", "a", "eta_star"))
            and float(run["velocity"]) == row["x"]
        ]
        row |= {
            "tau0": tau0,
            "eq4": theirs.restitution,
            "difference": row["mean"] - theirs.restitution,
        }
        row |= {
            "contact_time": float(np.mean(same)),
            "eq4_contact_time": theirs.contact_time,
        }
        row["percent_longer"] = 100 * (row["contact_time"] / theirs.contact_time - 1)
        rows.append(row)
    write("continuum_impact", rows)


def undamped() -> None:
    """Write the continuum by its vibrations, and lattices for comparison."""
    rows: list[Row] = []
    speeds = (3e-3, 7.5e-3, 2e-2, 5e-2)
    for body, a in ((Disk(128, 5, 400), 3000.0), (Disk(256, 5, 800), 48000.0)):
        for v in (*speeds, 0.1) if a == 3000.0 else speeds:
            e, _, ellipse, contact_time = body.impact(v, a)
            theirs = quasistatic_impact(v, 0.0, YOUNG_OF_FINE_LATTICES).contact_time
            row = {
                "body": "continuum",
                "a": a,
                "velocity": v,
                "e": e,
                "percent_lost": 100 * (1 - e**2),
            }
            row |= {"percent_in_ellipse": 100 * ellipse, "contact_time": contact_time}
            rows.append(row | {"percent_longer": 100 * (contact_time / theirs - 1)})
    for row in points("undamped_hard_wall"):
        setting = {
            "body": f"lattice of {row['points']}",
            "a": 3000.0,
            "velocity": row["x"],
            "e": row["mean"],
        }
        found = {"half_width_95": row["half_width_95"], "lattices": row["lattices"]}
        rows.append(setting | found)
    with (TABLES / "linear_lattice.csv").open() as file:
        for line in csv.DictReader(file):
            row = {
                "body": f"linearised lattice of {line['points']}",
                "a": 3000.0,
                "velocity": float(line["velocity"]),
            }
            row |= {
                "e": float(line["e"]),
                "half_width_95": half_width_95(
                    float(line["error"]), int(line["lattices"])
                ),
                "lattices": line["lattices"],
            }
            rows.append(row)
    write("undamped", rows)


def absorbing() -> None:
    write("figure6_points", points("figure6"))
    rows = []
    for curve in [*curves("figure6"), *curves("figure6_intervals")]:
        v, e = np.array(curve["x"]), np.array(curve["mean"])
        setting = (
            {"boundary": curve["boundary"], "reset_interval": 3e-3}
            if curve["boundary"] == "reset"
            else {}
        )
        row = (
            {"boundary": curve["boundary"]}
            | setting
            | {"lattices": curve["lattices"], "speeds": len(v)}
        )
        row["reset_interval"] = curve.get(
            "reset_interval", row.get("reset_interval", "")
        )
        row |= fitted(curve, "eq5") | {"e_slowest": e[0], "e_fastest": e[-1]}
        row["from_paper"] = float(
            np.abs(e - theory.paper_restitution(v, PAPER["d1"], PAPER["d2"])).max()
        )
        rows.append(row)
    pinned = rows[-1]
    for row in rows[3:-1]:
        for end in ("slowest", "fastest"):
            row[f"loss_over_interval_{end}"] = float(
                (pinned[f"e_{end}"] - row[f"e_{end}"]) / row["reset_interval"]
            )
    write("figure6_fits", rows)
    rows = []
    for curve in curves("figure6_depth"):
        depth = curve["wall.points"] * np.pi / 1099 / curve["width"]
        row = {
            "width": curve["width"],
            "depth": float(depth),
            "points": curve["wall.points"],
        }
        row |= {"boundary": curve["boundary"], "lattices": curve["lattices"]}
        rows.append(
            row
            | {f"e_at_{v:g}": e for v, e in zip(curve["x"], curve["mean"], strict=True)}
        )
    write("figure6_depth", rows)


def paper() -> None:
    """Write the values that the paper prints, and its curve of figure 6 at the slowest
    and the fastest speed."""
    e = theory.paper_restitution(SPEEDS[[0, -1]], PAPER["d1"], PAPER["d2"])
    write(
        "paper",
        [
            PAPER
            | {
                "limit_of_d1": 1,
                "e_slowest": float(e[0]),
                "e_fastest": float(e[1]),
            }
        ],
    )


if __name__ == "__main__":
    here = Path(__file__).parents[1]
    SWEEPS, TABLES = map(
        Path, sys.argv[1:] + ["out", str(here / "data")][len(sys.argv) - 1 :]
    )
    TABLES.mkdir(parents=True, exist_ok=True)
    paper()
    compression()
    impacts()
    towards_eq4()
    absorbing()
    undamped()
