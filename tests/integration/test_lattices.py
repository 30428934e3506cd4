"""A result is the mean over random lattices with their scatter, followed by the value
of the scene's lattice."""

from __future__ import annotations

import json

import numpy as np
import pytest

from taichi_disk import Lattice, load_scene, load_sweep, run, run_sweep
from taichi_disk.api import lattices
from taichi_disk.cli import main
from taichi_disk.errors import InputError, SimulationError

SMALL = {"lattice.points": 60, "lattice.seed": 3, "material.viscosity": 0.0091}


@pytest.mark.parametrize(
    ("kind", "keys"),
    [
        ("exponential_wall", {"impact.angle": 0.4}),
        ("compression", {"compression.method": "newton"}),
        pytest.param(
            "absorbing_wall", {"wall.points": 100}, marks=pytest.mark.validate
        ),
        pytest.param(
            "compression",
            {"compression.method": "relaxation"},
            marks=pytest.mark.validate,
        ),
    ],
)
def test_mean_and_scatter_are_those_of_a_sweep_over_the_same_seeds_to_all_digits(
    tmp_path, kind, keys
):
    result = run(
        load_scene(kind).with_(SMALL | keys), tmp_path / "run", video=False, lattices=4
    )
    nested: dict = {"scene": kind, "sweep": {"seed": [3, 4, 5, 6]}}
    for key, value in (SMALL | keys).items():
        section, name = key.split(".")
        nested.setdefault(section, {})[name] = value
    del nested["lattice"]["seed"]
    rows = run_sweep(load_sweep(nested), tmp_path / "sweep", jobs=1).rows
    found = json.loads((tmp_path / "run" / "summary.json").read_text())["lattices"]
    assert found.pop("seeds") == [3, 4, 5, 6] and list(found) == list(result.numbers)
    for name, summary in found.items():
        values = [row[name] for row in rows]
        assert summary == {
            "values": values,
            "mean": np.mean(values),
            "standard_deviation": np.std(values, ddof=1),
        }
    assert result.scatter == found[next(iter(found))]["standard_deviation"] > 0.0
    assert {
        name: summary["values"][0] for name, summary in found.items()
    } == result.numbers


def test_eight_lattices_are_computed_or_fewer_with_a_note_if_that_takes_long(
    monkeypatch,
):
    scene = load_scene("exponential_wall").with_(SMALL)
    result = run(scene)
    assert (
        result.summary["lattices"]["seeds"] == list(range(3, 11))
        and "notes" not in result.summary
    )
    alone = run(scene, lattices=1)
    assert alone.scatter is None and not {"lattices", "notes"} & set(alone.summary)
    assert alone.numbers == result.numbers and alone.error == result.error
    each = len(scene.scenario().lattice.bonds) * (
        result.summary["steps"] * result.summary["attempts"] + 1500
    )
    for budget, count in ((4.5, 5), (1.5, 1)):
        monkeypatch.setattr(lattices, "EVALUATIONS", budget * each)
        some = run(scene).summary
        assert len(some.get("lattices", {"seeds": [3]})["seeds"]) == count
        assert len(some["notes"]) == 1 and "lattices=8" in some["notes"][0]


def test_a_custom_body_has_no_seeds_and_the_run_notes_it():
    scene, own = load_scene("exponential_wall").with_(SMALL), Lattice.disk(60, seed=5)
    for options in ({"lattice": own}, {"velocities": np.tile([0.0, -0.03], (60, 1))}):
        summary = run(scene, lattices=4, **options).summary
        assert "lattices" not in summary and "have no seed" in summary["notes"][0]
        assert "notes" not in run(scene, lattices=1, **options).summary


def test_a_lattice_without_a_result_is_reported_and_left_out(monkeypatch):
    plain = lattices.outcome_of

    def fails_at_5(scene, **options):
        if scene.lattice.seed == 5:
            raise SimulationError("blow-up")
        return plain(scene, **options)

    monkeypatch.setattr(lattices, "outcome_of", fails_at_5)
    summary = run(load_scene("exponential_wall").with_(SMALL), lattices=4).summary
    assert (
        summary["lattices"]["seeds"] == [3, 4, 6]
        and len(summary["lattices"]["restitution"]["values"]) == 3
    )
    assert summary["warnings"] == [
        "there is no result on the lattice of seed 5: blow-up"
    ]


@pytest.mark.parametrize("count", [0, -1, 2.5, "8", 10_001])
def test_the_number_of_lattices_must_be_whole(count):
    with pytest.raises(
        InputError, match="lattices: must be a whole number from 1 to 10,000, not"
    ):
        run(load_scene("exponential_wall").with_(SMALL), lattices=count)


def test_screen_card_and_plot_begin_with_the_mean_and_the_scatter(tmp_path, capsys):
    out = str(tmp_path / "run")
    keys = [f"--set={name}={value}" for name, value in SMALL.items()]
    assert (
        main(
            [
                "run",
                "exponential_wall",
                "--no-video",
                "--lattices",
                "4",
                "--out",
                out,
                *keys,
            ]
        )
        == 0
    )
    first, second, *_ = capsys.readouterr().out.splitlines()
    found = json.loads((tmp_path / "run" / "summary.json").read_text())
    mean, scatter = (
        found["lattices"]["restitution"][name]
        for name in ("mean", "standard_deviation")
    )
    name, value, error = (
        first[:14].strip(),
        first[14:].split("±")[0],
        first.split("±")[1].split()[0],
    )
    assert name == "restitution e" and first.endswith(
        "(mean and scatter of 4 lattices)"
    )
    assert (
        float(value) == pytest.approx(mean, abs=0.1 * scatter)
        and scatter <= float(error) < 1.1 * scatter
    )
    assert (
        second.split("±")[0].split()[:-1] == ["of", "this", "lattice,", "seed", "3"]
        and "(time step)" in second
    )
    assert float(second.split("±")[0].split()[-1]) == pytest.approx(
        found["restitution"], abs=1e-4
    )
    result = run(load_scene("exponential_wall").with_(SMALL), lattices=4)
    assert (
        first.split()[2] in result.plot()._suptitle.get_text()
        and first.split()[2] in result._repr_html_()
    )
    assert (
        "lattices"
        not in run(load_scene("exponential_wall").with_(SMALL), lattices=1)
        .plot()
        ._suptitle.get_text()
    )
