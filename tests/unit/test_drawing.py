"""The page's drawing and its fit, run by node: pixels against a plain computation, the
fit against that of sweeps."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taichi_disk.figures.theory import fit_restitution
from taichi_disk.web.drawing import bundle

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


def run_in_node(code: str, folder: Path) -> Any:
    modules = ("html.js", "field.js", "legend.js", "controls.js", "graphs.js")
    script = folder / "script.mjs"
    text = CANVAS + bundle(*modules, "results.js") + code
    script.write_text(text, encoding="utf-8")
    done = subprocess.run(
        ["node", script], capture_output=True, text=True, encoding="utf-8", check=True
    )
    return json.loads(done.stdout)


def drawn(folder: Path, mark: str, fringes: bool = False) -> np.ndarray:
    """Return the pixels (SIZE, SIZE, 4) of the fan with values x/SIZE, y upwards."""
    springs = [[0, 6], [3, 9]]
    code = f"""
const field = new Field({{
  points: 13, triangles: new Uint32Array({np.ravel(FAN).tolist()}),
  springs: new Uint32Array({np.ravel(springs).tolist()}) }});
const map = Uint8Array.from({{ length: 768 }}, (_, k) => Math.floor(k / 3));
field.draw({SIZE}, {SIZE}, {{ positions: Float32Array.from({POINTS.ravel().tolist()}),
  values: Float32Array.from({(POINTS[:, 0] / SIZE).tolist()}),
  marks: [{mark}], colours: map,
  factor: 1, shift: [0, 0], scale: [1, 0], fringes: {json.dumps(fringes)} }});
console.log(JSON.stringify([...field.image.data]));"""
    pixels = np.array(run_in_node(code, folder)).reshape(SIZE, SIZE, 4)
    return pixels[::-1]


def test_triangles_cover_their_body_once_with_interpolated_values(
    tmp_path: Path,
) -> None:
    pixels = drawn(tmp_path, "{ mark: 0 }")
    middle = np.arange(SIZE) + 0.5
    x, y = np.meshgrid(middle, middle)
    distance = np.full(x.shape, np.inf)  # to the nearest side, positive inside
    for a, b in zip(RING, np.roll(RING, -1, axis=0), strict=True):
        along = (b - a) / np.hypot(*(b - a))
        side = along[0] * (y - a[1]) - along[1] * (x - a[0])
        distance = np.minimum(distance, side)
    assert (pixels[distance > 1e-3, 3] == 255).all()
    assert (pixels[distance < -1e-3, 3] == 0).all()
    wanted = 255.0 * x / SIZE
    inside = distance > 1e-3
    assert np.abs(pixels[..., 0] - wanted)[inside].max() < 1.0


def test_fringes_repeat_within_a_triangle(tmp_path: Path) -> None:
    pixels = drawn(tmp_path, "{ mark: 0 }", fringes=True)
    row = pixels[30, 10:50, 0] / 255.0
    x = np.arange(10, 50) + 0.5
    assert np.abs(row - np.sin(np.pi * x / SIZE) ** 2).max() < 0.01


def test_springs_and_points_have_soft_sides_and_their_width(tmp_path: Path) -> None:
    springs = drawn(tmp_path, "{ mark: 1, radius: 1.5 }")
    for across in (springs[:, 15, 3], springs[15, :, 3]):
        assert across.sum() / 255.0 == pytest.approx(3.0, abs=0.02)
        assert across.max() == 255
    points = drawn(tmp_path, "{ mark: 2, radius: 4 }")
    corner = points[22:38, 22:38, 3]  # around the point in the middle
    assert corner.sum() / 255.0 == pytest.approx(np.pi * 4.0**2, rel=0.02)


def test_the_fit_of_eq_5_is_that_of_sweeps(tmp_path: Path) -> None:
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
