"""Every example in docs/examples runs unchanged, and finds what it promises."""

import re
from pathlib import Path

import numpy as np
import pytest
from programs import printed_by

pytestmark = pytest.mark.validate
EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def output_of(name, *arguments):
    return printed_by(EXAMPLES / f"{name}.py", *arguments)


def numbers(pattern, text):
    found = re.search(pattern, text)
    assert found, text
    return tuple(map(float, found.groups()))


def test_the_example_of_one_impact_accounts_for_its_energy():
    e, lost = numbers(
        r"(?s)restitution +([\d.]+).*took ([\d.]+)%", output_of("one_impact")
    )
    # e^2 + dissipated fraction <= 1; the rest remains as vibration.
    assert 0.8 < e < 1
    assert 0.95 < e * e + lost / 100 <= 1.001


def test_a_trajectory_is_read_at_any_time():
    (strain,) = numbers(
        r"(?s)positions \(50, 300, 2\).*strained most, by ([-+\d.]+)%",
        output_of("trajectory"),
    )
    assert -20.0 < strain < -0.5  # at the greatest compression, in per cent


def test_results_are_read_back(tmp_path):
    from taichi_disk.cli import main

    words = ["exponential_wall", "--set=lattice.points=60", "--no-video"]
    assert main(["run", *words, f"--out={tmp_path / 'o'}"]) == 0
    shown = output_of("read_results", str(tmp_path / "o"))
    found, stated = numbers(
        r"kinetic energy (\S+) M c\^2; the energy balance says (\S+)", shown
    )
    assert found == pytest.approx(stated, rel=1e-5)


def test_a_sweep_prints_rows_and_fit(tmp_path):
    shown = output_of("a_sweep", str(tmp_path))
    assert shown.count("seed") == 12
    assert re.search(r"d1 = [\d.]+, between [\d.]+ and [\d.]+", shown)


def test_a_custom_lattice_is_thrown():
    points, e = numbers(
        r"(\d+) points, flat side down: e = ([\d.]+)", output_of("own_lattice")
    )
    assert points == 3 * 8 * 9 + 1  # a centred hexagonal number
    assert 0.3 < e < 1.0


def test_a_thin_ring_sinks_as_its_closed_form_says():
    found = re.findall(
        r"hole ([\d.]+) R: xi/P = (\S+) .*thin ring (\S+)", output_of("ring")
    )
    assert len(found) == 4
    assert float(found[-1][1]) == pytest.approx(float(found[-1][2]), rel=0.04)
    ratios = [float(xi) / float(thin) for _, xi, thin in found]
    # a thicker ring deforms more in other ways than bending
    assert all(np.diff(ratios) < 0)


def test_an_off_centre_inclusion_makes_the_disk_spin():
    shown = output_of("inclusion")
    found = {
        name: tuple(map(float, one))
        for name, *one in re.findall(
            r"(\w+) +e = (\S+), .*x = (\S+) R, .* (\S+) M", shown
        )
    }
    assert found["none"][1] == found["stiff"][1] == found["soft"][1]
    assert found["heavy"][1] > 0.15
    assert abs(found["heavy"][2]) > 10 * abs(found["none"][2])
    assert found["stiff"][0] > found["soft"][0]


def test_a_sweep_over_cores_finds_that_a_stiff_one_loses_least(tmp_path):
    shown = output_of("composite_sweep", str(tmp_path))
    found = {
        (float(k), float(q)): float(e)
        for k, q, e in re.findall(r"^ *(\S+) +(\S+) +(0\.\d+)$", shown, re.MULTILINE)
    }
    assert len(found) == 9
    assert all(found[10.0, q] > found[1.0, q] > found[0.1, q] for q in (0.1, 1.0, 10.0))


def test_what_the_modes_took_is_missing_in_e_squared(tmp_path):
    picture = tmp_path / "a.png"
    shown = output_of("why_e_is_below_one", str(picture))
    lost, vibration, rotation = numbers(
        r"1 - e\^2 = (\S+); in vibration (\S+), rotation (\S+)", shown
    )
    assert lost == pytest.approx(vibration + rotation, abs=5e-5)
    assert picture.stat().st_size > 1e4
    assert sum(
        numbers(r"modes (\S+), higher (\S+), anharmonic (\S+)", shown)
    ) == pytest.approx(vibration, abs=2e-5)


def test_a_new_force_moves_the_disk_as_its_law_says():
    off, imbalance = numbers(
        r"(?s)off an oscillator by (\S+) R.*imbalance (\S+)", output_of("new_force")
    )
    assert off < 1e-4  # compared with 0.045; errors of the step and of the contact
    assert abs(imbalance) < 2e-5


def test_a_new_integrator_has_its_order():
    (order,) = numbers(r"order ([\d.]+)", output_of("new_integrator"))
    assert order == pytest.approx(4.0, abs=0.1)


def test_a_new_scene_finds_the_lowest_mode_of_a_disk():
    # The quadrupole of a free disk in plane stress: omega R/c_s = 2.35 for nu = 0.28
    # (A. E. H. Love, A Treatise on the Mathematical Theory of Elasticity, 1927), c_s =
    # sqrt(E pi/(2 (1 + nu))) c with E = 1.09. Lattices scatter by 2 %.
    (period,) = numbers(r"period ([\d.]+)", output_of("new_scene"))
    speed = (1.09 * 3.14159 / (2 * 1.28)) ** 0.5
    assert period == pytest.approx(2 * 3.14159 / (2.35 * speed), rel=0.03)
