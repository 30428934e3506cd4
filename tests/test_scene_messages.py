"""What a user reads when a scene cannot be used: place, key, range, nearest name; every fault at once."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from taichi_disk.errors import InputError
from taichi_disk.scene import SCENES
from taichi_disk.scene_file import MAX_BYTES, load_scene


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenes") / "scene.yaml"


def faults(path: Path, text: str | bytes, *overrides: str) -> list[str]:
    """The faults of a scene file, one string each, without the file's name."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as refusal:
        load_scene(path, overrides)
    first, *rest = str(refusal.value).split("\n")
    if rest:
        assert first == f"{len(rest)} faults in the scene:"
    return [line.strip().removeprefix(f"{path}:").strip() for line in rest or [first]]


IMPACT = "scene: exponential_wall\n"


def points(value: str) -> str:
    allowed = "a whole number from 3 to 2000000"
    return f"lattice.points: must be {allowed}, not {value} (number of mass points N of the disk)"


def k_a(value: str) -> str:
    allowed = "a number from 1e-9 to 1e6 [M c^2/R^2]"
    return f"material.k_a: must be {allowed}, not {value} (linear spring constant)"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "lattice:\n  pionts: 9\n",
            "3:3: lattice.pionts: unknown key; did you mean points?",
        ),
        (
            "materiel: {k_a: 1}\n",
            "2:1: materiel: unknown key; did you mean material?",
        ),
        (
            "VIDEO: {}\n",
            "2:1: VIDEO: unknown key; did you mean video?",
        ),
        (
            "wall:\n  v0: 3\n",
            "3:3: wall.v0: unknown key; did you mean V0?",
        ),
        (
            "velocity: 0.1\n",
            "2:1: velocity: unknown key; did you mean impact.velocity?",
        ),
        (
            "impact: {eta_star: 3}\n",
            "2:10: impact.eta_star: unknown key; did you mean material.eta_star?",
        ),
        (
            "impact: {zzz: 3}\n",
            "2:10: impact.zzz: unknown key; in impact there are velocity, gap, max_time",
        ),
        (
            "zzz: 3\n",
            "2:1: zzz: unknown key; in scene: exponential_wall there are "
            "scene, lattice, material, wall, impact, time, video",
        ),
        (
            "lattice: {points: -5}\n",
            "2:19: " + points("-5"),
        ),
        (
            "lattice: {points: 1000000000}\n",
            "2:19: " + points("1000000000"),
        ),
        (
            "lattice: {points: 1e3}\n",
            "2:19: " + points("1e3"),
        ),
        (
            "lattice: {points: true}\n",
            "2:19: " + points("true"),
        ),
        (
            "lattice: {rim: yes}\n",
            "2:16: lattice.rim: must be true or false, not yes "
            "(evenly spaced points on the circle; false: the literal random disk)",
        ),
        (
            "material:\n  k_a: -1\n",
            "3:8: " + k_a("-1"),
        ),
        (
            "material:\n  k_a: .nan\n",
            "3:8: " + k_a(".nan"),
        ),
        (
            "material:\n  k_a: -.INF\n",
            "3:8: " + k_a("-.INF"),
        ),
        (
            'material:\n  k_a: "1"\n',
            "3:8: " + k_a('the text "1"; leave out the quotes'),
        ),
        (
            "material:\n  k_a:\n",
            "3:7: " + k_a("nothing"),
        ),
        (
            "material:\n  k_a: [1, 2]\n",
            "3:8: " + k_a("a list"),
        ),
        (
            "time: {safety: 0}\n",
            "2:16: time.safety: must be a number above 0 and at most 1, not 0 (fraction of the largest stable step)",
        ),
        (
            "time: {dt: 0}\n",
            "2:12: time.dt: must be auto or a number from 1e-9 to 1000 [R/c], not 0 "
            "(time step; auto: safety times the largest stable one)",
        ),
        (
            "time: {integrator: trapezodal}\n",
            "2:20: time.integrator: must be auto, velocity_verlet, trapezoidal or vefrl, not trapezodal; "
            "did you mean trapezoidal? "
            "(trapezoidal takes dashpots implicitly; vefrl: order 4, no dashpots; auto: what reaches the end first)",
        ),
        (
            "video: {size: 721}\n",
            "2:15: video.size: must be an even whole number from 64 to 2160 [px], not 721 (width and height, even)",
        ),
        (
            "wall: {points: 4}\n",
            "2:8: wall.points: belongs to scene: absorbing_wall, and this is scene: exponential_wall",
        ),
        (
            "compression: {pressure: 1}\n",
            "2:1: compression: belongs to scene: compression, and this is scene: exponential_wall",
        ),
        (
            "impact:\n",
            "2:8: impact: an empty section: give it a key, or leave it out",
        ),
        (
            "impact: 3\n",
            "2:9: impact: must be a section, that is indented lines of key: value, not 3",
        ),
        (
            "impact: [velocity]\n",
            "2:9: impact: must be a section, that is indented lines of key: value, not a list",
        ),
        (
            "video: {fps: 30, size: 100, fps: 40}\n",
            "2:29: video.fps: given twice, first in line 2",
        ),
        (
            "video: {? [a] : 3}\n",
            "2:11: video: a key must be a name, not a list",
        ),
        (
            "video: {fps: !!python/object/apply:os.abort []}\n",
            "2:14: video.fps: the YAML tag !!python/object/apply:os.abort is not allowed",
        ),
        (
            "video: {fps: !!int x}\n",
            "2:14: video.fps: x cannot be read as int",
        ),
        (
            f"video: {{fps: {'9' * 5000}}}\n",
            f"2:14: video.fps: {'9' * 37}... cannot be read as int",
        ),
        (
            "video: &v {fps: *v}\n",
            "2:12: video.fps: an alias that contains itself",
        ),
        (
            "video: {<<: {fps: 3}}\n",
            "2:9: video.<<: merge keys are not supported: write the keys out",
        ),
        (
            "impact: {gap: 0.06}\n",
            "2:15: impact.gap: at 0.06 R the wall's potential exceeds 1e-3 of the kinetic energy: "
            "start at 0.06819 R or farther, or write auto",
        ),
    ],
)
def test_a_single_fault_is_one_line_with_its_place(path: Path, text: str, expected: str) -> None:
    assert faults(path, IMPACT + text) == [expected]


def test_all_faults_come_at_once_in_the_order_of_the_file(path: Path) -> None:
    text = """\
scene: absorbing_wall
lattice:
  points: ten
  seeed: 3
wall:
  boundary: rest
  a: 300
  a: 301
impact: {velocity: 0, pressure: 1}
"""
    assert faults(path, text, "video.fps=0", "time.dt") == [
        "3:11: " + points("ten"),
        "4:3: lattice.seeed: unknown key; did you mean seed?",
        "6:13: wall.boundary: must be reset, pinned or dashpot, not rest; did you mean reset? "
        "(sides and bottom: velocities zeroed at intervals, held fast, or matched (absorbing) dashpots)",
        "8:3: wall.a: given twice, first in line 7",
        "9:20: impact.velocity: must be a number from 1e-6 to 10 [c], not 0 (speed towards the wall at the start)",
        "9:23: impact.pressure: unknown key; in impact there are velocity, gap, max_time",
        "--set video.fps=0: video.fps: must be a whole number from 1 to 120 [1/s], not 0 (frames per second)",
        "--set time.dt: must be of the form section.key=value",
    ]


def test_a_conflict_with_a_default_names_the_file(path: Path) -> None:
    # wall.threshold is nowhere written: there is no line to point at.
    text = "scene: absorbing_wall\nimpact: {velocity: 1e-3}\n"
    (fault,) = faults(path, text)
    assert fault.startswith("wall.threshold: at 0.1 R the contact potential exceeds 1e-5 of the kinetic energy")


KINDS = "compression, exponential_wall or absorbing_wall"
LINES = "a scene is a list of lines `key: value` (mind the space after the colon)"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("lattice: {points: 9}\n", [f"scene: missing: write scene: {KINDS}"]),
        (
            "scene: exponental_wall\n",
            [f"1:8: scene: must be {KINDS}, not exponental_wall; did you mean exponential_wall?"],
        ),
        ("scene: 3\n", [f"1:8: scene: must be {KINDS}, not 3"]),
        ("scene:\n", [f"1:7: scene: must be {KINDS}, not nothing"]),
        ("scene: {a: 1}\n", [f"1:8: scene: must be {KINDS}, not a mapping"]),
        # The rest is judged as the scene that was meant, or as the one that it fits best.
        (
            "scene: absorbing\nwall: {points: 1}\n",
            [
                f"1:8: scene: must be {KINDS}, not absorbing; did you mean absorbing_wall?",
                "2:16: wall.points: must be a whole number from 4 to 2000000, not 1 "
                "(number of mass points of the wall)",
            ],
        ),
        (
            "compression: {pressure: -1}\n",
            [
                f"scene: missing: write scene: {KINDS}",
                "1:25: compression.pressure: must be a number from 1e-9 to 10 [M c^2/R], not -1 (compressing force P)",
            ],
        ),
    ],
)
def test_without_a_valid_kind_of_scene_the_rest_is_checked_too(path: Path, text: str, expected: list[str]) -> None:
    assert faults(path, text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (b"", "holds no keys: a scene needs at least the line `scene: exponential_wall`"),
        (b"# nothing\n---\n", "holds no keys"),
        (
            b"- a\n- b\n",
            "1:1: a scene is a list of lines `key: value` (mind the space after the colon), not a list",
        ),
        (
            b"points:1099\n",
            "1:1: a scene is a list of lines `key: value` (mind the space after the colon), not points:1099",
        ),
        (b"\x89PNG\r\n\x1a\n\0\0", "a binary file, or text that is not UTF-8; a scene is YAML text in UTF-8"),
        ("scene: compression\n".encode("utf-16"), "a binary file, or text that is not UTF-8"),
        (b"scene: compression\n# \xfcber\n", "2: not UTF-8 text (byte 0xfc); save it as UTF-8"),
        (b"scene: compression\nwall:\x07 3\n", "2:6: the character 0x7 may not stand in a YAML file"),
        (
            b"lattice:\n\tpoints: 3\n",
            "2:1: not readable as YAML: found character '\\t' that cannot start any token "
            "(YAML allows no tabs for indentation: use spaces)",
        ),
        (b"lattice: {points: 3\n", "2:1: not readable as YAML: expected ',' or '}', but got '<stream end>'"),
        (b"lattice:\n  a: b: c\n", "2:7: not readable as YAML: mapping values are not allowed here"),
        (b"wall: {a: *x}\n", "1:11: not readable as YAML: found undefined alias 'x'"),
        (
            b"scene: compression\n---\nscene: compression\n",
            "2:1: not readable as YAML: but found another",
        ),
        (b'scene: "\\UFFFFFFFF"\n', "1:"),
        (b"a: " + b"[" * 5000, "nested too deeply"),
        (b"#" * (MAX_BYTES + 1), f"larger than {MAX_BYTES} bytes, which no scene is"),
    ],
)
def test_what_is_no_scene_at_all_is_one_clear_line(path: Path, text: bytes, expected: str) -> None:
    (fault,) = faults(path, text)
    assert fault.startswith(expected)


def test_aliases_of_aliases_are_refused_before_they_fill_the_memory(path: Path) -> None:
    # 12 levels of 9 aliases each stand for 9^12 = 3e11 values.
    bomb = ["a0: &a0 [x]"] + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 13)]
    assert any("more than 10000 values" in fault for fault in faults(path, "\n".join(bomb)))


def test_harmless_aliases_are_fine(path: Path) -> None:
    path.write_text("scene: compression\nwall: {a: &x 250}\nvideo: {size: *x}\n")
    scene = load_scene(path)
    assert (scene.wall.a, scene.video.size) == (250.0, 250)


@pytest.mark.parametrize(
    ("text", "value"),
    # YAML 1.2's core schema; PyYAML by itself reads 1e-3 as a string and 010 as eight.
    [
        ("1e-3", 1e-3),
        ("1E3", 1e3),
        ("2.e1", 20.0),
        (".5", 0.5),
        ("+1.5", 1.5),
        ("010", 10.0),
        ("0x10", 16.0),
        ("3", 3.0),
    ],
)
def test_numbers_are_read_as_yaml_1_2_has_them(path: Path, text: str, value: float) -> None:
    path.write_text(f"scene: compression\nmaterial: {{k_a: {text}}}\n")
    assert load_scene(path).material.k_a == value
    assert load_scene("compression", [f"material.k_a={text}"]).material.k_a == value


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm(path: Path) -> None:
    path.write_bytes(b"\xef\xbb\xbfscene: compression\r\nlattice:\r\n  points: 50\r\n")
    assert load_scene(path).lattice.points == 50


def test_the_last_override_of_a_key_wins(path: Path) -> None:
    path.write_text("scene: exponential_wall\nlattice: {points: -1, seed: 5}\n")
    scene = load_scene(path, ["lattice.points=20", "lattice.points=30", "impact.velocity = 1e-2", "time.dt=auto"])
    assert (scene.lattice.points, scene.lattice.seed) == (30, 5)
    assert load_scene(path, ["scene=compression", "lattice.points=3"]) == SCENES["compression"].model_validate(
        {"lattice": {"points": 3, "seed": 5}}
    )


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("abc", "must be of the form section.key=value"),
        ("=3", "must be of the form section.key=value"),
        ("lattice.=3", "must be of the form section.key=value"),
        ("lattice.points=", "lattice.points: must be a whole number from 3 to 2000000, not nothing"),
        ("lattice.points=x", "lattice.points: must be a whole number from 3 to 2000000, not x"),
        ("lattice.point=3", "lattice.point: unknown key; did you mean points?"),
        ("latice.points=3", "latice: unknown key; did you mean lattice?"),
        ("velocity=3", "velocity: unknown key; did you mean impact.velocity?"),
        ("tolerance=1e-6", "tolerance: unknown key; did you mean time.tolerance?"),
        ("prcision=f32", "prcision: unknown key; did you mean time.precision?"),
        ("lattice=3", "a section cannot be set as a whole: set its keys one by one"),
        ("lattice={points: 3}", "a section cannot be set as a whole: set its keys one by one"),
        ("video=3", "video: must be a section, that is indented lines of key: value, not 3"),
        ("lattice.points.x=3", "lattice.points is not a section"),
        ("scene.x=3", "scene is not a section"),
        ("scene=compresion", f"scene: must be {KINDS}, not compresion; did you mean compression?"),
        ("time.dt=[1,", "time.dt: not readable as YAML: expected the node content, but found '<stream end>'"),
        ("time.dt=!!python/name:os.abort x", "time.dt: the YAML tag !!python/name:os.abort is not allowed"),
    ],
)
def test_a_faulty_override_is_quoted(path: Path, override: str, expected: str) -> None:
    (fault,) = faults(path, IMPACT + "lattice: {points: 9}\n", override)
    assert fault.startswith(f"--set {override}: {expected}")


def test_a_missing_file_is_met_with_the_nearest_names(tmp_path: Path) -> None:
    (tmp_path / "soft_disk.yaml").touch()
    with pytest.raises(InputError, match=r"soft_dsk.yaml: no such file; did you mean .*/soft_disk.yaml\?"):
        load_scene(tmp_path / "soft_dsk.yaml")
    shipped = "The shipped scenes are absorbing_wall, compression, exponential_wall, figure2, figure3, figure6"
    with pytest.raises(InputError, match=rf"no such file; did you mean exponential_wall\? {shipped}$"):
        load_scene(tmp_path / "scenes" / "exponential_wall.yaml")
    with pytest.raises(InputError, match=rf"^nonsense: no such file\. {shipped}$"):
        load_scene("nonsense")


def test_a_path_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    with pytest.raises(InputError, match=r": a folder, not a scene file; it holds .*a.yaml$"):
        load_scene(tmp_path)
    for source in ("a\0b", "a" * 5000, str(tmp_path / "a.yaml" / "b.yaml"), ""):
        with pytest.raises(InputError):
            load_scene(source)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_a_file_without_permission_is_refused(path: Path) -> None:
    path.write_text(IMPACT)
    path.chmod(0)
    with pytest.raises(InputError, match="Permission denied"):
        load_scene(path)


def test_a_file_in_the_way_has_precedence_over_a_shipped_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "compression").mkdir()  # as left by a run
    assert load_scene("compression") == SCENES["compression"]()
    (tmp_path / "exponential_wall").write_text("scene: exponential_wall\nlattice: {points: 7}\n")
    assert load_scene("exponential_wall").lattice.points == 7


# Whatever a file holds, load_scene returns a scene or raises InputError.

WORDS = """\
scene lattice material wall impact compression time video points seed rim k_a dt velocity gap pressure auto
reset exponential_wall absorbing_wall : - , { } [ ] & * &a *a ! !!int !!float !!python/none | > ' " # --- ...
% %YAML ? << ~ null true 0 -1 1e-3 1e999 .nan .inf 0x 0o7 1_0 \\ é"""
SPACES = [": ", "\n", "\n  ", "\n\t", "\x85", "\u2028", "\ufeff"]
SOUP = st.lists(st.sampled_from([*WORDS.split(), *SPACES]), max_size=40)


@settings(max_examples=150, deadline=None)
@given(text=SOUP.map(" ".join) | SOUP.map("".join) | st.text())
@example(text="scene: \ud800")
@example(text="%YAML 1.1\n---\nscene: compression")
@example(text=f"%YAML {'1' * 5000}.1\n---\nscene: compression")
def test_any_text_gives_a_scene_or_an_input_error(path: Path, text: str) -> None:
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        load_scene(path, [text[:20], f"time.dt={text}"] if text else [])
    except InputError as error:
        assert str(error)


@settings(max_examples=100, deadline=None)
@given(data=st.binary(max_size=200))
def test_any_bytes_give_a_scene_or_an_input_error(path: Path, data: bytes) -> None:
    path.write_bytes(IMPACT.encode() + data)
    try:
        load_scene(path)
    except InputError as error:
        assert str(error)


@pytest.mark.parametrize(
    ("settings", "damping"),
    [
        (["exponential_wall", "material.eta_star=3"], "material.eta_star = 3"),
        (["absorbing_wall", "wall.boundary=dashpot"], "wall.boundary = dashpot"),
    ],
)
def test_order_four_is_refused_where_forces_depend_on_velocity(settings, damping):
    with pytest.raises(InputError, match=r"time\.integrator: vefrl cannot") as caught:
        load_scene(settings[0], [*settings[1:], "time.integrator=vefrl"])
    assert damping in str(caught.value)
