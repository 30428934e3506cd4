"""The page of results says "agrees" where the paper's own numbers are planted, and not elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_disk import theory
from taichi_disk.study import comparison, continuum
from taichi_disk.study.analysis import analyse
from taichi_disk.study.report import fit_table

V = np.geomspace(3e-3, 5e-2, 12)
P = np.linspace(4e-3, 1e-2, 7)
E, NU = 1.1, 0.29


def curves(kind: str, axes: list[str], rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    same = {"status": "done", "young": E, "poisson": NU}
    return analyse(kind, axes, [row | same for row in rows]).summary()["curves"]


def pressed(b: float) -> list[dict[str, Any]]:
    xi = theory.paper_compression(P, E, NU, b)
    return [
        {"pressure": p, "seed": seed, "xi": x * (1 + 0.01 * seed), "xi_nominal": 2 * x * (1 + 0.01 * seed)}
        for seed in (-1, 0, 1)
        for p, x in zip(P, xi, strict=True)
    ]


def thrown(e: np.ndarray, **given: Any) -> list[dict[str, Any]]:
    return [
        {"velocity": v, "seed": seed, "restitution": one * (1 + 1e-4 * seed)} | given
        for seed in (-1, 0, 1)
        for v, one in zip(V, e, strict=True)
    ]


def test_b_is_compared_with_the_interval() -> None:
    for b, verdict in ((1.55, "**b = 1.55**: agrees"), (1.0, "**b = 1.55**: **disagrees**")):
        text = comparison.compression(curves("compression", ["seed", "pressure"], pressed(b)), [], [])
        assert text[0].startswith(verdict)


def test_the_relaxation_is_set_against_newton() -> None:
    rows = [
        {"method": method, "seed": "0", "pressure": "0.01", "xi": xi}
        for method, xi in (("newton", "0.01"), ("relaxation", "0.0100001"))
    ]
    text = comparison.compression(curves("compression", ["seed", "pressure"], pressed(1.0)), [], rows)
    assert "1.0e-05 apart" in text[-1]


def test_the_paper_s_fit_of_figure_6_is_recognised() -> None:
    e = theory.paper_restitution(V, 0.973, 0.119)
    found = curves("absorbing_wall", ["boundary", "seed", "velocity"], thrown(e, boundary="reset"))
    text = comparison.absorbing_wall(found, [], [])[0]
    assert text.count("(agrees)") == 2 and "at most 0.000" in text
    off = curves("absorbing_wall", ["boundary", "seed", "velocity"], thrown(e - 0.02, boundary="reset"))
    assert "**disagrees**" in comparison.absorbing_wall(off, [], [])[0]


def test_shapes_and_d1_of_figure_3_are_judged(monkeypatch: Any) -> None:
    monkeypatch.setattr(comparison, "LATTICES", 1)
    rows = thrown(1 - 20 * V**2, eta_star=0.0)
    rows += thrown(theory.paper_restitution(V, 1.2, 0.9), eta_star=10.0)
    rows += thrown(theory.paper_restitution(V, 1.05, 0.9), eta_star=100.0)
    text = "\n".join(
        comparison.exponential_wall(curves("exponential_wall", ["eta_star", "seed", "velocity"], rows), [], [])
    )
    assert '("convex upwards")**: agrees' in text
    assert "**Convex as η\\* grows**: agrees" in text
    assert "**d1 → 1 as η\\* grows**: agrees" in text


def test_the_pinned_limit_is_told_in_proportion_to_the_interval() -> None:
    e = 1 - V
    rows = thrown(e, boundary="pinned", reset_interval=3e-3)
    rows += [row for tau in (1e-3, 2e-3) for row in thrown(e - 7 * tau, boundary="reset", reset_interval=tau)]
    found = curves("absorbing_wall", ["boundary", "reset_interval", "seed", "velocity"], rows)
    text = comparison.absorbing_wall(found, found, [])
    assert "| 0.001 | 0.00700 | 7.00 | 0.00700 | 7.00 |" in text
    assert "| 0.002 | 0.01400 | 7.00 | 0.01400 | 7.00 |" in text


def grown(**given: Any) -> list[dict[str, str]]:
    """Rows of points.csv for two lattices that scatter by 1 % to either side."""
    return [
        {"status": "done", "young": str(E), "poisson": str(NU), "points": "100", "a": "300.0"}
        | {name: str(value * (1 + off) if name in ("xi", "restitution") else value) for name, value in given.items()}
        for off in (-0.01, 0.01)
    ]


def test_a_disk_that_exceeds_the_exact_law_by_its_strain_alone_has_nothing_left(monkeypatch: Any) -> None:
    law = float(theory.exact_compression(0.01, E, NU))
    monkeypatch.setattr(continuum, "MOST_LATTICES", 2)
    monkeypatch.setattr(continuum, "hard_compression", lambda disk, k_a, pressures, rim=1.0: [(2.03 - rim) * law])
    strained = 1.02 * float(theory.exact_compression(0.01, E, 1 / 3))
    monkeypatch.setattr(continuum, "finite_compression", lambda P, young: strained)
    text = "\n".join(continuum.compression(grown(pressure=0.01, xi=1.02 * law)))
    assert "| +3.00% ± 0.00% | 2 | +2.00% ± 1.02% | 2 | +2.00% | +0.00% ± 1.02% |" in text
    assert text.endswith("N = 100: +48.54%.")


def test_an_impact_that_obeys_eq_4_has_nothing_left(monkeypatch: Any) -> None:
    monkeypatch.setattr(continuum, "contact_viscosity", lambda seed, points, a: 0.004)
    law = theory.quasistatic_impact(0.02, 0.04, E)
    row = {"velocity": 0.02, "eta_star": 10.0, "restitution": law.restitution, "contact_time": 1.1 * law.contact_time}
    line = continuum.impact(grown(**row))[-1]
    assert f"| {law.restitution:.4f} | +0.0000 ± {0.01 * law.restitution:.4f} |" in line and "| +10.0% |" in line


def test_every_fit_is_in_the_table() -> None:
    found = curves("compression", ["seed", "pressure"], pressed(1.0))
    table = fit_table(found)
    assert len(table) == 4 and all(line.count("|") == 5 for line in table)
