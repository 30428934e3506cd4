"""The page's drawing, curves, fit and typed numbers, run by node."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from bodies import disk

from taichi_disk.mechanics.statics.equilibrium import turned
from taichi_disk.pictures.render.geometry import placed
from taichi_disk.pictures.web.drawing import DRAWING, FILM, bundle
from taichi_disk.studies.figures.theory import fit_restitution
from tests.staged import SANDBOX

pytestmark = pytest.mark.skipif(not shutil.which("node"), reason="no node")
SIZE = 60
CANVAS = """
globalThis.matchMedia = () => ({});
globalThis.document = { createElement: () => ({ getContext: () => ({
  createImageData: (width, height) => ({
    width, height, data: new Uint8ClampedArray(4 * width * height) }),
  putImageData() {} }) }) };
"""
# points on a circle and one in the middle [px], y upwards
ANGLES = np.linspace(0.0, 2.0 * np.pi, 13)[:-1]
RING = 30.0 + 25.3 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
POINTS = np.vstack([RING, [[30.2, 29.7]]])
FAN = [[k, (k + 1) % 12, 12] for k in range(12)]


def run_in_node(code, folder):
    script = folder / "script.mjs"
    modules = bundle(*DRAWING, "controls.js", "graphs.js", "results.js")
    script.write_text(CANVAS + modules + code, encoding="utf-8")
    return json.loads(subprocess.check_output(["node", script], encoding="utf-8"))


def drawn(folder, mark, fringes=False):
    """Return the pixels (SIZE, SIZE, 4) of the fan with values x/SIZE, y upwards."""
    code = f"""
const field = new Field({{
  points: 13, triangles: new Uint32Array({np.ravel(FAN).tolist()}),
  springs: new Uint32Array([0, 6, 3, 9]) }});
const map = Uint8Array.from({{ length: 768 }}, (_, k) => {{
  const level = Math.floor(k / 3);
  return [level, 255 - level, level >> 1][k % 3];
}});
field.draw({SIZE}, {SIZE}, {{ positions: Float32Array.from({POINTS.ravel().tolist()}),
  values: Float32Array.from({(POINTS[:, 0] / SIZE).tolist()}),
  marks: [{mark}], colours: map,
  factor: 1, shift: [0, 0], scale: [1, 0], fringes: {json.dumps(fringes)} }});
console.log(JSON.stringify([...field.image.data]));"""
    pixels = np.array(run_in_node(code, folder)).reshape(SIZE, SIZE, 4)
    return pixels[::-1]


def test_triangles_cover_their_body_once_with_interpolated_values(tmp_path):
    pixels = drawn(tmp_path, '{ mark: "triangles" }')
    middle = np.arange(SIZE) + 0.5
    x, y = np.meshgrid(middle, middle)
    distance = np.full(x.shape, np.inf)  # to the nearest side, positive inside
    for a, b in zip(RING, np.roll(RING, -1, axis=0), strict=True):
        along = (b - a) / np.hypot(*(b - a))
        side = along[0] * (y - a[1]) - along[1] * (x - a[0])
        distance = np.minimum(distance, side)
    inside = distance > 1e-3
    assert (pixels[inside, 3] == 255).all()
    assert (pixels[distance < -1e-3, 3] == 0).all()
    value = 255.0 * x / SIZE
    colours = np.stack([value, 255.0 - value, 0.5 * value], axis=-1)
    assert np.abs(pixels[..., :3] - colours)[inside].max() < 1.1
    # fringes repeat within a triangle
    pixels = drawn(tmp_path, '{ mark: "triangles" }', fringes=True)
    row = pixels[30, 10:50, 0] / 255.0
    along = np.arange(10, 50) + 0.5
    assert np.abs(row - np.sin(np.pi * along / SIZE) ** 2).max() < 0.01


def test_springs_and_points_have_soft_sides_and_their_width(tmp_path):
    springs = drawn(tmp_path, '{ mark: "springs", radius: 1.5 }')
    for across in (springs[:, 15, 3], springs[15, :, 3]):
        assert across.sum() / 255.0 == pytest.approx(3.0, abs=0.02)
        assert across.max() == 255
    points = drawn(tmp_path, '{ mark: "points", radius: 4 }')
    corner = points[22:38, 22:38, 3]  # around the point in the middle
    assert corner.sum() / 255.0 == pytest.approx(np.pi * 4.0**2, rel=0.02)
    assert centroid(corner) == pytest.approx([30.2 - 22.0, 29.7 - 22.0], abs=0.01)
    small = drawn(tmp_path, '{ mark: "points", radius: 1 }')[22:38, 22:38, 3]
    assert centroid(small) == pytest.approx([30.2 - 22.0, 29.7 - 22.0], abs=0.04)


def test_displacements_are_magnified_as_in_films(tmp_path):
    lattice = disk(40)
    x = turned(lattice.positions, 0.3) * [1.1, 0.8] + [0.4, 1.3]
    x += np.random.default_rng(4).normal(0.0, 0.02, x.shape)
    edge = float(x[:, 1].min()) + 0.01  # below it no other point is drawn
    code = f"""
const one = Object.create(Drawing.prototype);
one.options = {{ magnify: 2 }};
one.scene = {{ disk_points: 40, rest: {lattice.positions.ravel().tolist()},
  wall: {{ edge: {edge} }} }};
const shown = one.placed(Float64Array.from({x.ravel().tolist()}));
console.log(JSON.stringify([...shown]));"""
    shown = np.reshape(run_in_node(code, tmp_path), (-1, 2))
    assert shown == pytest.approx(placed(lattice, x, 2.0, edge), abs=1e-12)
    assert (shown[:, 1] == x[:, 1].min()).sum() > 1


def centroid(opacity):
    """Return the centre (x, y) of what is drawn [px]."""
    middle = np.arange(len(opacity)) + 0.5
    total = opacity.sum()
    x = float((opacity.sum(axis=0) * middle).sum() / total)
    y = float((opacity.sum(axis=1) * middle).sum() / total)
    return [x, y]


def test_the_fit_of_eq_5_is_that_of_sweeps(tmp_path):
    velocity = np.geomspace(3e-3, 0.1, 8)
    noise = np.random.default_rng(4).normal(0.0, 2e-3, 8)
    s = 1.0 / np.sqrt(np.log(4.0 / velocity))
    e = 1.1 * np.sqrt(1.0 - 0.6 * s) + noise
    rows = [{"load": v, "value": value} for v, value in zip(velocity, e, strict=True)]
    code = f"const {{ d1, d2, rms }} = fitRestitution({json.dumps(rows)});"
    code += "console.log(JSON.stringify([d1, d2, rms]));"
    d1, d2, rms = run_in_node(code, tmp_path)
    known = fit_restitution(velocity, e[None])
    assert d1 == pytest.approx(known.values["d1"], rel=1e-3)
    assert d2 == pytest.approx(known.values["d2"], rel=1e-3)
    assert rms == pytest.approx(np.sqrt(np.mean(known.residuals**2)), rel=1e-3)


READ = {
    **{"0.02": 0.02, " 2e-2 ": 0.02, "0,02": 0.02, ".5": 0.5, "1/50": 0.02},
    **{"1 / 50": 0.02, "½": 0.5, "−0.5": -0.5, "０．０２": 0.02, "1099": 1099},
    **{"0,125": 0.125, "20%": 0.2, "2,5 %": 0.025, "0.02 c": 0.02},
    **dict.fromkeys(("%", "1 000", "1,099", "1.2.3", "1/0", "1/2/3", "0.02 R", "")),
}


def test_a_typed_number_counts_as_a_whole_or_is_refused(tmp_path):
    code = f"const texts = {json.dumps([*READ])};"
    code += "const shown = digits(0.1 + 0.2) + ' ' + digits(123456.789);"
    code += "console.log(JSON.stringify([...texts.map(readNumber), shown]));"
    *read, shown = run_in_node(code, tmp_path)
    assert dict(zip(READ, read, strict=True)) == READ  # NaN is null
    assert shown == "0.3 123457"


CURVES = """
const canvas = () => ({ clientWidth: 0 });
const graphs = new Graphs([canvas(), canvas()], () => {});
const names = ["energy", "force", "motion"];
const curves = names.map((name) => [name, name, "#000", "#fff"]);
const message = (force, motion = "velocity upwards") => ({
  t: force.map((_, k) => k), values: [force, force, force], motion: [motion, "c"] });
const before = () => graphs.before?.curves[1].values ?? null;
const found = [];
const send = (...message_) => {
  graphs.replace(message(...message_), curves);
  found.push(before());
};
"""


def test_the_curves_of_a_whole_throw_stay_until_the_next_is_whole(tmp_path):
    code = """
send([0, 3, 5, 0]);
send([0]);       // thrown again: the first stays
send([0]);       // the start once more
send([0, 2, 4]); // in the contact
send([0]);       // begun again before its end: the first stays
send([0, 1, 2, 0]);
send([0]);       // the second stays
send([0], "compression"); // another scene
console.log(JSON.stringify(found));"""
    first, second = [0, 3, 5, 0], [0, 1, 2, 0]
    wanted = [None, first, first, first, first, first, second, None]
    assert run_in_node(CURVES + code, tmp_path) == wanted


def test_axes_are_as_long_before_a_throw_as_they_will_be(tmp_path):
    # measured: at 0.1 c from 0.5 R the disk has left at 12.8 R/c, the force was 0.087;
    # at 0.02 c from 0.025 R at 6.6 R/c, the force was 0.0148
    code = """
graphs.replace(message([0]), curves);
const seen = [[0.1, 0.5], [0.02, 0.025]].map(([speed, lowest_y]) => {
  graphs.expect({ t: 0, row: { com_vy: -speed, lowest_y } });
  graphs.expect({ t: 3, row: { com_vy: 0, lowest_y: 0 } });
  return [graphs.expected.time, graphs.scaled("force", 0.005).high];
});
console.log(JSON.stringify(seen));"""
    fast, slow = run_in_node(CURVES + code, tmp_path)
    assert 12.8 < fast[0] < 15.0
    assert 0.087 < fast[1] < 0.12
    assert 6.4 < slow[0] < 10.0
    assert 0.0148 < slow[1] < 0.03


@pytest.mark.parametrize("names", [FILM, (*DRAWING, *SANDBOX)])
def test_the_modules_of_a_page_have_no_name_in_common(tmp_path, names):
    # `bundle` joins them into one scope, in which a second constant is an error
    script = tmp_path / "page.mjs"
    script.write_text(bundle(*names), encoding="utf-8")
    subprocess.run(["node", "--check", script], check=True)
