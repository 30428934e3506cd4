"""A sandbox behind its page: its commands, and the messages that show it."""

import json
import os
import random
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.fields import Triangles
from taichi_disk.mechanics.simulation.observables import INDEX
from taichi_disk.pictures.render.palette import full_scale
from taichi_disk.pictures.web.drawing import colour_values
from taichi_disk.sandbox.app import list_folder, list_presets
from taichi_disk.sandbox.controls import CHOICES, CURVE_POINTS, RANGES
from taichi_disk.sandbox.graphs import CURVES
from taichi_disk.sandbox.session import Session, read_command

WEB = Path(__file__).parents[3] / "taichi_disk" / "pictures" / "web"


@pytest.fixture
def session(playlist, kernels):
    return Session(playlist)


def say(session, kind, **more):
    """As a page does, through the check of messages."""
    message = read_command(json.dumps({"do": kind} | more))
    assert message
    session.hear(message)
    session.advance()


def until(session, is_reached):
    """Let time pass; a minute must be enough."""
    end = time.monotonic() + 60.0
    while not is_reached():
        assert time.monotonic() < end
        session.advance()


def panel(session):
    return dict(json.loads(session.messages["panel"]))


# ---- messages


BAD = [
    *("", "{", "[1]", "null", "[" * 1000, b"\0"),
    *('{"do": "close"}', '{"do": ["press"]}', '{"do": "press"}'),
    '{"do": "pull", "x": 1}',
    '{"do": "pull", "x": 1, "y": null}',
    '{"do": "pull", "x": 1, "y": NaN}',
    '{"do": "set", "key": "impact.gap", "value": 1.0}',
    '{"do": "set", "key": "wall.a", "value": "soft"}',
    '{"do": "set", "key": "video.colour", "value": 3}',
    '{"do": "set", "key": "lattice.seed", "value": 3}',
    '{"do": "set", "key": "wall.a", "value": 1e99}',
]


@pytest.mark.parametrize("text", BAD)
def test_a_message_that_no_page_sends_is_none(text):
    assert read_command(text) is None


VALUES = [None, True, -1, 1e300, 0.3, 2, "x", "", [], {}, float("nan"), 2**70]
WORDS = ["\ud800", "axial", "shear", "pinned"]
KINDS = "play scrub turn aim throw pull release rescale collect clear press set what"
NAMES = ("value", "number", "t", "angle", "final", "dx", "dy", "x", "y")


@pytest.mark.validate
def test_no_message_makes_an_error(session):
    choose = random.Random(2)
    keys = [*RANGES, *CHOICES, "video.magnify", "impact.gap", ""]
    keys += session.controls.actions
    heard = 0
    while heard < 40:
        message = {"do": choose.choice(KINDS.split()), "key": choose.choice(keys)}
        for name in NAMES:
            number = choose.uniform(-2.0, 3.0)
            message[name] = choose.choice([number, choose.choice(VALUES + WORDS)])
        read_command(json.dumps(message)[: choose.randrange(60)])
        found = read_command(json.dumps(message))
        if not found:
            continue
        if found["do"] == "set" and found["key"] == "lattice.points":
            found["value"] = 60 + abs(found["value"]) % 60
        session.hear(found)
        heard += 1
        if choose.random() < 0.5:
            session.advance()
    assert session.messages["state"]


@pytest.mark.validate
def test_a_slider_that_is_held_while_the_scene_changes_is_let_be(session):
    say(session, "play", number=2)  # a compression
    say(session, "set", key="impact.velocity", value=0.03)
    say(session, "set", key="wall.boundary", value="pinned")
    assert panel(session)["name"] == "compression" and not panel(session)["message"]
    assert all(
        isinstance(one["value"], (int, float)) for one in panel(session)["sliders"]
    )
    # what is said of a refused number goes with a right one, and comes again with it
    say(session, "set", key="compression.pressure", value=-1e9)
    refused = panel(session)
    assert "compression.pressure" in refused["message"]
    say(session, "set", key="compression.pressure", value=-1e9)
    assert panel(session)["message"] == refused["message"]
    assert panel(session)["refusals"] == refused["refusals"] + 1
    # a number that was typed keeps its digits
    say(session, "set", key="compression.pressure", value=0.0123456)
    assert not panel(session)["message"]
    assert session.sandbox.scene.compression.pressure == 0.0123456


# ---- states


@pytest.mark.skipif(not shutil.which("node"), reason="no node")
def test_the_page_reads_from_a_state_what_the_sandbox_sees(session, tmp_path):
    say(session, "press", key="space")
    until(session, lambda: session.sandbox.time.display.values["wall_force"] >= 1e-3)
    (tmp_path / "state").write_bytes(session.messages["state"])
    shutil.copy(WEB / "message.js", tmp_path / "message.mjs")
    code = f"""
import {{ readFileSync }} from "fs";
import {{ unpacked }} from "./message.mjs";
const bytes = readFileSync("state");
const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
const state = unpacked(buffer, {json.dumps([*INDEX])}, {len(CURVES)});
const plain = (_, value) => (ArrayBuffer.isView(value) ? [...value] : value);
console.log(JSON.stringify(state, plain));"""
    (tmp_path / "read.mjs").write_text(code, encoding="utf-8")
    read = subprocess.check_output(["node", "read.mjs"], cwd=tmp_path, text=True)
    state = json.loads(read)
    seen = session.sandbox.time.display
    header = [state[name] for name in ("number", "t", "pulled")]
    assert header == pytest.approx([session.number, seen.t, -1], rel=1e-6)
    for name, value in seen.values.items():
        assert state["row"][name] == pytest.approx(value, rel=1e-6)
    np.testing.assert_allclose(state["x"], seen.x.ravel(), rtol=1e-6, atol=1e-6)
    scales = [session.scales.colour, session.scales.force]
    assert [state["limit"], state["fullForce"]] == pytest.approx(scales, rel=1e-6)
    assert len(state["values"]) == len(seen.x)
    assert state["forces"]
    energy = session.sandbox.time.segment.scenario.reference_energy
    # however late the picture is: what dashpots have taken belongs to it
    assert sum(state["graph"][:6]) == pytest.approx(energy, rel=1e-4)
    assert state["caption"].startswith("t = ")
    graphs = json.loads(session.messages["graphs"])
    assert len(graphs["values"]) == len(CURVES) and graphs["t"][0] == 0.0


def test_of_throws_that_make_a_curve_fewer_states_are_kept(session):
    spacing = session.sandbox.time.spacing
    say(session, "collect")
    assert session.sandbox.time.spacing == pytest.approx(20.0 * spacing)


@pytest.mark.validate
def test_a_curve_is_collected_by_itself_and_stops_when_asked(session, monkeypatch):
    monkeypatch.setattr("taichi_disk.sandbox.sandbox.COLLECTING_PACE", 1e4)
    say(session, "set", key="speed", value=100.0)
    say(session, "collect")
    until(session, lambda: len(session.sandbox.results) > 1)
    first, second = panel(session)["results"]
    assert first["load"] > second["load"] and not first["disturbance"]
    scenario = session.sandbox.scene.with_(velocity=first["load"]).scenario()
    outcome = compute(scenario)
    assert first["value"] == scenario.primary(outcome.series)[1]  # in all digits
    say(session, "collect")
    # no throw was in flight: the disk stays where the last one ended
    assert not session.sandbox.remaining_loads and panel(session)["paused"]
    say(session, "press", key="r")
    say(session, "set", key="impact.velocity", value=0.04)
    scene = session.sandbox.scene
    say(session, "collect")
    until(session, lambda: not panel(session)["collecting"])
    assert len(panel(session)["results"]) == 2 + CURVE_POINTS
    assert session.sandbox.scene == scene
    assert panel(session)["paused"] and panel(session)["atStart"]
    say(session, "clear")
    assert panel(session)["results"] == []


@pytest.mark.validate
def test_the_colour_scale_is_known_before_the_throw_and_doubles_at_most(session):
    scales = session.scales
    before = scales.colour
    say(session, "set", key="speed", value=5.0)
    say(session, "press", key="space")
    scenario = session.sandbox.time.segment.scenario
    triangles = Triangles(scenario.lattice)
    largest = 0.0
    while not session.sandbox.paused:
        session.advance()
        assert scales.colour == before
        assert not scales.note
        now = session.sandbox.time.display
        springs = scenario.model.springs
        values = colour_values("shear", triangles, springs, now.x, now.v)
        largest = max(largest, full_scale(values.astype(float), "shear"))
    assert 0.5 < before / largest < 2.0
    say(session, "rescale")
    assert scales.colour < before  # the disk vibrates
    say(session, "press", key="h")
    assert scales.colour == before


def test_a_scale_grows_by_twos_with_a_note_and_not_from_rounding_errors(session):
    scales = session.scales
    before = scales.colour
    disk = np.full(120, 1.4 * before)
    nothing = np.zeros((0, 3))
    scales.update(disk, nothing, "shear")
    assert (scales.colour, scales.note) == (before, "")
    scales.update(4.0 * disk, nothing, "shear")
    assert scales.colour == 4.0 * before
    assert f"{4.0 * before:g}" in scales.note
    scales.rescale()
    scales.update(1e-9 * disk, nothing, "shear")
    assert (scales.colour, scales.note) == (before, "")
    scales.rescale()
    scales.update(1e-3 * disk, nothing, "shear")
    assert 1e-3 < scales.colour / before < 2e-3


def test_all_keys_count_that_are_pressed_between_two_pictures(session):
    for _ in range(2):
        session.hear({"do": "press", "key": "l"})  # another random lattice
    session.advance()
    assert session.sandbox.scene.lattice.seed == 2


def test_an_error_in_a_command_is_named_and_all_go_on(session, monkeypatch, capfd):
    def fail(*_):
        raise IndexError("out of range")

    monkeypatch.setattr(session.sandbox, "hit_again", fail)
    session.controls.add("h", "", session.sandbox.hit_again)
    say(session, "press", key="h")
    assert "IndexError: out of range" in panel(session)["message"]
    assert "Traceback" in capfd.readouterr().err
    say(session, "press", key="space")
    monkeypatch.setattr(session.sandbox, "tick", fail)
    session.advance()
    assert "the disk is at the start again" in panel(session)["message"]
    assert panel(session)["paused"] and session.sandbox.at_start
    monkeypatch.undo()
    say(session, "press", key="space")
    until(session, lambda: not session.sandbox.at_start)


@pytest.mark.validate
def test_names_that_are_not_utf_8_reach_every_page(kernels, tmp_path):
    try:
        path = tmp_path / os.fsdecode(b"\xff.yaml")
        path.write_text("scene: exponential_wall\nlattice: {points: 60}\n")
    except OSError:
        pytest.skip("this file system takes only UTF-8")
    session = Session(list_folder(tmp_path))
    texts = [each for kind, each in session.messages.items() if kind != "state"]
    assert "".join(texts).encode()
    assert panel(session)["name"] == "\udcff"


@pytest.mark.validate
@pytest.mark.parametrize("number", range(21))
def test_every_scene_of_the_list_ends_as_run_does_after_random_events(number, kernels):
    """What a user does before the throw leaves no trace in the scene as it is listed,
    and the time between two pictures changes no digit."""
    entries = list_presets(None)
    session = Session(entries)
    choose = random.Random(number)
    keys = [key for key in "bnrhzxadlecy" if key in session.controls.actions]
    for _ in range(12):
        t = choose.uniform(0.0, 20.0)
        events = {
            "press": {"key": choose.choice([*keys, "space"])},
            "scrub": {"t": t},
            "pull": {"x": choose.uniform(-1.0, 1.0), "y": t},
            "turn": {"angle": 0.1 * t, "final": 1},
            "release": {},
        }
        kind = choose.choice([*events])
        say(session, kind, **events[kind])
    say(session, "release")
    say(session, "clear")
    say(session, "play", number=number)
    sandbox = session.sandbox
    assert panel(session)["name"] == entries[number].name
    say(session, "set", key="speed", value=100.0)
    if sandbox.paused:
        say(session, "press", key="space")
    # without a clock, so that it takes no longer than a run; a disk may bounce on
    while not (sandbox.paused or sandbox.results):
        sandbox.advance(choose.uniform(0.001, 0.1), max_seconds=np.inf)
    assert sandbox.time.segment.control.attempt == 1
    scenario = entries[number].load().scenario()
    outcome = compute(scenario, estimate=False)
    expected = scenario.primary(outcome.series)[1]
    assert [one.value for one in sandbox.results] == [expected]


def test_a_drawn_body_stands_there_and_a_faulty_one_changes_nothing(session, tmp_path):
    say(session, "set", key="lattice.points", value=60)
    for path in ("M0 0L2 2L2 0L0 2Z", 'M0 0"/><use href="/etc/passwd', "M0 0L"):
        say(session, "outline", path=path)
        assert session.sandbox.scene.lattice.outline == "none"
    say(session, "outline", path="M0 0L2 0L2 2L0 2Z")
    assert session.sandbox.at_start
    assert session.sandbox.time.segment.scenario.shape.radius > 1.2
    saved = json.loads(session.messages["yaml"])
    (tmp_path / saved["name"]).write_text(saved["outline"])
    (tmp_path / "scene.yaml").write_text(saved["text"])
    body = load_scene(tmp_path / "scene.yaml").body()
    assert (body.positions == session.sandbox.time.start.body.positions).all()
