"""Scenes as values: defaults, bounds, changes; what is written reads back the same."""

from dataclasses import FrozenInstanceError, asdict
from pathlib import Path

import numpy as np
import pytest
import yaml
from bodies import words
from hypothesis import given, reject, settings, strategies as st

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.scenes import (
    SCENES,
    load_scene,
    load_sweep,
    shipped_scenes,
)

ROOT = Path(__file__).parents[3]
KEYS = {
    kind: {
        (section_name, name): key
        for section_name, section in scene.sections().items()
        for name, key in section.schema().items()
    }
    for kind, scene in SCENES.items()
}


def values(key):
    if key.kind is bool:
        return st.booleans()
    if key.kind is str:
        paths = ("none", "/tmp/my points.csv", "/true", "/ö #'\"\\: x")
        return st.sampled_from(key.words or paths)
    steps = int((key.high - key.low) / key.step) if key.step else 0
    if steps:
        return st.integers(0, steps).map(lambda k: key.kind(key.low + k * key.step))
    if key.kind is int:
        return st.integers(int(key.low), int(key.high))
    # Taichi lets its thread read subnormal numbers as zero.
    numbers = st.floats(key.low, key.high, allow_subnormal=False)
    return st.sampled_from(key.words) | numbers if key.words else numbers


@st.composite
def scenes(draw):
    kind = draw(st.sampled_from(sorted(SCENES)))
    data = {"scene": kind}
    for section, name in draw(st.lists(st.sampled_from(list(KEYS[kind])), max_size=4)):
        data.setdefault(section, {})[name] = draw(values(KEYS[kind][section, name]))
    try:
        return load_scene(data)
    except InputError:  # values that contradict each other
        reject()


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("scenes") / "scene.yaml"


@settings(max_examples=10, deadline=None)
@given(scene=scenes())
def test_a_written_scene_reads_back_equal(path, scene):
    text = scene.to_yaml()
    path.write_text(text, encoding="utf-8")
    assert load_scene(path) == load_scene(text) == load_scene(asdict(scene)) == scene
    assert load_scene(path).to_yaml() == text
    # Plain PyYAML, too, for which 1e-05 is a string (YAML 1.1), reads the same values.
    assert load_scene(yaml.safe_load(text)) == scene


ODD = [None, [], [0], {}, "", "a\nb", "\ud800", float("nan"), float("inf"), 10**400]


@pytest.mark.parametrize("kind", KEYS)
def test_every_key_takes_what_is_within_its_bounds_and_nothing_else(kind):
    for (section, name), key in KEYS[kind].items():
        accepted = [*key.words, True, False]
        refused = [*ODD, "1", "nonsense"]
        if key.kind in (int, float):
            accepted = [*key.words, key.low, key.high]
            refused += [True, key.low - 1e-9, key.high * 1.01 + 1e-9]
            if key.step or key.kind is int:
                refused.append(key.low + (key.step or 1) / 2)
        elif key.words:
            accepted = key.words
        elif key.kind is str:  # a file
            accepted = ["none", "/a b.csv"]
            refused = [one for one in ODD if not isinstance(one, float)]
        assert all(map(key.accepts, accepted))
        assert not any(map(key.accepts, refused))
        assert len(key.meaning) > 10
        for value in refused[:2] + refused[-1:]:
            with pytest.raises(InputError) as refusal:
                load_scene({"scene": kind, section: {name: value}})
            assert f"{section}.{name}: must be ".encode() in str(refusal.value).encode()


def test_a_scene_cannot_be_changed_and_an_int_becomes_a_float():
    scene = load_scene({"scene": "exponential_wall", "material": {"eta_star": 3}})
    assert isinstance(scene.material.eta_star, float)
    with pytest.raises(FrozenInstanceError):
        scene.lattice = scene.lattice
    assert hash(SCENES["compression"]()) == hash(SCENES["compression"]())


# Potential V0 exp(-a y) against v^2/2 with the default a = 300, V0 = 150, v = 0.02:
# 1e-3 of it at y = ln(150/(1e-3 * 2e-4))/300 = 0.06812;
# 1e-5 of it with v = 1e-3 at ln(150/5e-12)/300 = 0.10344.
RIGID = "exponential_wall"
WALL = "absorbing_wall"
ORDER_4 = "time.integrator=takahashi_imada"
CONFLICTS = {
    f"{RIGID} impact.gap=0.068": "impact.gap: .* write at least 0.06819 R",
    f"{WALL} impact.gap=0.06": "impact.gap",
    f"{WALL} impact.velocity=1e-3": "wall.threshold: .* write 0.1035 R or more",
    f"{WALL} wall.threshold=0.08": "wall.threshold",
    f"{WALL} time.dt=0.01": "0.01 is longer than wall.reset_int",
    f"{WALL} impact.angle=1.4 wall.width=0.4": "wall.width: .* R or more",
    f"{WALL} impact.offset=1.9": "write 4.20.* R or more",
    f"{WALL} video.magnify=8": "drawn apart",
    "compression time.dt=0.01 time.tolerance=1e-6": "write time.dt: auto",
    "compression compression.method=newton time.tolerance=1e-6": "takes no time step",
    f"{RIGID} {ORDER_4}": "eta_star = 10",
    f"{RIGID} {ORDER_4} material.viscosity=0.01": "y = 0.01",
    f"{RIGID} material.dashpot=axial time.integrator=trapezoidal": (
        r"time\.integrator: trapezoidal .* axial"
    ),
    f"{RIGID} material.viscosity=0.01 material.eta_star=3": "both set",
    f"{WALL} material.viscosity=0.0 material.eta_star=10": "add eta_star=0",
    f"{WALL} {ORDER_4} wall.boundary=dashpot": "= dashpot",
    f"{WALL} {ORDER_4}": "2 with",
}
AGREEING = (
    f"{RIGID} impact.gap=0.0682",
    f"{WALL} impact.gap=0.0682",
    f"{WALL} impact.velocity=3e-3",
    f"{WALL} impact.velocity=1e-3 wall.threshold=0.1035",
    f"{WALL} time.dt=0.01 wall.boundary=pinned",
    f"{WALL} impact.angle=1.4 wall.width=0.6",
    f"{WALL} impact.offset=1.9 wall.width=4.21",
    f"{WALL} video.magnify=1",
    "compression time.tolerance=1e-6",
    "compression compression.method=newton",
    f"{RIGID} {ORDER_4} material.eta_star=0",
    f"{RIGID} material.viscosity=0.01 material.eta_star=10",
    f"{WALL} material.viscosity=0.01 material.eta_star=0",
    f"{WALL} {ORDER_4} wall.boundary=pinned",
    f"{WALL} time.integrator=velocity_verlet",
)


@pytest.mark.parametrize("settings", CONFLICTS)
def test_keys_that_contradict_each_other_are_refused(settings):
    kind, *overrides = words(settings)
    with pytest.raises(InputError, match=CONFLICTS[settings]):
        load_scene(kind, overrides)


@pytest.mark.parametrize("settings", AGREEING)
def test_keys_that_agree_are_accepted(settings):
    kind, *overrides = words(settings)
    load_scene(kind, overrides)


def test_with_changes_keys_and_nothing_else(tmp_path):
    scene = load_scene(RIGID, ["lattice.seed=4"])
    path = tmp_path / "1e3"
    # as tables of pandas have numbers
    numbers = {"wall.a": 3000, "gap": np.float64(0.5), "points": np.float64(50)}
    changed = scene.with_({**numbers, "file": path}, eta_star=30, velocity=0.03)
    expected = f"""
        wall.a=3000 impact.gap=0.5 lattice.points=50 lattice.file={path}
        material.eta_star=30 impact.velocity=0.03 lattice.seed=4
    """
    assert changed == load_scene(RIGID, words(expected))
    assert type(changed.impact.gap) is float
    assert type(changed.lattice.points) is int
    assert scene.material.eta_star == 10
    assert scene.with_() == scene
    assert scene.with_(lattice={"points": 50}) == scene.with_(points=50)
    for first, second in (
        ({"wall.a": 1}, {"a": 2}),
        ({"wall": {"a": 1}}, {"wall.a": 1}),
        ({"a": 1}, {"a": 1}),
    ):
        names = [next(iter(each)) for each in (first, second)]
        text = rf"^{names[0]} and {names[1]} both set wall\.a: leave"
        with pytest.raises(InputError, match=text):
            scene.with_(first, **second)
    compression = load_scene("compression")
    with pytest.raises(InputError) as refusal:
        changes = {"wall.b": 3, "pints": 4, "rug": {}}
        compression.with_(changes, eta_star=-1, lattice=3)
    assert str(refusal.value).split("\n  ")[1:] == [
        "lattice: must be a section, that is indented lines of key: value, not 3",
        "material.eta_star: must be a number from 0 to 1e6, not -1 (viscosity eta R/(m"
        " c) per point, as in the paper; 0: no dashpots)",
        "pints: unknown key; did you mean lattice.points?",
        "rug: unknown key; scene: compression has scene, lattice, material, wall,"
        " compression, time, video",
        "wall.b: unknown key; wall has a, V0",
    ]
    text = r"^tolerance: write compression\.tolerance or time\.tolerance$"
    with pytest.raises(InputError, match=text):
        compression.with_(tolerance=1)


def test_the_name_of_a_lattice_file_starts_from_the_scene_file(tmp_path, monkeypatch):
    there = tmp_path / "there"
    there.mkdir()
    lattice = "scene: compression\nlattice: {file: ../a.csv, velocities: v.npz}\n"
    (there / "s.yaml").write_text(lattice)
    sweep = "scene: compression\nsweep: {file: [a.npz, none, /b.npz]}\n"
    (there / "sweep.yaml").write_text(sweep)
    (tmp_path / "deep").mkdir()  # .. after a link goes up from the target of the link
    (tmp_path / "deep" / "link").symlink_to("../there", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    scene = load_scene("there/s.yaml")
    assert scene.lattice.file == str(tmp_path / "a.csv")
    assert scene.lattice.velocities == str(there / "v.npz")
    for override in ("b.csv", "deep/link/../b.csv"):
        scene = load_scene("there/s.yaml", [f"lattice.file={override}"])
        assert scene.lattice.file == str(tmp_path / "b.csv")
    scene = load_scene("scene: compression\nlattice: {file: a.csv}\n")
    assert scene.lattice.file == str(tmp_path / "a.csv")
    for overrides, files in (
        ([], (str(there / "a.npz"), "none", "/b.npz")),
        (["sweep.file=[b.csv]"], (str(tmp_path / "b.csv"),)),
    ):
        (block,) = load_sweep("there/sweep.yaml", overrides).blocks
        assert block["file"] == files


def test_the_shipped_scenes_are_the_defaults_written_out():
    shipped = shipped_scenes()
    others = {"bouncing_disk", "oblique_impact", "ringing_disk"}
    others |= {"figure2", "figure3", "figure6"}
    assert set(shipped) == {*SCENES, *others}
    for kind, scene in SCENES.items():
        top = ROOT / "scenes" / f"{kind}.yaml"
        assert shipped[kind].read_bytes() == top.read_bytes()
        assert load_scene(kind) == load_scene(shipped[kind]) == scene()
        written = yaml.safe_load(shipped[kind].read_text(encoding="utf-8"))
        del written["scene"]
        keys = {name: set(section) for name, section in written.items()}
        every = {name: set(one.schema()) for name, one in scene.sections().items()}
        assert keys == every
    sizes = {"figure2": 225, "figure3": 576, "figure6": 288}
    for name, size in sizes.items():
        assert len(load_sweep(name).scenes) == size


SPACES = "d\u00a0i\u202fs\u3000k\u200d\u2028"


@pytest.mark.parametrize("name", [SPACES, "\U000e0041é", "caf\udce9"], ids=ascii)
def test_a_file_name_may_have_any_character_but_control_characters(tmp_path, name):
    folder = tmp_path / name
    try:
        folder.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("the file system does not take this name")
    text = "scene: exponential_wall\nlattice: {file: disk.csv}\n"
    (folder / "scene.yaml").write_text(text)
    scene = load_scene(folder / "scene.yaml")
    assert scene.lattice.file == str(folder / "disk.csv")
    changed = scene.with_(velocity=0.03)
    assert changed.lattice == scene.lattice
    printed = changed.to_yaml()
    assert all(one.isprintable() for one in printed if one not in "\n\U000e0041")
    assert load_scene(printed) == changed
    if name == SPACES:
        override = f"lattice.file={folder / name[:-1]}.csv"
        found = load_scene("exponential_wall", [override])
        assert found.lattice.file == f"{folder / name[:-1]}.csv"
    with pytest.raises(InputError, match="must be none or the name of a file"):
        load_scene({"scene": "exponential_wall", "lattice": {"file": "a\x85.csv"}})


def test_the_minus_sign_of_typography_is_a_minus_sign():
    text = "scene: exponential_wall\nimpact: {angle: \u22120.3, velocity: 2e\u22122}\n"
    scene = load_scene(text)
    assert (scene.impact.angle, scene.impact.velocity) == (-0.3, 0.02)
    assert scene == load_scene(text.replace("\u2212", "-"))
    turned = load_scene(text, ["impact.spin=\u22121"])
    assert turned.impact.spin == -1.0


BOUNDS = """
-100 100 impact.offset
-10 10 impact.spin
-3.1416 3.1416 impact.turn
-1.5 1.5 impact.angle
0 0.75 lattice.min_spacing
0 0.95 lattice.core_radius lattice.hole
0 0.1 impact.gravity
0 2 video.flight
0 10 wall.friction
0 100 impact.drop
0 1e6 material.eta_star material.k_b material.viscosity
0 4294967295 lattice.seed
1e-12 1e12 wall.V0
1e-10 0.01 time.tolerance
1e-9 0.01 compression.tolerance
1e-9 10 compression.pressure
1e-9 1e3 impact.gap time.dt
1e-9 1e6 material.k_a time.sample_interval wall.k_a
1e-6 1 time.safety
1e-6 10 impact.velocity
1e-6 1e3 wall.reset_interval
1e-6 1e6 compression.max_time impact.max_time
1e-3 1e3 lattice.core_density lattice.core_stiffness wall.threshold
0.1 100 wall.width
0.1 600 video.seconds
0.1 1e6 wall.a
0.5 3 video.text
1 2 video.supersample
1 100 impact.bounces
1 120 video.fps
1 1000 video.magnify
0.01 1 video.goal
3 2e6 lattice.points
4 2e6 wall.points
64 2160 video.size
"""


def test_the_bounds_of_all_numbers():
    known = {}
    for low, high, *names in map(str.split, BOUNDS.strip().splitlines()):
        known |= dict.fromkeys(names, (float(low), float(high)))
    for keys in KEYS.values():
        numbers = [one for one, key in keys.items() if key.kind in (int, float)]
        found = {".".join(one): (keys[one].low, keys[one].high) for one in numbers}
        assert found == {name: known[name] for name in found}
