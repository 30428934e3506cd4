"""`taichi-disk accuracy`: its sentence, tables and picture."""

import csv

import pytest

from taichi_disk import load_scene, run
from taichi_disk.cli import main
from taichi_disk.studies.accuracy import steps, study


def accuracy(out, scene, *settings):
    changes = [f"--set={one}" for one in ("lattice.points=30", *settings)]
    return main(["accuracy", scene, "--out", str(out), *changes])


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(steps, "FRACTIONS", (0.8, 0.4))
    monkeypatch.setattr(steps, "REPEATS", 1)
    monkeypatch.setattr(study, "SEEDS", 3)


@pytest.mark.validate
def test_accuracy_does_not_write_into_the_folder_of_a_run(tmp_path, capsys):
    scene = load_scene("exponential_wall", ["lattice.points=30"])
    run(scene, tmp_path, video=False, lattices=1)
    for out, reason in (
        (tmp_path, "holds a run"),
        (tmp_path / "summary.json", "is a file"),
    ):
        assert accuracy(out, "exponential_wall") == 2
        assert reason in capsys.readouterr().err


@pytest.mark.validate
def test_a_step_too_long_for_finer_lattices_still_gives_a_report(tmp_path, capsys):
    assert accuracy(tmp_path, "exponential_wall", "time.dt=0.04") == 0
    first, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith("restitution: time step ")
    assert first.endswith("not smaller steps")
    assert any(line.startswith(" integrator ") for line in rest)
    assert first in (tmp_path / "accuracy.md").read_text(encoding="utf-8")
    assert (tmp_path / "accuracy.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "accuracy.csv").open() as file:
        rows = list(csv.DictReader(file))
    (own,) = (row for row in rows if row["own"] == "True")
    assert float(own["dt"]) == pytest.approx(0.04, rel=0.01)
    assert {row["integrator"] for row in rows} == {"velocity_verlet", "trapezoidal"}


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ("time.dt=0.5", "beyond the stability limit"),
        ("wall.friction=0.1", "wall.friction: must be 0"),
    ],
)
def test_what_cannot_be_measured_is_refused_at_once(setting, reason, tmp_path, capsys):
    assert accuracy(tmp_path / "out", "exponential_wall", setting) == 2
    assert reason in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_compression_has_no_steps_to_measure(tmp_path, capsys):
    assert accuracy(tmp_path, "compression") == 0
    sentence = "xi: no time step (an equilibrium), lattice scatter"
    assert capsys.readouterr().out.startswith(sentence)
    assert sentence in (tmp_path / "accuracy.md").read_text(encoding="utf-8")
    assert not (tmp_path / "accuracy.csv").exists()
