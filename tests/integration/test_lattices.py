"""A result is the mean over random lattices, then the value of the scene's lattice."""

import json
import re
from html import escape

import numpy as np
import pytest

from taichi_disk import Lattice, Result, load_scene, load_sweep, run, run_sweep
from taichi_disk.base.errors import SimulationError
from taichi_disk.runs.api import lattices

LONG = pytest.mark.validate
RELAXATION = {"compression.method": "relaxation"}
SMALL = {"lattice.points": 60, "lattice.seed": 3, "material.viscosity": 0.0091}
SCENE = load_scene("exponential_wall").with_(SMALL)


@pytest.mark.usefixtures("without_plots", "without_figures")
@pytest.mark.parametrize(
    ("kind", "keys"),
    [
        ("exponential_wall", {"impact.angle": 0.4}),
        ("compression", {"compression.method": "newton"}),
        pytest.param("absorbing_wall", {"wall.points": 100}, marks=LONG),
        pytest.param("compression", RELAXATION, marks=LONG),
    ],
)
def test_mean_and_scatter_are_those_of_a_sweep_over_the_same_seeds_to_all_digits(
    tmp_path, kind, keys
):
    scene = load_scene(kind).with_(SMALL | keys)
    result = run(scene, tmp_path / "run", video=False, lattices=4)
    nested = {"scene": kind, "sweep": {"seed": [3, 4, 5, 6]}}
    for key, value in (SMALL | keys).items():
        section, name = key.split(".")
        nested.setdefault(section, {})[name] = value
    del nested["lattice"]["seed"]
    rows = run_sweep(load_sweep(nested), tmp_path / "sweep", jobs=1).rows
    found = json.loads((tmp_path / "run" / "summary.json").read_text())["lattices"]
    assert found.pop("seeds") == [3, 4, 5, 6]
    thrown = kind != "compression"
    vibration = found.pop("vibration_left", None)
    assert list(found) == list(result.numbers)
    assert (vibration is not None) == thrown
    if thrown:
        assert vibration["values"][0] == result.summary["energy"]["vibration_left"]
        assert len(set(vibration["values"])) == 4
    for name, summary in found.items():
        values = [row[name] for row in rows]
        error = np.std(values, ddof=1) / np.sqrt(4)
        # Student's t for 95 % and three degrees of freedom, from a table
        ends = np.mean(values) + error * 3.182446305284263 * np.array([-1.0, 1.0])
        assert summary == {
            "values": values,
            "mean": np.mean(values),
            "standard_deviation": np.std(values, ddof=1),
            "standard_error": pytest.approx(error, rel=1e-12),
            "interval_95": pytest.approx(ends, rel=1e-12),
        }
    primary = found[next(iter(found))]
    loaded = Result.load(tmp_path / "run", estimate=False)
    for one in (result, loaded):
        assert one.mean == primary["mean"]
        assert one.scatter == primary["standard_deviation"] > 0.0
        assert one.standard_error == primary["standard_error"]
        assert one.interval_95 == primary["interval_95"]
    first = {name: summary["values"][0] for name, summary in found.items()}
    assert first == result.numbers


def test_eight_lattices_are_computed_of_small_bodies_whose_runs_are_short(monkeypatch):
    result = run(SCENE)
    assert result.summary["lattices"]["seeds"] == list(range(3, 11))
    assert "notes" not in result.summary
    alone = run(SCENE, lattices=1)
    assert alone.scatter is alone.mean is alone.standard_error is None
    assert alone.interval_95 is None
    assert not {"lattices", "notes"} & set(alone.summary)
    assert alone.numbers == result.numbers
    assert alone.error == result.error
    monkeypatch.setattr(lattices, "MAX_POINTS", 59)
    large = run(SCENE).summary
    assert "lattices" not in large
    assert "more than 59 points; lattices=8" in large["notes"][0]
    monkeypatch.undo()
    monkeypatch.setattr(lattices, "ESTIMATE_UP_TO", 1e4)
    long = run(SCENE).summary
    assert "lattices" not in long
    assert "5 s; lattices=8" in long["notes"][0]


def test_a_lattice_far_off_makes_the_interval_no_summary():
    literal = {"points": 120, "rim": False, "min_spacing": 0.0, "seed": 96}
    result = run(SCENE.with_(literal), lattices=8)
    found = result.summary["lattices"]["restitution"]["values"]
    median = np.median(found)
    # it lies 6 interquartile ranges below the median
    assert np.argmax(abs(found - median)) == 3
    (warning,) = [text for text in result.summary["warnings"] if "far off" in text]
    assert warning.startswith("restitution: the lattice of seed 99 lies far off")
    assert f"the median is {median:.4g}" in warning
    usual = run(SCENE, lattices=8).summary["warnings"]
    assert not any("far off" in text for text in usual)


@pytest.mark.parametrize(
    ("kind", "keys", "count", "reason"),
    [
        ("exponential_wall", {"time.tolerance": 1e-3}, 3, "a tolerance"),
        pytest.param("compression", RELAXATION, 3, "a relaxation", marks=LONG),
        ("compression", {"compression.method": "newton"}, 8, ""),
    ],
)
def test_relaxations_and_tolerances_take_three_lattices(kind, keys, count, reason):
    small = {"lattice.points": 40, "material.viscosity": 0.0091}
    summary = run(load_scene(kind).with_(small | keys)).summary
    assert len(summary["lattices"]["seeds"]) == count
    notes = summary.get("notes", [])
    assert len(notes) == bool(reason)
    for note in notes:
        assert f"only 3 lattices were computed, because {reason}" in note


def test_a_custom_body_has_no_seeds_and_the_run_notes_it():
    own = Lattice.disk(60, seed=5)
    for options in ({"lattice": own}, {"velocities": np.tile([0.0, -0.03], (60, 1))}):
        summary = run(SCENE, lattices=4, **options).summary
        assert "lattices" not in summary
        assert "have no seed" in summary["notes"][0]
        assert "notes" not in run(SCENE, lattices=1, **options).summary


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (SimulationError("blow-up"), "blow-up"),
        (ValueError("empty"), "ValueError: empty"),
        (MemoryError(), "MemoryError: "),
    ],
)
def test_a_lattice_without_result_is_reported_and_left_out(monkeypatch, error, reason):
    plain = lattices.outcome_of

    def fails_at_5(scene, **options):
        if scene.lattice.seed == 5:
            raise error
        return plain(scene, **options)

    monkeypatch.setattr(lattices, "outcome_of", fails_at_5)
    summary = run(SCENE, lattices=4).summary
    assert summary["lattices"]["seeds"] == [3, 4, 6]
    assert len(summary["lattices"]["restitution"]["values"]) == 3
    text = f"there is no result on the lattice of seed 5: {reason}"
    assert summary["warnings"] == [text]


def test_a_run_in_python_says_that_lattices_were_folded(notices):
    result = run(SCENE, lattices=3, velocity=0.7)
    of_this, of_others = result.warnings
    assert "turned inside out" in of_this
    assert of_others.startswith("2 of 2 other lattices, one of them: ")
    assert "…" not in of_others
    assert notices.messages == result.warnings
    assert "see .warnings" in repr(result)
    html = result._repr_html_()
    assert all(escape(text) in html for text in result.warnings)


def test_an_interrupt_during_another_lattice_ends_the_run(monkeypatch):
    def interrupted(scene, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(lattices, "outcome_of", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(SCENE, lattices=4)


@pytest.mark.validate
def test_line_card_and_plot_begin_with_the_mean_or_the_only_result():
    result = run(SCENE, lattices=4)
    title = result.plot()._suptitle.get_text()
    quoted = re.search(r"restitution e (0\.\d+)", repr(result))[1]
    half_width = 0.5 * (result.interval_95[1] - result.interval_95[0])
    assert float(quoted) == pytest.approx(result.mean, abs=0.05 * half_width)
    assert quoted in result._repr_html_()
    assert quoted in title
    alone = run(SCENE, lattices=1)
    line = repr(alone)
    assert line.startswith("Result(exponential_wall, 60 points, restitution 0.")
    assert len(line) < 100
    html = alone._repr_html_()
    assert "restitution e" in html and f"{alone.error:.0e}"[0] in html
    (image,) = re.findall('data:image/png;base64,[^"]+', html)
    assert len(html) - len(image) < 2500
    figure = alone.plot()
    assert "lattices" not in figure._suptitle.get_text()
    assert (figure.axes[1].lines[0].get_ydata() == alone.series["wall_force"]).all()
    assert figure._repr_png_()[:4] == alone._repr_png_()[:4] == b"\x89PNG"
