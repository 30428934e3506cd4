"""Throws that a page computes, in Node: they have the step and the e of `run`."""

import json
import random
import shutil
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from programs import packed, python

from taichi_disk import load_scene
from taichi_disk.experiments.computation.scenario import OwnStart
from taichi_disk.mechanics.fields import QUANTITIES, Triangles, at_points
from taichi_disk.pictures.render.recording import Flight, Recording
from taichi_disk.pictures.render.words import label
from taichi_disk.pictures.web import throws
from taichi_disk.pictures.web.drawing import FILM, bundle
from taichi_disk.runs import api
from taichi_disk.sandbox import session

pytestmark = pytest.mark.skipif(
    not shutil.which("node"), reason="not installed: node (apt-get install nodejs)"
)
SMALL = ["lattice.points=60", "impact.velocity=0.05"]
# what a page does with a film that it throws, without its document
PREPARE = """
import { readFileSync } from "node:fs";
const [films, throws] = JSON.parse(readFileSync(0));
const diskOfFilm = ({ again, runs: [{ scene }] }) => {
  const names = ["springs", "triangles", "outline"];
  const drawn = names.map((name) => [name, decoded(scene[name], Int32Array)]);
  return diskOf(again, Object.fromEntries(drawn));
};
const flight = (disk, numbers) => {
  const steps = throwing(disk, ...numbers);
  let next;
  do next = steps.next();
  while (!next.done);
  return next.value;
};
"""
FLY = """
const found = films.map((film, k) => {
  const { moments, restitution, rows, end, dt } = flight(diskOfFilm(film), throws[k]);
  const { elastic, vibration, rotation, translation, dissipated } = rows[end];
  const energies = [elastic, vibration + rotation + translation, dissipated];
  return [restitution, Math.round(rows[end].t / dt), moments[2] - moments[0],
    ...energies];
});
console.log(JSON.stringify(found));
"""


def in_node(tmp_path, code, *given):
    """Run the modules of a film and `code` in Node, and return what it prints."""
    script = tmp_path / "page.mjs"
    script.write_text(bundle(*FILM[:-1]) + PREPARE + code, encoding="utf-8")
    done = python(script, input=json.dumps(given), program="node")
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


def numbers_of(draw):
    """Return the keys of a random disk that pages throw."""
    numbers = {
        "lattice.points": draw.randint(90, 120),
        "lattice.seed": draw.randrange(2**32),
        "lattice.rim": draw.random() < 0.5,
        "wall.V0": 10.0 ** draw.uniform(-1, 3),
        "wall.a": 30.0 * 40.0 ** draw.random(),
        "impact.turn": draw.uniform(-3.0, 3.0),
        "time.safety": draw.uniform(0.3, 0.9),
        "material.k_b": 10.0 ** draw.uniform(-3, 2),
    }
    body = draw.choice(["plain", "hole", "core", "outline"])
    if body == "outline":
        del numbers["lattice.rim"]
        numbers["lattice.outline"] = str(Path(session.__file__).with_name("ell.svg"))
    if body == "hole":
        numbers["lattice.points"] = 150
        numbers["lattice.hole"] = 0.4
    if body == "core":
        numbers["lattice.core_radius"] = 0.5
        numbers["lattice.core_density"] = 10.0 ** draw.uniform(-1, 1)
    if draw.random() < 0.3:
        numbers["material.k_a"] = 4.0 ** draw.uniform(-1, 1)
    return numbers


def flight_of(draw, slowest):
    """Return the keys of a random throw."""
    return {
        "impact.velocity": slowest * (0.1 / slowest) ** draw.random(),
        "material.eta_star": draw.choice([0.0, draw.uniform(0.0, 100.0)]),
    }


def compare(tmp_path, disks):
    """Throw disks in a page and by `run`: (keys of the film, keys of the throw)."""
    films = []
    numbers = []
    expected = []
    step = ["time.integrator=velocity_verlet", "video.seconds=1", "video.fps=5"]
    for of_film, of_throw in disks:
        scene = load_scene("exponential_wall", step).with_(of_film)
        film = api.run(scene, lattices=1).film(tmp_path / "film.html")
        films.append(packed(film)[0])
        run = api.run(scene.with_(of_throw), lattices=1)
        numbers.append(list(of_throw.values()))
        names = ("restitution", "steps", "contact_time")
        energies = [run.series[k][-1] for k in ("elastic", "kinetic", "dissipated")]
        expected.append([*(run.summary[name] for name in names), *energies])
    found = in_node(tmp_path, FLY, films, numbers)
    for one, other, throw in zip(found, expected, numbers, strict=True):
        assert one[:2] == pytest.approx(other[:2], abs=1e-10), throw
        assert one[2:] == pytest.approx(other[2:], abs=1e-8), throw


def test_a_rough_disk_that_spins_ends_its_throw_at_the_row_of_run(tmp_path):
    # Its energy of rotation is no vibration, for which the end would wait.
    disk = {
        "lattice.points": 96,
        "lattice.seed": 794021959,
        "lattice.rim": False,
        "lattice.core_radius": 0.42393732524609706,
        "lattice.core_density": 1.302824747384565,
        "wall.a": 940.4048029027263,
    }
    flight = {"impact.velocity": 0.021241816628591904, "material.eta_star": 0.0}
    compare(tmp_path, [(disk, flight)])


@pytest.mark.validate
@pytest.mark.parametrize("seed", range(8))
def test_forty_random_throws_have_the_e_and_the_steps_of_run(seed, tmp_path):
    draw = random.Random(seed)
    disks = []
    for _ in range(5):
        of_film = numbers_of(draw) | flight_of(draw, slowest=0.01)
        disks.append((of_film, flight_of(draw, slowest=0.001)))
    compare(tmp_path, disks)


COLOUR = """
const [{ x, v }] = throws;
const { colours } = diskOfFilm(films[0]);
const { quantities } = films[0].runs[0].scene;
console.log(JSON.stringify(Object.fromEntries(quantities.map(({ name }) =>
  [name, Array.from(colours.of(name, Float64Array.from(x), Float64Array.from(v)))]))));
"""


def test_a_page_knows_every_colour(tmp_path):
    scene = load_scene("exponential_wall", [*SMALL, "video.seconds=1", "video.fps=5"])
    result = api.run(scene, lattices=1)
    film = packed(result.film(tmp_path / "film.html"))[0]
    _, x, v = result.state(result.contact.greatest)
    state = {"x": x.ravel().tolist(), "v": v.ravel().tolist()}
    found = in_node(tmp_path, COLOUR, [film], [state])
    assert found.keys() == QUANTITIES.keys()
    springs = result.scenario.model.springs
    for name, colours in found.items():
        values = at_points(name, Triangles(result.lattice), springs, x, v)
        assert colours == pytest.approx(values, rel=1e-9, abs=1e-15), name


def test_pages_and_films_write_numbers_as_in_print(tmp_path):
    numbers = [-5.0, 2e-7, 0.0, 0.5, -2.0 / 3.0]
    expected = ["−5", "+2·10⁻⁷", "0", "+0.5", "−0.6667"]
    code = "console.log(JSON.stringify(throws.map((value) => label(value, true))));"
    assert in_node(tmp_path, code, [], numbers) == expected
    assert [label(value, signed=True) for value in numbers] == expected


LOOK = """
console.log(JSON.stringify(films.map((film, k) => {
  const disk = diskOfFilm(film);
  const again = new Again(disk, film, flight(disk, throws[k]), 0);
  const { quantities } = film.runs[0].scene;
  const limits = quantities.map(({ name }) => [name, again.limit(name)]);
  return [again.strengths, Object.fromEntries(limits)];
})));
"""


def test_a_page_fits_scales_and_ringing_to_a_throw_as_its_film_does(tmp_path):
    step = ["time.integrator=velocity_verlet", "video.seconds=3", "video.fps=5"]
    scene = load_scene("exponential_wall", [*SMALL, *step])
    numbers = [(0.05, 0.0), (0.05, 0.3), (0.1, 0.1)]
    films = []
    strengths = []
    for v, eta in numbers:
        result = api.run(scene.with_(velocity=v, eta_star=eta), lattices=1)
        films.append(packed(result.film(tmp_path / "film.html"))[0])
        strengths.append(films[-1]["runs"][0]["strengths"])
    found = in_node(tmp_path, LOOK, films, numbers)
    faded_in = np.array([each for each, _ in found])
    assert faded_in == pytest.approx(np.array(strengths))
    assert sorted(max(each) for each in strengths)[1] > 1.0
    times = [result.contact.start, float(result.series["t"][-1])]
    recording = Recording(Flight.of(result, 0.0), times, list(QUANTITIES), 1.0)
    # a round number, or the next one, because the page takes the nearest rows
    assert found[-1][1] == pytest.approx(recording.limits, rel=0.3)


# Each has one reason for which pages cannot throw it.
NOT_THROWN = """impact.angle=0.2, impact.spin=0.1, wall.friction=0.3, impact.gap=0.2
time.dt=0.001, time.tolerance=1e-3, material.dashpot=axial
lattice.core_radius=0.5 lattice.core_stiffness=2, wall.points=160"""


def is_thrown(scenario):
    return throws.throwable(SimpleNamespace(run=SimpleNamespace(scenario=scenario)))


@pytest.mark.parametrize("settings", NOT_THROWN.replace("\n", ", ").split(", "))
def test_what_a_page_cannot_step_is_not_thrown(settings):
    name = "absorbing_wall" if "wall.points" in settings else "exponential_wall"
    assert not is_thrown(load_scene(name, [*SMALL, *settings.split()]).scenario())


def test_a_disk_or_a_start_of_ones_own_is_not_thrown(tmp_path):
    scene = load_scene("exponential_wall", SMALL)
    plain = scene.scenario()
    assert is_thrown(plain)
    x = plain.lattice.positions
    np.savez(tmp_path / "body.npz", positions=x, bonds=plain.lattice.bonds)
    file = f"lattice.file={tmp_path / 'body.npz'}"
    assert not is_thrown(load_scene("exponential_wall", [file]).scenario())
    own = OwnStart(None, np.full_like(x, -0.05) * [0.0, 1.0])
    assert not is_thrown(scene.scenario(own=own))


def test_a_page_says_that_a_disk_is_too_large_for_it(tmp_path, monkeypatch, notices):
    scene = load_scene("exponential_wall", [*SMALL, "wall.a=200", "video.fps=5"])
    result = api.run(scene.with_({"video.goal": 0.9}), lattices=1)
    notices.clear()
    for limit in ("MOST_POINTS", "_MOST_WORK"):
        assert packed(result.film(tmp_path / "film.html"))[0]["again"]
        assert not notices.messages
        with monkeypatch.context() as patch:
            patch.setattr(throws, limit, 59)
            path = result.film(tmp_path / "film.html")
        assert packed(path)[0]["again"] is None
        assert "This disk is too large for a page to throw" in path.read_text()
        assert "no task" in notices.messages[0]
        notices.clear()


@pytest.mark.parametrize("part", ["start", "end", "compare"])
def test_a_part_of_a_film_and_a_comparison_are_not_thrown(part, tmp_path):
    scene = load_scene("exponential_wall", [*SMALL, "video.seconds=1", "video.fps=5"])
    result = api.run(scene, lattices=1)
    options = {"start": "contact", "end": "greatest", "compare": [result]}
    path = result.film(tmp_path / "film.html", **{part: options[part]})
    film = packed(path)[0]
    assert film["again"] is None
    energies = [one["name"] for one in film["curves"] if one["name"]]
    assert {energies.count(name) for name in energies} == {1 + (part == "compare")}


# What a film chooses by a rule, and a page for its own throws, too; `digest` holds all.
FOLLOW = """
const film = films[0];
const flown = (rules) => {
  const disk = diskOfFilm({ ...film, again: { ...film.again, rules } });
  const one = new Again(disk, film, flight(disk, throws), 0);
  const { magnify, fullForce, ringing, captions, strengths, end } = one;
  const curves = one.curves.map(({ name }) => name);
  const scale = [magnify, fullForce, one.limit("shear")];
  return JSON.stringify([scale, ringing, captions, strengths, end, curves]);
};
const { rules } = film.again;
const usual = flown(rules);
const changes = CHANGES;
const names = Object.keys(rules).filter((name) =>
  !changes[name]?.some((value) => flown({ ...rules, [name]: value }) !== usual));
console.log(JSON.stringify(names));
"""
# values of each rule of which one changes what is shown
CHANGES = {
    "fullColour": [0.5],
    "roundNumbers": [[1, 10]],
    "scaleStates": [1.5],  # one state
    "longestForce": [0.01],
    "flattening": [1.0],
    "mostMagnified": [1.5],
    "ringing": [10.0],
    "mostRinging": [1.5],
    "faint": [0],
    "damped": [-1],
    "ease": [0.01],
    "visibleEnergy": [10.0],
    "besideContact": [0.0],
    "slowPace": [100.0],
    "muchSlower": [1.0, 1e9],
}


def test_a_page_follows_every_rule_of_films(tmp_path, monkeypatch):
    made = []  # processes
    monkeypatch.setattr(api, "drawing_process", lambda x: nullcontext(made.append(x)))
    scene = load_scene("exponential_wall", [*SMALL, "material.eta_star=0"])
    film = packed(api.run(scene, lattices=1).film(tmp_path / "film.html", fps=10))[0]
    code = FOLLOW.replace("CHANGES", json.dumps(CHANGES))
    assert in_node(tmp_path, code, [film], [0.02, 0.0]) == []
    assert film["again"]["rules"] == json.loads(json.dumps(throws._RULES))
    assert made == [False]  # no process encodes a page
