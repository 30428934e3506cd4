"""Scenes as values: defaults, bounds, and that what is written reads back as the same scene."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from taichi_disk.scene import (
    SCENES,
    AbsorbingWallScene,
    CompressionScene,
    ExponentialWallScene,
    MaterialSection,
    Scene,
)
from taichi_disk.scene_file import load_scene, shipped_scenes

ROOT = Path(__file__).parent.parent


def number(low: float, high: float, *, above: bool = False) -> st.SearchStrategy[float]:
    # Taichi makes its thread take subnormal numbers for zero, reading them from text included.
    return st.floats(low, high, exclude_min=above, allow_subnormal=False)


def auto_or(values: st.SearchStrategy[float]) -> st.SearchStrategy[float | str]:
    return st.just("auto") | values


# The bounds are written out here once more, so that a slip in the schema shows.
LATTICE = {
    "points": st.integers(3, 2_000_000),
    "seed": st.integers(0, 2**32 - 1),
    "rim": st.booleans(),
    "min_spacing": number(0, 0.75),
}
MATERIAL = {"k_a": number(1e-9, 1e6), "k_b": number(0, 1e6), "eta_star": number(0, 1e6)}
WALL = {"a": number(0.1, 1e6), "V0": number(1e-12, 1e12)}
ELASTIC_WALL = {
    "points": st.integers(4, 2_000_000),
    "width": number(0.1, 100),
    **WALL,
    "threshold": number(1e-3, 1e3),
    "boundary": st.sampled_from(["reset", "pinned", "dashpot"]),
    "reset_interval": number(1e-6, 1e3),
}
IMPACT = {
    "velocity": number(1e-6, 10),
    "gap": auto_or(number(0, 1e3, above=True)),
    "max_time": auto_or(number(1e-6, 1e6)),
}
COMPRESSION = {
    "pressure": number(1e-9, 10),
    "method": st.sampled_from(["relaxation", "newton"]),
    "tolerance": number(1e-9, 1e-2),
    "max_time": auto_or(number(1e-6, 1e6)),
}
TIME = {
    "integrator": st.sampled_from(["auto", "velocity_verlet", "trapezoidal", "vefrl"]),
    "precision": st.sampled_from(["f64", "f32"]),
    "dt": auto_or(number(1e-9, 1e3)),
    "safety": number(0, 1, above=True),
    "tolerance": st.just("none") | number(1e-10, 1e-2),
    "sample_interval": auto_or(number(1e-9, 1e6)),
}
VIDEO = {
    "size": st.integers(32, 1080).map(lambda half: 2 * half),
    "fps": st.integers(1, 120),
    "seconds": number(0.1, 600),
    "colour": st.sampled_from(["strain", "force", "speed", "kinetic"]),
    "draw": st.sampled_from(["both", "springs", "points"]),
    "panel": st.booleans(),
    "supersample": st.sampled_from([1, 1.5, 2]),
    "format": st.sampled_from(["mp4", "webm", "gif", "png"]),
}
COMMON = {"lattice": LATTICE, "material": MATERIAL, "time": TIME, "video": VIDEO}
KEYS: dict[str, dict[str, dict[str, st.SearchStrategy[Any]]]] = {
    "compression": {**COMMON, "wall": WALL, "compression": COMPRESSION},
    "exponential_wall": {**COMMON, "wall": WALL, "impact": IMPACT},
    "absorbing_wall": {**COMMON, "wall": ELASTIC_WALL, "impact": IMPACT},
}


# Values that are within their bounds may still contradict each other; these contradict nothing.
HARMLESS = {
    "impact.gap": "auto",
    "wall.threshold": 1e3,
    "time.dt": "auto",
    "time.sample_interval": "auto",
    "time.integrator": "auto",
    "time.precision": "f64",
    "time.tolerance": "none",
}


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    kind = draw(st.sampled_from(sorted(KEYS)))
    data: dict[str, Any] = {"scene": kind}
    for name, keys in KEYS[kind].items():
        if draw(st.booleans()):
            data[name] = draw(st.fixed_dictionaries({}, optional=keys))
    try:
        return SCENES[kind].model_validate(data)
    except ValidationError as error:
        (conflict,) = error.errors()
        assert conflict["type"] == "conflict"
        for key, _ in conflict["ctx"]["conflicts"]:
            section, name = key.split(".")
            data.setdefault(section, {})[name] = HARMLESS[key]
        return SCENES[kind].model_validate(data)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenes") / "scene.yaml"


def test_the_schema_has_exactly_these_sections_and_keys() -> None:
    for kind, sections in KEYS.items():
        scene = SCENES[kind]()
        assert set(type(scene).model_fields) == {"scene", *sections}
        for name, keys in sections.items():
            assert set(type(getattr(scene, name)).model_fields) == set(keys)


@settings(max_examples=200, deadline=None)
@given(scene=scenes())
def test_a_written_scene_reads_back_equal(path: Path, scene: Scene) -> None:
    text = scene.to_yaml()
    path.write_text(text, encoding="utf-8")
    assert load_scene(path) == scene
    assert load_scene(path).to_yaml() == text
    # Plain PyYAML follows YAML 1.1, in which 1e-05 is a string: it has to see the same values too.
    assert SCENES[scene.scene].model_validate(yaml.safe_load(text)) == scene


@pytest.mark.parametrize(
    ("section", "key", "inside", "outside"),
    [
        ("lattice", "points", [3, 2_000_000], [2, 2_000_001, 10**9, -1]),
        ("lattice", "seed", [0, 2**32 - 1], [-1, 2**32]),
        ("lattice", "min_spacing", [0, 0.75], [-1e-9, 0.7500001]),
        ("material", "k_a", [1e-9, 1e6], [0, 1.1e6, -1]),
        ("material", "k_b", [0, 1e6], [-1e-9, 1.1e6]),
        ("material", "eta_star", [0, 1e6], [-1e-9, 1.1e6]),
        ("wall", "a", [0.1, 1e6], [0.09, 1.1e6]),
        ("wall", "V0", [1e-12, 1e12], [0, 1.1e12]),
        ("impact", "velocity", [1e-6, 10], [0, 10.1, -0.02]),
        ("impact", "gap", [1, 1e3, "auto"], [0, 1001, "Auto"]),
        ("impact", "max_time", [1e-6, 1e6, "auto"], [0, 1.1e6]),
        ("time", "dt", [1e-9, 1e3, "auto"], [0, 1001]),
        ("time", "safety", [1e-9, 1], [0, 1.0000001]),
        ("time", "sample_interval", [1e-9, 1e6, "auto"], [0, 1.1e6]),
        ("video", "size", [64, 2160], [62, 2162, 721]),
        ("video", "fps", [1, 120], [0, 121]),
        ("video", "seconds", [0.1, 600], [0.09, 600.1]),
        ("video", "supersample", [1, 1.5, 2.0], [0.5, 1.2, 2.5]),
    ],
)
def test_bounds_are_where_they_are_said_to_be(section: str, key: str, inside: list[Any], outside: list[Any]) -> None:
    for value in inside:
        scene = ExponentialWallScene.model_validate({section: {key: value}})
        assert getattr(getattr(scene, section), key) == value
    for value in [*outside, None, [], {}, "1", True, float("nan"), float("inf"), 10**400]:
        with pytest.raises(ValidationError):
            ExponentialWallScene.model_validate({section: {key: value}})


@pytest.mark.parametrize(
    ("scene", "section", "key", "inside", "outside"),
    [
        (CompressionScene, "compression", "pressure", [1e-9, 10], [0, 10.1]),
        (CompressionScene, "compression", "tolerance", [1e-9, 1e-2], [0, 0.011]),
        (CompressionScene, "compression", "max_time", [1e-6, 1e6, "auto"], [0, 1.1e6]),
        (CompressionScene, "compression", "method", ["relaxation", "newton"], ["Newton", 1]),
        (AbsorbingWallScene, "wall", "points", [4, 2_000_000], [3, 2_000_001]),
        (AbsorbingWallScene, "wall", "width", [0.1, 100], [0.09, 101]),
        (AbsorbingWallScene, "wall", "threshold", [0.1, 1e3], [0, 1e-4, 1001]),
        (AbsorbingWallScene, "wall", "boundary", ["reset", "pinned", "dashpot"], ["free", False]),
        (AbsorbingWallScene, "wall", "reset_interval", [1e-6, 1e3], [0, 1001]),
    ],
)
def test_bounds_of_the_other_scenes(
    scene: type[Scene], section: str, key: str, inside: list[Any], outside: list[Any]
) -> None:
    for value in inside:
        assert getattr(getattr(scene.model_validate({section: {key: value}}), section), key) == value
    for value in outside:
        with pytest.raises(ValidationError):
            scene.model_validate({section: {key: value}})


def test_viscosity_is_what_each_scene_of_the_paper_has() -> None:
    viscosities = {kind: scene().material.eta_star for kind, scene in SCENES.items()}
    assert viscosities == {"compression": 100.0, "exponential_wall": 10.0, "absorbing_wall": 0.0}


def test_an_int_becomes_a_float_and_nothing_else_is_converted() -> None:
    eta = MaterialSection(eta_star=3).eta_star
    assert isinstance(eta, float)
    for rim in (0, 1, "true"):
        with pytest.raises(ValidationError):
            ExponentialWallScene.model_validate({"lattice": {"rim": rim}})
    with pytest.raises(ValidationError):
        ExponentialWallScene.model_validate({"lattice": {"points": 100.0}})


def test_a_scene_cannot_be_changed() -> None:
    scene = ExponentialWallScene()
    with pytest.raises(ValidationError):
        scene.impact.velocity = 1.0  # type: ignore[misc]
    assert hash(scene) == hash(ExponentialWallScene())


def test_every_key_says_what_it_means_and_every_dimension_its_unit() -> None:
    pure = {
        "points",
        "seed",
        "rim",
        "min_spacing",
        "eta_star",
        "boundary",
        "method",
        "tolerance",
        "integrator",
        "precision",
        "safety",
        "colour",
        "draw",
        "panel",
        "supersample",
        "format",
    }
    for kind, scene in SCENES.items():
        for name in KEYS[kind]:
            for key, field in type(getattr(scene(), name)).model_fields.items():
                assert field.description and len(field.description) > 10, (name, key)
                assert isinstance(field.json_schema_extra, dict)
                assert bool(field.json_schema_extra["unit"]) == (key not in pure), (name, key)


# Potential V0 exp(-a y) against v^2/2 with the default a = 300, V0 = 150, v = 0.02:
# 1e-3 of it at y = ln(150/(1e-3 * 2e-4))/300 = 0.06812;
# 1e-5 of it with v = 1e-3 at ln(150/5e-12)/300 = 0.10344.


def test_a_start_within_the_walls_reach_is_refused_with_the_least_gap() -> None:
    with pytest.raises(ValidationError, match=r"impact.gap: .* start at 0.06819 R or farther"):
        ExponentialWallScene.model_validate({"impact": {"gap": 0.068}})
    assert ExponentialWallScene.model_validate({"impact": {"gap": 0.0682}}).impact.gap == 0.0682
    with pytest.raises(ValidationError, match=r"impact\.gap"):
        AbsorbingWallScene.model_validate({"impact": {"gap": 0.06}})


def test_a_threshold_that_cuts_off_a_force_is_refused_with_the_least_one() -> None:
    with pytest.raises(ValidationError, match=r"wall.threshold: .* write 0.1035 R or more"):
        AbsorbingWallScene.model_validate({"impact": {"velocity": 1e-3}})
    AbsorbingWallScene.model_validate({"impact": {"velocity": 1e-3}, "wall": {"threshold": 0.1035}})
    AbsorbingWallScene.model_validate({"impact": {"velocity": 3e-3}})  # the paper's slowest


def test_times_that_contradict_each_other_are_refused_together() -> None:
    with pytest.raises(ValidationError) as refusal:
        AbsorbingWallScene.model_validate({"time": {"dt": 0.01, "sample_interval": 0.005}})
    conflicts = refusal.value.errors()[0]["ctx"]["conflicts"]
    assert [key for key, _ in conflicts] == ["time.sample_interval", "time.dt"]
    AbsorbingWallScene.model_validate({"time": {"dt": 0.01}, "wall": {"boundary": "pinned"}})


def test_the_shipped_scenes_are_the_defaults_written_out() -> None:
    shipped = shipped_scenes()
    assert set(shipped) == {*SCENES, "figure2", "figure3", "figure6"}
    for kind in SCENES:
        path = shipped[kind]
        assert path.read_bytes() == (ROOT / "scenes" / f"{kind}.yaml").read_bytes()
        assert load_scene(kind) == load_scene(path) == SCENES[kind]()
        written = yaml.safe_load(path.read_text(encoding="utf-8"))
        assert {name: set(keys) for name, keys in written.items() if name != "scene"} == {
            name: set(keys) for name, keys in KEYS[kind].items()
        }


def test_the_wheel_holds_every_package_and_the_scenes() -> None:
    # pyproject.toml lists the packages, since the scenes are mapped into one: the list has to keep up.
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (packages,) = re.findall(r"^packages = \[(.*?)^\]", project, re.MULTILINE | re.DOTALL)
    listed = set(re.findall(r'"([^"]+)"', packages))
    folders = {path.parent.relative_to(ROOT) for path in (ROOT / "taichi_disk").rglob("*.py")}
    assert listed == {".".join(folder.parts) for folder in folders} | {"taichi_disk.scene_library"}
