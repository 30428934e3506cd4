"""Sweep sections: which scenes they define, and the messages about faulty sections."""

import itertools

import numpy as np
import pytest

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.scenes import load_any, load_scene, load_sweep
from taichi_disk.experiments.scenes.sweep_axes import FORMS, Sweep

IMPACT = "scene: exponential_wall\n"


def faults(text, *overrides):
    with pytest.raises(InputError) as refusal:
        load_sweep(IMPACT + text + "\n", overrides)
    lines = str(refusal.value).split("\n")
    return [line.strip().removeprefix("scene:") for line in lines[1:] or lines]


def test_axes_multiply_and_the_last_varies_fastest():
    axes = "eta_star: [0, 10], velocity: {lin: [0.01, 0.03, 3]}, seed: {range: 2}"
    found = [
        (scene.material.eta_star, scene.impact.velocity, scene.lattice.seed)
        for scene in load_sweep(f"{IMPACT}sweep: {{{axes}}}\n").scenes
    ]
    assert found == list(itertools.product((0.0, 10.0), (0.01, 0.02, 0.03), (0, 1)))


def test_each_point_is_the_scene_that_overrides_would_make():
    # An axis from Python may be an array or anything else that has values.
    seeds = (seed for seed in (3.0,))
    axes = {"velocity": np.array([0.01, 0.02]), "seed": seeds, "wall.V0": [7.0]}
    sweep = load_sweep({"scene": "exponential_wall", "sweep": axes})
    block = {"velocity": (0.01, 0.02), "seed": (3,), "wall.V0": (7.0,)}
    assert sweep.blocks == (block,)
    own = ["impact.velocity=0.02", "lattice.seed=3", "wall.V0=7.0"]
    assert sweep.scenes[1] == load_scene("exponential_wall", own)


def test_geometric_axes_have_equal_ratios_and_their_ends():
    sweep = load_sweep(IMPACT + "sweep: {velocity: {geom: [3e-3, 5e-2, 12]}}\n")
    v = sweep.blocks[0]["velocity"]
    assert v[0] == 3e-3
    assert v[-1] == 5e-2
    ratios = [float(b) / float(a) for a, b in itertools.pairwise(v)]
    assert max(ratios) - min(ratios) < 1e-10
    whole = load_sweep(IMPACT + "sweep: {points: {geom: [1000, 4000, 3]}}\n")
    assert [scene.lattice.points for scene in whole.scenes] == [1000, 2000, 4000]


def test_a_list_of_sections_is_swept_one_after_the_other_without_repeats():
    text = "sweep:\n  - {seed: [0, 1, 1]}\n  - {seed: [1, 2], eta_star: [10.0, 3.0]}\n"
    scenes = load_sweep(IMPACT + text).scenes
    found = [(scene.lattice.seed, scene.material.eta_star) for scene in scenes]
    # 10 is the default
    assert found == [(0, 10.0), (1, 10.0), (1, 3.0), (2, 10.0), (2, 3.0)]


@pytest.mark.parametrize(
    "text",
    [
        "{seed: {range: 3}, eta_star: [0, 0.0, 1e2]}",
        "[{a: [300.0]}, {a: [1e-1, 3000]}]",
        "{file: [a b, none]}",
    ],
)
def test_the_resolved_sweep_is_the_same_sweep(text):
    sweep = load_sweep(IMPACT + f"sweep: {text}\n")
    assert load_any(sweep.to_yaml()) == sweep
    assert isinstance(sweep, Sweep)


def test_axes_can_be_set_from_the_command_line():
    text = "sweep: {velocity: {geom: [3e-3, 5e-2, 12]}, seed: {range: 8}}\n"
    axes = ("velocity={lin: [0.01, 0.02, 2]}", "seed=[4]", "lattice.points=[500]")
    sweep = load_sweep(IMPACT + text, [f"sweep.{axis}" for axis in axes])
    assert [*sweep.axes] == ["velocity", "seed", "lattice.points"]
    assert [scene.lattice.points for scene in sweep.scenes] == [500, 500]
    # in every section
    text = "sweep:\n  - {seed: [1, 2], eta_star: [3]}\n  - {velocity: [0.01]}\n"
    changed = ({"seed": (7,), "eta_star": (3.0,)}, {"velocity": (0.01,), "seed": (7,)})
    assert load_sweep(IMPACT + text, ["sweep.seed=[7]"]).blocks == changed
    # instead of a value of the file, but not of an option
    text = "impact: {velocity: 0.5}\n"
    axis = "sweep.velocity=[0.1, 0.2]"
    scenes = load_sweep(IMPACT + text, [axis]).scenes
    assert [scene.impact.velocity for scene in scenes] == [0.1, 0.2]
    with pytest.raises(InputError, match="also given by the scene"):
        load_sweep(IMPACT + text, [axis, "impact.velocity=0.3"])


FAULTS = """
sweep: {eta_sta: [1]} | 2:9: sweep.eta_sta: no key of scene: exponential_wall that
sweep: {speed: [0.01]} | 2:9: sweep.speed: no key of scene: exponential_wall that
sweep: {colour: [strain]} | 2:9: sweep.colour: no key of scene: exponential_wall that
sweep: {seed: 3} | 2:15: sweep.seed: MUST, not 3
sweep: {seed: lin} | 2:15: sweep.seed: MUST, not lin
sweep: {seed: {range: 100001}} | 2:15: sweep.seed: MUST, not {'range': 100001}
sweep: {seed: []} | 2:15: sweep.seed: MUST, not an empty list
sweep: {points: {range: 0}} | 2:17: sweep.points: MUST, not {'range': 0}
sweep: {points: {lin: [1, 3]}} | 2:17: sweep.points: MUST, not {'lin': [1, 3]}
sweep: {points: {lin: [1, 3, 1.5]}} | 2:17: sweep.points: MUST, not {'lin': [1, 3, 1.5]}
sweep: {points: {lin: [3, .inf, 3]}} | 2:17: sweep.points: MUST, not {'lin': [3, inf,
sweep: {points: {geom: [0, 1, 3]}} | 2:17: sweep.points: MUST, not {'geom': [0, 1, 3]}
sweep: {points: {log: [1, 2, 3]}} | 2:17: sweep.points: MUST, not {'log': [1, 2, 3]}
sweep: {} | 2:8: sweep: must be lines of key: values, not an empty mapping
sweep: {seed: [0, [1]]} | 2:19: lattice.seed: must be a whole number from 0 to
lattice: {seed: 1}|sweep: {seed: [0]} | 3:9: sweep.seed: lattice.seed is also given by
sweep: {seed: [0], lattice.seed: [1]} | 2:20: sweep.lattice.seed: lattice.seed is also
lattice: {file: a}|sweep: {seed: [0, 1]} | 3:16: sweep.seed: has no effect with
sweep: {seed: {range: 400}, a: {range: 400}} | 2:1: sweep: 160000 combinations: at most
"""
HINTS = {"eta_sta": "eta_star?", "speed": "velocity?", "colour": "swept"}


@pytest.mark.parametrize("row", FAULTS.strip().split("\n"))
def test_each_fault_is_reported_with_its_place(row):
    text, beginning = row.split(" | ")
    (fault,) = faults(text.replace("|", "\n"))
    assert fault.startswith(beginning.replace("MUST", f"must be {FORMS}"))
    for word, hint in HINTS.items():
        assert word not in text or fault.endswith(hint)


def test_a_wall_is_random_where_the_disk_comes_from_a_file():
    scene = "scene: absorbing_wall\nlattice: {file: own.csv}\n"
    assert len(load_sweep(scene + "sweep: {seed: [0, 1]}\n").scenes) == 2
    with pytest.raises(InputError, match=r"sweep\.points: has no effect"):
        load_sweep(scene + "sweep: {points: [10, 20]}\n")


def test_values_that_disagree_only_together_are_reported_with_the_combination():
    # The fast disk may start at 0.065 R, but the slow one may not.
    assert faults("sweep: {gap: [0.2, 0.065], velocity: [0.05, 0.01]}")[-1].endswith(
        "(at gap: 0.065, velocity: 0.01)"
    )


def test_run_and_sweep_refuse_each_other_s_files_with_advice(tmp_path):
    (tmp_path / "s.yaml").write_text(IMPACT + "sweep: {seed: [0]}\n")
    with pytest.raises(InputError, match="taichi-disk sweep"):
        load_scene(tmp_path / "s.yaml")
    with pytest.raises(InputError, match="taichi-disk run"):
        load_sweep("exponential_wall")
