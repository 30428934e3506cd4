"""Each shipped scene, run as a user runs it, gives its number.

The numbers were made once with `reference` on the scene's own lattice.npz: restitutions by DOP853 (rtol 1e-12, or
1e-10 from reset to reset), xi by Newton's method until the reference's forces were below 1e-10 P/N. The tolerance is
the error that the automatic step may have: 2e-5 in e, 1e-5 of xi.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from reference import Model

from taichi_disk import load_scene, run

HEADLINES = {
    "exponential_wall": ("restitution", 0.967229322, 2e-5),
    "absorbing_wall": ("restitution", 0.947729942, 2e-5),
    "compression": ("xi", 0.0152555319, 1.5e-7),
}


@pytest.fixture(scope="module", params=list(HEADLINES))
def shipped(request, tmp_path_factory):
    out = tmp_path_factory.mktemp(request.param)
    return request.param, run(load_scene(request.param), out, video=False), out


def test_gives_its_headline(shipped):
    name, result, _ = shipped
    key, expected, tolerance = HEADLINES[name]
    assert result.status == "done"
    assert result.headline[key] == pytest.approx(expected, abs=tolerance)


def test_accounts_for_its_energy(shipped):
    _, _, out = shipped
    energy = json.loads((out / "summary.json").read_text())["energy"]
    assert abs(energy["closing_imbalance"]) < 2e-5
    assert energy["worst_imbalance"] < 1e-4


@pytest.mark.validate
@pytest.mark.parametrize(("eta_star", "velocity"), [(0, 3e-3), (10, 2e-2), (100, 5e-2)])
def test_impacts_of_1099_points_agree_with_dop853(eta_star, velocity, tmp_path):
    # The paper's lattice and the corners of its range: |e - e_ref| < 2e-5 at the automatic step. (All nine pairs of
    # eta* = 0, 10, 100 and v = 3e-3, 2e-2, 5e-2 hold; with eta* = 100 and v = 3e-3 DOP853 takes minutes.)
    scene = load_scene("exponential_wall", (f"material.eta_star={eta_star}", f"impact.velocity={velocity}"))
    result = run(scene, tmp_path, video=False)
    start, end = np.load(tmp_path / "lattice.npz"), float(np.load(tmp_path / "final.npz")["t"])
    model = Model(
        start["bonds"],
        start["rest_lengths"],
        start["masses"][0],
        1099,
        k_b=1e-3,
        eta=eta_star / 1099,
        rigid=True,
    )
    _, v = model.solve(start["positions"], start["velocities"], end, rtol=1e-9)
    assert result.headline["restitution"] == pytest.approx(v[:, 1].mean() / velocity, abs=2e-5)
    assert abs(result.summary["energy"]["closing_imbalance"]) < 2e-5
    assert result.summary["energy"]["worst_imbalance"] < 1e-4
