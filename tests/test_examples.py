"""Every example in docs/examples runs as it stands, and prints what it promises."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "docs" / "examples"


def output_of(name: str, *arguments: str) -> str:
    command = [sys.executable, str(EXAMPLES / name), *arguments]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.fixture(scope="module")
def impact(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("impact")
    return folder, output_of("one_impact.py", str(folder))


def test_one_impact_tells_where_the_energy_went(impact: tuple[Path, str]) -> None:
    e = float(re.search(r"restitution +([\d.]+)", impact[1])[1])
    lost = float(re.search(r"took ([\d.]+)%", impact[1])[1]) / 100
    # e^2 + dissipated share <= 1; the rest is left as vibration.
    assert 0.8 < e < 1 and 0.95 < e * e + lost <= 1.001


def test_results_are_read_back(impact: tuple[Path, str]) -> None:
    shown = output_of("read_results.py", str(impact[0]))
    found, ledger = re.search(r"kinetic energy (\S+) M c\^2; the ledger says (\S+)", shown).groups()
    assert float(found) == pytest.approx(float(ledger), rel=1e-5)


def test_a_sweep_prints_rows_and_fit(tmp_path: Path) -> None:
    shown = output_of("a_sweep.py", str(tmp_path))
    assert shown.count("seed") == 12
    assert re.search(r"d1 = [\d.]+, between [\d.]+ and [\d.]+", shown)


def test_a_lattice_of_one_s_own_is_thrown(tmp_path: Path) -> None:
    shown = output_of("own_lattice.py")
    points, e = re.search(r"(\d+) points, flat side down: e = ([\d.]+)", shown).groups()
    assert int(points) == 3 * 8 * 9 + 1  # a centred hexagonal number
    assert 0.3 < float(e) < 1.0


def test_there_is_no_other_example() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == {
        "one_impact.py", "a_sweep.py", "own_lattice.py", "read_results.py",
    }  # fmt: skip
