"""Messages about a faulty scene: place, key, range, nearest name, all at once."""

import difflib

import pytest
from hypothesis import example, given, settings, strategies as st

from taichi_disk.base.errors import InputError, printable
from taichi_disk.experiments.config import tree
from taichi_disk.experiments.scenes import SCENES, load_any, load_scene

IMPACT = "scene: exponential_wall\n"
KINDS = "compression, exponential_wall or absorbing_wall"


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("scenes") / "scene.yaml"


def faults(path, text, *overrides):
    """Return the faults of a scene file, one string each, without the file's name."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as refusal:
        load_scene(path, overrides)
    first, *rest = str(refusal.value).split("\n")
    if rest:
        assert first == f"{len(rest)} faults in the scene:"
    return [line.strip().removeprefix(f"{path}:").strip() for line in rest or [first]]


@pytest.mark.parametrize(
    ("value", "hint"),
    [
        (r'"C:\new.csv"', "a backslash in double quotes begins a special character"),
        (r'"C:\Users.csv"', "a backslash in double quotes begins a special character"),
        ("None", "must be none or the name of a file, not None ("),
    ],
)
@pytest.mark.parametrize("key", ["file", "velocities"])
def test_a_path_that_yaml_reads_differently_is_refused_with_the_reason(
    path, key, value, hint
):
    (fault,) = faults(path, f"{IMPACT}lattice: {{{key}: {value}}}")
    assert hint in fault


FAULTS = """
velocity: 1 | 2:1: velocity: unknown key; did you mean impact.velocity?
impact.velocity: 1 | 2:1: impact.velocity: no dotted key here: write impact: {v
wall: {v0: 3} | 2:8: wall.v0: unknown key; did you mean V0?
impact: {eta_star: 3} | 2:10: impact.eta_star: unknown key; did you mean
impact: {slant: 3} | 2:10: impact.slant: unknown key; impact has velocity, angle,
impact: {offset: 1} | 2:10: impact.offset: belongs to scene: absorbing_wall, not to
impact: {angle: 90} | 2:17: impact.angle: must be a number from -1.5 to 1.5 [rad],
wall: {a: [1, 2]} | 2:11: wall.a: must be a number from 0.1 to 1e6 [1/R], not a list;
lattice: {points: ten} | 2:19: lattice.points: must be a whole number from 3 to
lattice: {rim: no} | 2:16: lattice.rim: must be true or false, not no (evenly
lattice: {file: 3} | 2:17: lattice.file: must be none or the name of a file, not 3
time: {dt: 0} | 2:12: time.dt: must be auto or a number from 1e-9 to 1000 [R/c], not 0
video: {theme: dork} | 2:16: video.theme: must be light or dark, not dork; did you mean
impact: | 2:8: impact: an empty section: give it a key, or leave it out
impact: [velocity] | 2:9: impact: must be a section, that is indented lines of key:
video: {? [a] : 3} | 2:11: video: a key must be a name, not a list
"\\ud800": 3 | 2:1: a key must be a name, not the text "\\ud800"
video: {fps: !!python/object/apply:os.abort []} | 2:14: video.fps: an empty list
time: {integrator: trapezoidal}|wall: {friction: 0.1} | 2:20: time.integrator:
lattice: {hole: 0.94} | 2:17: lattice.hole: must be 0 or from 0.0216 to 0.932 with
lattice: {core_density: 2} | 2:25: lattice.core_density: there is no core: write
impact: {gap: 0.06} | 2:15: impact.gap: at 0.06 R the wall potential exceeds 1e-3 of
--set abc | must be KEY=VALUE without spaces around =, for example
--set lattice.\ud800=3 | must be KEY=VALUE
--set lattice.points= | lattice.points: must be a whole number from 3 to 2000000, not
--set lattice.points=\udcff | lattice.points: the character 0xdcff is not allowed
--set velocity=3 | velocity: unknown key; did you mean impact.velocity?
--set lattice.points.x=3 | lattice.points.x: unknown key; did you mean points?
--set scene.x=3 | scene is not a section
--set time.dt=[1, | time.dt: not readable as YAML: expected the node content, but
--set material.eta=3 | material.eta: unknown key; did you mean material.eta_star?
--set material.η*=3 | material.η*: unknown key; did you mean material.eta_star?
--set impact.speed=0.03 | impact.speed: unknown key; did you mean impact.velocity?
--set impact.v=0.03 | impact.v: unknown key; did you mean impact.velocity?
--set mu=0.3 | mu: unknown key; did you mean wall.friction?
--set lattice.N=300 | lattice.N: unknown key; did you mean lattice.points?
--set restitution=0.9 | restitution: no key: the restitution e is a result; a larger
--set lattice.radius=2 | lattice.radius: no key: the disk's radius R is the unit of
"""


@pytest.mark.parametrize("row", FAULTS.strip().split("\n"), ids=ascii)
def test_a_single_fault_is_one_line_with_its_place(path, row):
    text, beginning = row.split(" | ")
    if text.startswith("--set "):
        (fault,) = faults(path, IMPACT, text.removeprefix("--set "))
        beginning = f"{printable(text, width=1000)}: {beginning}"
    else:
        text = text.replace("|", "\n")
        (fault,) = faults(path, f"{IMPACT}{text}\n")
    assert fault.startswith(beginning)


FAULTY = """scene: compression
video:
  theme:
  size: .nan
  fpsx: {}
lattice:
  points: 60
  seed: 3
  seed: 3
  file: {}
"""
SAID = """3:9: video.theme: must be light or dark, not nothing
4:9: video.size: must be auto or an even whole number from 64 to 2160 [px], not .nan
5:3: video.fpsx: unknown key; did you mean fps?
9:3: lattice.seed: is given twice, first in line 8
10:9: lattice.file: must be none or the name of a file, not an empty mapping
--set wall.a=[1]: wall.a: must be a number from 0.1 to 1e6 [1/R], not a list
--set time.dt=: time.dt: must be auto or a number from 1e-9 to 1000 [R/c], not nothing
"""


def test_all_faults_are_listed_together_in_the_order_of_the_file(path):
    found = faults(path, FAULTY, "wall.a=[1]", "time.dt=")
    for line, beginning in zip(found, SAID.splitlines(), strict=True):
        assert line.startswith(beginning)


OUT_OF_RANGE = (
    "not readable as YAML: nested too deeply, or a number or an escape is out of range"
)
MISSING = f"scene: missing: write scene: {KINDS}"


def test_the_rest_is_checked_too_for_the_kind_of_scene_that_was_probably_meant(path):
    kind = f"1:8: scene: must be {KINDS}, not absorbing; did you mean absorbing_wall?"
    pints = "2:8: wall.pints: unknown key; did you mean points?"
    assert faults(path, "scene: absorbing\nwall: {pints: 1}\n") == [kind, pints]
    assert faults(path, "wall: {points: 1}\n") == [MISSING]


NO_SCENES = {
    b"": "holds no keys: a scene needs at least the line `scene: exponential_wall`",
    b"- a\n- b\n": "1:1: a scene consists of lines `key: value` (with a space after",
    b"\x89PNG\r\n\x1a\n\0\0": "1: not UTF-8 text (byte 0x89): save it as UTF-8",
    b"scene: x\n# \0": "2:3: the character 0x0 is not allowed in YAML: remove it",
    b"\n\n\xfc": "3: not UTF-8 text (byte 0xfc): save it as UTF-8",
    b"scene: x\n# \xfcber\n": "2: not UTF-8 text (byte 0xfc): save it as UTF-8",
    b"lattice:\n\tpoints: 3\n": (
        "2:1: not readable as YAML: found character '\\t' that cannot start any token"
        " (YAML allows no tabs for indentation: use spaces)"
    ),
    b"wall: &x {a: 2}\nvideo: *x\n": (
        "2:8: not readable as YAML: aliases (*) are not supported: write the value out"
    ),
    b"scene: x\n---\nscene: x\n": "2:1: not readable as YAML: but found another",
    b'scene: "\\UFFFFFFFF"\n': OUT_OF_RANGE,
    b"a: " + b"[" * 500: OUT_OF_RANGE,
    b"a: " + b"9" * 5000: OUT_OF_RANGE,
}


@pytest.mark.parametrize("text", NO_SCENES, ids=range(len(NO_SCENES)))
def test_a_text_that_is_no_scene_gives_one_clear_line(path, text):
    (fault,) = faults(path, text)
    assert fault.startswith(NO_SCENES[text])


# YAML 1.2's core schema; PyYAML by itself reads 1e-3 as a string and 010 as eight.
NUMBERS = {
    **{"1e-3": 1e-3, "1E3": 1e3, "2.e1": 20.0, ".5": 0.5, "+1.5": 1.5},
    **{"010": 10.0, "0x10": 16.0},
}


@pytest.mark.parametrize("text", NUMBERS)
def test_numbers_are_read_as_yaml_1_2_has_them(path, text):
    value = NUMBERS[text]
    # as Windows writes it
    written = f"\ufeffscene: compression\r\nmaterial:\r\n  k_a: {text}"
    path.write_bytes(written.encode())
    assert load_scene(path).material.k_a == value
    assert load_scene("compression", [f"material.k_a={text}"]).material.k_a == value


def test_the_last_override_of_a_key_wins():
    text = "scene: exponential_wall\nlattice: {points: -1, seed: 5}\n"
    changes = ["lattice.points=20", "lattice.points=30", "impact.velocity = 1e-2"]
    scene = load_scene(text, [*changes, "time.dt=auto"])
    assert (scene.lattice.points, scene.lattice.seed) == (30, 5)
    assert load_scene(text, changes[1]) == load_scene(text, changes[:2])
    other = load_scene(text, ["scene=compression", "lattice.points=3"])
    assert other == load_scene("scene: compression\nlattice: {points: 3, seed: 5}\n")
    assert other == load_scene(text, ["scene=compression", "lattice={points: 3}"])


def test_a_missing_file_is_answered_with_the_nearest_name(tmp_path, monkeypatch):
    shipped = "The shipped scenes are absorbing_wall, bouncing_disk, .*, ringing_disk$"
    with pytest.raises(InputError, match=rf"^nonsense: no such file\. {shipped}"):
        load_scene("nonsense")
    near = rf"no such file; did you mean exponential_wall\? {shipped}"
    with pytest.raises(InputError, match=near):
        load_scene(tmp_path / "scenes" / "exponental_wall.yaml")
    monkeypatch.setattr(tree, "__file__", "/no.zip/taichi_disk/experiments/config/a")
    with pytest.raises(InputError, match="missing, as in a zip file"):
        load_scene("exponential_wall")


def test_a_path_that_cannot_be_read_is_refused(tmp_path):
    (tmp_path / "a.yaml").touch()
    with pytest.raises(InputError, match=r": is a folder, not a file$"):
        load_scene(tmp_path)
    below = str(tmp_path / "a.yaml" / "b.yaml")
    for source in ("a\0b", "a" * 300, "a" * 5000, below, "", "\udc80", "\ud800: 3"):
        with pytest.raises(InputError) as refusal:
            load_scene(source)
        str(refusal.value).encode()
    for source in (5, None, b"a.yaml", ["a"], 1.5):
        with pytest.raises(InputError, match="scene: must be a path, not "):
            load_scene(source)


def test_a_file_in_the_way_has_precedence_over_a_shipped_scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "compression").mkdir()  # such a folder is the output of a run
    assert load_scene("compression") == SCENES["compression"]()
    (tmp_path / "exponential_wall").write_text(
        "scene: exponential_wall\nlattice: {points: 7}\n"
    )
    assert load_scene("exponential_wall").lattice.points == 7


# Whatever is given makes a scene, or an InputError whose text can be printed.

WORDS = """\
scene lattice material wall impact compression time video sweep points seed rim file
k_a dt velocity gap pressure auto precision f64 reset exponential_wall absorbing_wall
lin geom range : - , { } [ ] & * &a *a ! !!int !!float !!python/none | > ' " # --- ...
% %YAML ? << ~ null true 0 -1 1e-3 1e999 .nan .inf 0x 0o7 1_0 \\ "\\ud800" é"""
SPACES = [": ", "\n", "\n  ", "\n\t", "\x85", "\u2028", "\ufeff"]
SOUP = st.lists(st.sampled_from([*WORDS.split(), *SPACES]), max_size=40)


def try_to_load(source, *overrides):
    try:
        load_any(source, overrides)
    except InputError as error:
        assert str(error).encode()


@settings(max_examples=15, deadline=None)
@given(
    text=SOUP.map(" ".join) | SOUP.map("".join) | st.text(),
    data=st.binary(max_size=200),
)
@example(text="scene: \ud800", data=b"")
@example(text="%YAML 1.1\n---\nscene: compression", data=b"")
@example(text=f"%YAML {'1' * 5000}.1\n---\nscene: compression", data=b"")
def test_any_text_and_any_bytes_give_a_scene_or_an_input_error(path, text, data):
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try_to_load(path, *([text[:20], f"time.dt={text}"] if text else []))
    try_to_load("\n" + text)
    path.write_bytes(IMPACT.encode() + data)
    try_to_load(path)


@pytest.mark.parametrize("section", ["lattice", "sweep", ""])
def test_twenty_faults_are_explained_and_the_others_counted(monkeypatch, section):
    compared = []
    similar = difflib.get_close_matches
    monkeypatch.setattr(
        difflib,
        "get_close_matches",
        lambda *arguments, **options: (
            compared.append(arguments) or similar(*arguments, **options)
        ),
    )
    names = [f"pionts{k}" for k in range(1000)]
    text = "scene: exponential_wall\n" + f"{section}:\n" * bool(section)
    text += "".join(f"{' ' * len(section)}{name}: 1\n" for name in names)
    with pytest.raises(InputError) as caught:
        load_any(text)
    assert len(compared) <= 60  # not for each of the thousand
    lines = str(caught.value).splitlines()
    assert len(lines) == 22
    assert lines[0] == "1,000 faults in the scene:"
    assert "did you mean" in lines[20]
    assert lines[-1] == "  and 980 more"
