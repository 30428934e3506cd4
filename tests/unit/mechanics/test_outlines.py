"""Bodies by their outlines: what is filled, and that everything else is refused."""

import math
import re

import numpy as np
import pytest
import shapely

from taichi_disk.base.errors import InputError
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.lattice.triangles import double_area

TURN = np.arange(200) / 200.0 * 2.0 * math.pi
CIRCLE = np.column_stack([np.cos(TURN), np.sin(TURN)])
SPOKES = np.where(np.arange(10) % 2, 0.5, 1.0)[:, None]
STAR = SPOKES * CIRCLE[::20] @ [[0.0, 1.0], [-1.0, 0.0]]
ELL = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]])
NOISE = 1.0 + 0.01 * np.random.default_rng(1).standard_normal((80, 1))
MEASURED = CIRCLE[np.arange(80) * 200 // 80] * [1.2, 0.9] * NOISE
SHAPES = {
    "circle": 37.5 * CIRCLE + [500.0, -20.0],
    "star": STAR,
    "L": ELL,
    "ring": [CIRCLE, 0.5 * CIRCLE],
    "measured": MEASURED,
    "fine": (1.0 + 1e-3 * np.sin(900.0 * np.linspace(0, 6.2832, 10_000)))[:, None]
    * np.column_stack([f(np.linspace(0.0, 6.2832, 10_000)) for f in (np.cos, np.sin)]),
}


def svg(content):
    return f'<svg xmlns="http://www.w3.org/2000/svg">{content}</svg>'


def polygon_of(shape):
    if isinstance(shape, list):
        return shapely.Polygon(shape[0], shape[1:])
    return shapely.Polygon(shape)


def polar_moment(polygon, centre):
    """Return the mean squared distance from `centre` over a polygon, by triangles."""
    parts = shapely.get_parts(shapely.delaunay_triangles(polygon.segmentize(0.05)))
    inside = [one for one in parts if polygon.contains(one.centroid)]
    moment = 0.0
    for one in inside:
        corner = np.array(one.exterior.coords)[:3] - centre
        sides = 0.5 * (corner + np.roll(corner, 1, axis=0))  # exact for squares
        moment += one.area * (sides**2).sum(axis=1).mean()
    return moment / sum(one.area for one in inside)


@pytest.mark.parametrize("name", SHAPES)
def test_the_body_has_area_centroid_and_polar_moment_of_its_outline(name):
    polygon = polygon_of(SHAPES[name])
    unit = math.sqrt(polygon.area / math.pi)
    body = Lattice.outline(SHAPES[name], 1099)
    area = 0.5 * double_area(body.positions[body.triangles]).sum()
    assert len(body.masses) == 1099
    assert area == pytest.approx(math.pi, rel=0.01)
    assert np.abs(body.mean(body.positions)).max() < 0.02
    if len(polygon.exterior.coords) < 1000:
        centre = np.array(polygon.centroid.coords[0])
        # a point on the edge has a whole mass, but only half of the area of the others
        edge = shapely.get_coordinates(polygon.boundary.segmentize(1e-3 * unit))
        on_edge = ((edge - centre) ** 2).sum(axis=1).mean()
        half = 0.5 * polygon.length / unit / body.rest_lengths.mean() / 1099
        moment = (1.0 - half) * polar_moment(polygon, centre) + half * on_edge
        assert body.inertia == pytest.approx(moment / unit**2, rel=0.02)
    assert f"1 R = {unit:.4g} units of the outline" in body.notes
    assert body.whole == (name != "ring")


def test_corners_are_points_and_sides_are_springs():
    body = Lattice.outline(STAR, 400)
    unit = math.sqrt(shapely.Polygon(STAR).area / math.pi)
    gaps = np.abs(body.positions[:, None] - STAR / unit).sum(axis=2).min(axis=0)
    assert gaps.max() < 1e-12
    ring = shapely.Polygon(body.positions[body.disk_surface])
    assert ring.symmetric_difference(shapely.Polygon(STAR / unit)).area < 1e-9


def test_the_way_round_and_repeated_points_do_not_matter():
    usual = Lattice.outline(ELL, 200, seed=3).positions
    twice = np.repeat(np.roll(ELL, 2, axis=0)[::-1], 2, axis=0)
    closed = np.concatenate([ELL, ELL[:1]])
    rounded = twice + 1e-9 * np.random.default_rng(0).normal(size=twice.shape)
    for same in (twice, closed, rounded):
        assert np.abs(Lattice.outline(same, 200, seed=3).positions - usual).max() < 1e-7
    assert (Lattice.outline(ELL, 200, seed=3).positions == usual).all()
    assert not (Lattice.outline(ELL, 200, seed=4).positions == usual).all()


def test_contours_of_opencv_or_of_several_bodies_are_refused_by_their_shape():
    for contour in (ELL[:, None], [ELL[:, None]], [[ELL, ELL[:4]], [ELL + 9]]):
        with pytest.raises(InputError, match="points must be an array of "):
            Lattice.outline(contour, 200)


def test_a_drawing_gives_the_body_of_its_points(tmp_path):
    path = tmp_path / "l.svg"
    # y points downwards; a group, a view box, words and what is hidden do not matter
    ways = "visibility='hidden'", "fill='none'", "opacity='0'", "fill-opacity='0'"
    hidden = "".join(f'<path {way} d="M0 0h9v9"/>' for way in ways)
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="90mm" height="90mm"'
        f' viewBox="0 0 30 30">{hidden}<text>L</text>'
        '<g transform="translate(5 30) scale(1 -1)"><path d="M0 0h3v1h-2v2h-1z"/></g>'
        '<g style="display:none"><path d="M0 0h30v30z"/></g></svg>'
    )
    drawn = Lattice.outline(path, 200)
    assert drawn.origin == "l.svg, seed 0"
    unit = math.sqrt(5.0 / math.pi)
    assert drawn.notes == (f"1 R = {unit:.4g} units of the outline",)
    corner = ELL / unit - np.array(shapely.Polygon(ELL).centroid.coords) / unit
    gaps = np.abs(drawn.positions[:, None] - corner).sum(axis=2).min(axis=0)
    assert gaps.max() < 1e-9
    size = ' width="1.7ex" height="1.7ex" viewBox="0 0 9 9">'  # as of a formula
    path.write_text(svg('<circle r="1em"/><circle r="8"/>').replace(">", size, 1))
    ring = Lattice.outline(path, 300)
    assert not ring.whole and ring.notes == ("1 R = 13.86 units of the outline",)
    path.write_text(svg('<path d="M40 0A40 40 0 1 1 40-.01Z" transform="skewX(30)"/>'))
    assert Lattice.outline(path, 300).notes == ("1 R = 40 units of the outline",)
    path.write_text(svg('<path d="M0 0C200 150-200 150 0 0"/>'))  # one curve
    unit = float(Lattice.outline(path, 300).notes[0].split()[3])
    assert math.pi * unit**2 == pytest.approx(0.15 * 200 * 2 * 150, rel=2e-3)


FAULTS = {
    "open.svg": (svg('<path d="M0 4A4 4 0 0 1 8 4"/>'), "open from (8, -4) to (0, -4)"),
    "open.csv": (
        "\n".join(f"{k},{k * k / 90}" for k in range(90)),
        "join it to the next piece, close it, or remove it",
    ),
    "map.csv": (  # metres of a map
        "458000.1,5432100.2\n458009,5432109\n458009,5432100\n458000,5432109",
        "self-intersection at (458004.47, 5432104.5); its points go round the body",
    ),
    "frame.svg": (svg('<path d="M0 0h99v99h-99zM1 1h97v97h-97z"/>'), "extend over 8"),
    "touching.svg": (svg('<path d="M0 0H60V60H0ZM0 30L20 20V40Z"/>'), "a hole touches"),
    "two.svg": (svg('<circle r="4"/><circle cx="9" r="4"/>'), "shell at (4, 0)"),
    "three.svg": (svg('<circle r="9"/><circle r="6"/><circle r="4"/>'), "nested at ("),
    "clip.svg": (svg('<g clip-path="url(#a)"><circle r="9"/></g>'), "has a clip-path"),
    "root.svg": (svg("<g/>").replace(" ", " clip-path='a' ", 1), "a clip-path"),
    "empty.svg": (svg(""), "no path is visible"),
    "turned.svg": (svg('<rect style="transform-origin:9px"/>'), "a transform-origin"),
    "mask.svg": (svg('<circle r="9" style="mask:url(#a)"/>'), "a path has a mask"),
    # In a viewer, the first is solid, and the hole of the second is in the middle.
    "symbol.svg": (
        svg('<rect width="9" height="9"/><symbol><circle r="2"/></symbol>'),
        "a path is inside of <symbol>",
    ),
    "nested.svg": (
        svg('<circle r="9"/><svg x="-1" y="-1"><rect width="2" height="2"/></svg>'),
        "a path is inside of <svg>",
    ),
    "stretched.svg": (
        '<svg xmlns="http://www.w3.org/2000/svg" width="20" height="9" viewBox='
        '"0 0 9 9" preserveAspectRatio="none"><circle r="4"/></svg>',
        "its view box is stretched",
    ),
    "tips.csv": ("0,0\n9,0\n9,9\n0,9\n4,1", "too thin: round it off"),
    "words.svg": (svg("<text>body</text>"), "words and images must be made paths"),
    "empty.csv": ("x,y\n", "it has no points (x | y)"),
    "pair.csv": ("0,0\n1,0\n0,0", "n from 3 to 2000000, not (2, 2)"),
    "dot.csv": ("1,1\n1,1\n1,1", "too few points in geometry component at (1, 1)"),
    "path.svg": ('<path d="M0 0h9v9z"/>', "is a part of a drawing: write <svg> "),
    "line.csv": ("0,0\n1,0\n2,0", "not the edge of one body"),
    "broken.svg": ("<svg><path d=", "unclosed token"),
    "part.dxf": ("0\nSECTION", "is a drawing (.svg) or a table (.csv): save it so"),
    "neck.svg": (
        svg('<path d="M0 0h4v2.8h2v-2.8h4v6h-4v-2.8h-2v2.8h-4z"/>'),
        "at (4.8, -2.8) the body, a hole or a notch is too thin: round",
    ),
    "notch.svg": (svg('<path d="M0 0H40V40H43V0H80V80H0Z"/>'), "at (40, -40) the body"),
    "dot.svg": (svg('<circle r="9"/><circle r=".3"/>'), "too thin: round it off"),
    "stray.svg": (svg('<circle r="9"/><path d="M5 5z"/>'), "component at (5, -5)"),
    "tip.csv": ("0,0\n.4,.01\n.4,.2\n.2,.2\n.2,.03\n0,.02", "too thin: round"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_faulty_file_gets_a_sentence(tmp_path, name):
    content, sentence = FAULTS[name]
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(InputError) as error:
        Lattice.outline(path, 300)
    text = str(error.value)
    assert text.startswith(f"lattice.outline: {path}: ") and sentence in text


@pytest.mark.parametrize("name", ["neck.svg", "notch.svg", "dot.svg"])
def test_the_number_of_points_that_it_names_will_do(tmp_path, name):
    path = tmp_path / name
    path.write_text(FAULTS[name][0])
    with pytest.raises(InputError) as error:
        Lattice.outline(path, 300)
    enough = int(re.findall("some (.+) points", str(error.value))[0].replace(",", ""))
    assert 300 < len(Lattice.outline(path, enough).masses) < 40_000
    with pytest.raises(InputError):
        Lattice.outline(path, enough // 2)
