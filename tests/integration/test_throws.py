"""Throws that a page computes, in Node: they have the step and the e of `run`."""

import json
import random
import shutil

import pytest
from programs import packed, python

from taichi_disk import load_scene
from taichi_disk.pictures.web.drawing import FILM, bundle
from taichi_disk.runs import api

pytestmark = pytest.mark.skipif(
    not shutil.which("node"), reason="not installed: node (apt-get install nodejs)"
)
# what a page does with a film that it throws, without its document
PREPARE = """
import { readFileSync } from "node:fs";
const [films, throws] = JSON.parse(readFileSync(0));
const diskOfFilm = ({ again, runs: [{ scene }] }) => {
  const names = ["springs", "triangles", "outline"];
  const drawn = names.map((name) => [name, decoded(scene[name], Int32Array)]);
  return diskOf(again, Object.fromEntries(drawn));
};
"""
FLY = """
const found = films.map((film, k) => {
  const steps = throwing(diskOfFilm(film), ...throws[k]);
  let next;
  do next = steps.next();
  while (!next.done);
  const { restitution, rows, end, dt } = next.value;
  return [restitution, Math.round(rows[end].t / dt)];
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
    body = draw.choice(["plain", "hole", "core"])
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
    throws = []
    expected = []
    step = ["time.integrator=velocity_verlet", "video.seconds=1", "video.fps=5"]
    for of_film, of_throw in disks:
        scene = load_scene("exponential_wall", step).with_(of_film)
        film = api.run(scene, lattices=1).film(tmp_path / "film.html")
        films.append(packed(film)[0])
        run = api.run(scene.with_(of_throw), lattices=1)
        throws.append(list(of_throw.values()))
        expected.append([run.summary[name] for name in ("restitution", "steps")])
    found = in_node(tmp_path, FLY, films, throws)
    for one, other, numbers in zip(found, expected, throws, strict=True):
        assert one == pytest.approx(other, abs=1e-10), numbers


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
