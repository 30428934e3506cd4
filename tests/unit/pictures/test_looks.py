"""What pictures, films and figures show: words, marks, curves and colours, compared
with recordings (see shown.py).

Runs are formulae, letters have one width, and the graphics card is a sheet that notes
what is drawn on it, so nothing else changes these texts.
"""

from dataclasses import replace
from itertools import groupby, product
from operator import itemgetter
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from bodies import painter
from matplotlib.backends import backend_agg
from PIL import Image, ImageDraw
from programs import packed
from scipy.spatial import cKDTree
from shown import colours, digest, number, numbers, of_figure, of_lines, short

from taichi_disk import load_scene
from taichi_disk.base.progress import silent
from taichi_disk.experiments.computation.driver import State
from taichi_disk.experiments.computation.outcome import Outcome
from taichi_disk.mechanics.fields import Triangles
from taichi_disk.mechanics.lattice import Lattice, OwnStart
from taichi_disk.mechanics.physics import Springs
from taichi_disk.mechanics.simulation.observables import COLUMNS
from taichi_disk.pictures.panel import PanelPictures, draw_panel
from taichi_disk.pictures.plot import plot_scene, run_figure
from taichi_disk.pictures.render import (
    film,
    finisher,
    painter as painting,
    pictures,
    words,
)
from taichi_disk.pictures.render.artist import Artist
from taichi_disk.pictures.render.geometry import Camera
from taichi_disk.pictures.render.letters import LEAST, Face, Letters
from taichi_disk.pictures.render.moments import Caption, Span
from taichi_disk.pictures.render.panel import panel_scene
from taichi_disk.pictures.render.pictures import Disk, arranged
from taichi_disk.pictures.render.recording import Flight
from taichi_disk.pictures.render.state_figure import draw_state
from taichi_disk.pictures.render.words import (
    Scales,
    Title,
    caption_lines,
    fitting_letters,
)
from taichi_disk.pictures.web.drawing import colour_values, scene_message
from taichi_disk.pictures.web.film import write_page
from taichi_disk.studies.figures.curves import analyse
from taichi_disk.studies.figures.drawing import figure_to_change
from taichi_disk.studies.figures.texts import curve_rows

SMALL = ("lattice.points=41", "lattice.seed=3")
THROW = (*SMALL, "impact.velocity=0.05", "impact.gap=0.1", "material.eta_star=5")


@pytest.fixture(autouse=True)
def one_width(monkeypatch):
    monkeypatch.setattr(Face, "width", lambda face, text: 0.55 * face.size * len(text))


def invented(name, *settings):
    """Return a run of a scene whose states and columns are formulae."""
    scenario = load_scene(name, settings).scenario()
    lattice = scenario.lattice
    n = lattice.disk_points
    rest = lattice.positions
    middle = lattice.mean(rest)
    first, last = 3.0, 9.0
    if scenario.static:
        first, last = 0.0, 1.0
    elif scenario.is_thrown and scenario.scene.impact.spin:
        first = 4.0

    def pressed(t):
        """Return how far the contact has come, 0 to 1, and how strong it is."""
        part = np.clip((t - first) / (last - first), 0.0, 1.0)
        if not scenario.is_thrown:
            return part, part
        return part, 3.0 / first * np.sin(np.pi * part) ** 2

    def state(t):
        part, strength = pressed(t)
        x = rest.copy()
        arm = rest[:n] - middle
        wave = 0.004 * np.sin(3.0 * t + np.arange(n))[:, None] * [1.0, 0.5]
        x[:n] += strength * arm * [0.01, -0.02] + strength * wave
        # above the wall, in whose haze forces are no larger than `largest_force`
        height = 0.055 - 0.005 * strength + 0.05 * max(first - t, 0.9 * (t - last), 0.0)
        x[:n] += [0.01 * t, height - x[:n, 1].min()]
        v = np.zeros_like(x)
        v[:n] = [0.01, 0.05 * (1.9 * part - 1.0)] + 0.3 * wave
        return State(float(t), x, v)

    t = np.linspace(0.0, 12.0, 121)
    if scenario.static:
        t = np.linspace(1.0 / 24.0, 1.0, 24)
    part, strength = pressed(t)
    columns = {column.name: np.zeros(len(t)) for column in COLUMNS}
    columns |= {"t": t, "com_vx": 0.01 + 0.0 * t, "com_vy": 0.05 * (1.9 * part - 1.0)}
    columns["angular_momentum"] = 1e-3 * part
    columns["com_y"] = [lattice.mean(state(one).positions)[1] for one in t]
    columns["lowest_y"] = [state(one).positions[:n, 1].min() for one in t]
    columns["wall_force"] = 0.03 * strength
    columns["xi"] = 0.02 * strength
    columns["residual"] = 1e-3 * 0.1**t
    columns["elastic"] = 1e-3 * strength
    if scenario.is_thrown:
        columns["elastic"] += 2e-5 * (part == 1.0)  # the disk rings
    columns["wall"] = 2e-4 * strength
    columns["load"] = 5e-4 - 4e-4 * part
    columns["translation"] = 0.5 * (columns["com_vy"] ** 2 + 1e-4)
    columns["rotation"] = 1e-5 * part
    columns["vibration"] = 1e-4 * part * (1.0 + np.sin(t))
    parts = ("translation", "rotation", "vibration")
    columns["kinetic"] = sum(columns[name] for name in parts)
    columns["dissipated"] = 3e-4 * np.minimum(1.1 * part, 1.0)
    columns["total"] = 1.3e-3 + 1e-7 * t
    return Outcome(
        scenario=scenario,
        series={name: np.array(values) for name, values in columns.items()},
        positions=state(t[-1]).positions,
        velocities=state(t[-1]).velocities,
        largest_force=0.1,
        replay=lambda times: map(state, times),
        frames=lambda times: map(state, times),
        summary={},
    )


def video(**keys):
    settings = [f"video.{key}={value}" for key, value in keys.items()]
    return load_scene("exponential_wall", settings).video


# ---- films


class Sheet:
    """A window of GGUI, its canvas, and notes of what was drawn, where [R]."""

    is_soft = True

    def __init__(self, size, notes):
        self.size = size
        self.notes = notes
        self.canvas = self
        self.camera = None

    def get_canvas(self):
        return self

    def set_background_color(self, colour):
        self.notes.append(f"ground {colour}")

    def _note(self, kind, vertices, indices, size):
        width, height = self.size
        place = self.camera.to_scene(vertices[:, :2] * [width, -height] + [0.0, height])
        text = f"{kind} {numbers([height * size])} at {digest(place)}"
        text += f" colour {digest(255.0 * vertices[:, 8:12])}"
        if vertices[:, 3:6].any():
            text += f" soft {digest(vertices[:, 3:6])}"
        if indices is not None:
            text += f" corners {digest(indices)}"
        self.notes.append(text)

    def triangles(self, vertices, indices, *_):
        self._note("triangles", vertices, indices, 0.0)

    def lines(self, vertices, indices, has_colours, colour, width):
        self._note("lines", vertices, indices, width)

    def circles(self, vertices, has_colours, has_radii, colour, radius):
        self._note("circles", vertices, None, radius)

    def get_image_buffer_as_numpy(self):
        # GGUI's image: x, y upwards, colour
        width, height = self.size
        across = np.linspace(0.2, 0.8, width)[:, None]
        upwards = np.linspace(0.1, 0.9, height)
        layers = [across + 0.0 * upwards, upwards + 0.0 * across, across * upwards]
        image = np.stack([*layers, np.ones((width, height))], axis=2)
        return np.rint(255.0 * image).astype(np.float32) / np.float32(255.0)

    def destroy(self):
        self.notes.append("closed")


def of_picture(picture, across):
    """Yield the size of a picture, and the mean colours of its square tiles."""
    height, width, _ = picture.shape
    yield f"  {width} x {height}"
    size = -(-width // across)
    for top in range(0, height, size):
        tiles = [
            picture[top : top + size, left : left + size].mean(axis=(0, 1))
            for left in range(0, width, size)
        ]
        yield "  " + " | ".join(" ".join(f"{c:.0f}." for c in one) for one in tiles)


FILMS = {
    "comparison": (
        [
            "exponential_wall impact.spin=0.2 wall.friction=0.2",
            "exponential_wall impact.spin=0.1 wall.friction=0.2",
        ],
        {"size": 480, "seconds": 0.3, "theme": "dark", "colour": "strain"}
        | {"draw": "springs", "supersample": 1.5},
    ),
    "loading": (
        ["compression compression.method=newton"],
        {"size": 360, "seconds": 0.3, "colour": "fringes", "words": "few"},
    ),
    "elastic_wall": (
        ["absorbing_wall wall.points=60 wall.width=3"],
        {"size": 480, "seconds": 0.3, "colour": "strain", "draw": "points"}
        | {"text": 1.85},  # letters too large for a panel
    ),
}


@pytest.mark.parametrize("name", FILMS)
def test_a_film(name, tmp_path, monkeypatch, record):
    scenes, keys = FILMS[name]
    notes = []
    texts = []  # of another thread
    panels = []
    runs = []
    for each in scenes:
        kind, *settings = each.split()
        common = SMALL if kind == "compression" else THROW
        runs.append(invented(kind, *common, *settings))
    paint = painting.Painter.paint

    def noted(drawer, canvas, camera, *state):
        canvas.camera = camera
        paint(drawer, canvas, camera, *state)

    def draw_panel(scene):
        panels.append(scene)
        width, height = scene.size
        coming = np.full((height, width, 4), 180, dtype=np.uint8)
        boxes = [(60, width - 20, 40, 100), (60, width - 20, 140, 200)]
        return PanelPictures(coming, coming // 2, boxes)

    def place(pixels):
        # in hundredths of the picture's height, which may differ by two
        return " ".join(
            f"{100.0 * one / keys['size']:.0f}." for one in np.ravel(pixels)
        )

    def letters(at, text, fill, font, anchor):
        style = f"{anchor} {' '.join(font.getname())} {fill}"
        texts.append((style, f"{text!r} at {place(at)}"))

    def stamp(image, mark, ground, columns):
        ends = mark.corners.min(axis=(0, 1)), mark.corners.max(axis=(0, 1))
        texts.append(("mark", f"{mark.ink} {number(mark.rim)} at {place(ends)}"))

    pen = SimpleNamespace(Draw=lambda image: SimpleNamespace(text=letters))
    monkeypatch.setattr(finisher, "ImageDraw", pen)
    monkeypatch.setattr(finisher, "stamp", stamp)
    monkeypatch.setattr(finisher, "draw_panel", draw_panel)
    monkeypatch.setattr(words, "stamp", stamp)
    monkeypatch.setattr(painting, "get_field_info", lambda array: array)
    monkeypatch.setattr(painting.Painter, "paint", noted)
    monkeypatch.setattr(Artist, "require_film", lambda artist: None)
    monkeypatch.setattr(pictures, "open_window", lambda size: Sheet(size, notes))
    look = video(fps=10, **keys)
    film.draw_film(tmp_path / "film", runs, look, silent, Artist())
    for style, words_alike in groupby(texts, itemgetter(0)):
        notes.append(f"{style}: {'; '.join(text for _, text in words_alike)}")
    for path in sorted((tmp_path / "film").iterdir()):
        notes += [path.stem, *of_picture(np.asarray(Image.open(path)), 4)]
    for scene in panels:
        notes += [f"panel {scene.size} {scene.letter} {scene.labels}", digest(scene.t)]
        for curve in scene.curves:
            look = curve.look
            colour = look.colours[scene.ground]
            shown = f"{look.panel} {curve.name} {colour} {look.style}"
            notes.append(f"  {shown} {digest(curve.values)}")
    record(name, dict.fromkeys(notes))


@pytest.mark.parametrize(
    ("settings", "flies"),
    [
        (("material.eta_star=0", "impact.spin=0.1"), True),
        (("impact.spin=0.1",), False),
        (("impact.spin=0.1", "material.dashpot=axial"), True),
        ((), True),
    ],
)
def test_a_disk_flies_before_the_run_only_if_it_would_keep_its_spin(settings, flies):
    run = invented("exponential_wall", *THROW, *settings)
    flight = Flight.of(run, 0.33)
    assert (flight.start < 0.0) == flies
    thrown_by_hand = replace(run.scenario, own=OwnStart(None, np.ones((41, 2))))
    assert Flight.of(replace(run, scenario=thrown_by_hand), 0.33).start == 0.0
    if flies:
        _, x, v = next(flight.frames(np.array([flight.start])))
        lattice = run.scenario.lattice
        # The run begins where the flight leads, as a rigid body.
        moved = lattice.mean(x) - flight.start * lattice.mean(v)
        assert moved == pytest.approx(lattice.mean(lattice.positions), abs=1e-9)
        arms = [one - lattice.mean(one) for one in (x, lattice.positions)]
        now, rest = (arm @ [1.0, 1.0j] for arm in arms)
        angle = run.scenario.scene.impact.spin * flight.start
        assert now == pytest.approx(np.exp(1.0j * angle) * rest, abs=1e-9)


# ---- words and marks


LONG = Title(
    "Impact on an elastic wall with friction",
    ("v = 0.1 c", "η* = 0", "a = 300/R", "a wall that resets every 0.003 R/c"),
    ("displacements × 2",),
)
CAPTIONS = [
    Caption(-14.12, lines=("before t = 0", "−0.78 v")),
    Caption(2.05, "greatest compression", (), ("t = 2.05 R/c", "0.00 v")),
    Caption(4.35, lines=("t = 4.35 R/c", "+0.93 v"), result="e = 0.9672"),
]


def clashes(lines, width):
    """Return lines that are too small, or not in the picture, or touch another."""
    found = []
    for k, line in enumerate(lines):
        left, right, top, bottom = line.box
        if line.face.size < LEAST or left < 0.0 or right > width:
            found.append(line)
        for first, last, high, low in (other.box for other in lines[k + 1 :]):
            apart = max(first - right, left - last, high - bottom + 3, top - low + 3)
            if apart < 0.0:
                found.append(line)
    return found


@pytest.mark.parametrize(("size", "colour"), [(200, "shear"), (240, "fringes")])
def test_words_of_pictures(size, colour, record):
    drawer = painter(colour=colour)
    outer = [np.array([[-1.4, 2.2], [1.4, 2.2]])]  # the disk reaches the corners
    heading = replace(LONG, heading="lattice.min_spacing = 3", enlarged=1.5)
    disks = [
        Disk(drawer, LONG, CAPTIONS, outer),
        Disk(drawer, heading, CAPTIONS, [0.1 * outer[0]]),
    ]
    letters = fitting_letters(Letters(size, 1.0), [CAPTIONS], size)
    camera, legends = arranged(disks, size, letters, (-1.5, 1.5, 0.0, 2.4))
    scales = Scales(drawer, 2 * size, letters, camera.scale)
    pace = ("1 s = 5.3 R/c", "slowed 5 times")
    notes = [f"camera {numbers([camera.scale, *camera.middle])}"]
    notes[0] += f" heading {number(letters.heading.size)} footer {letters.footer}"
    for legend in legends:
        notes.append("; ".join(of_lines(legend.lines, letters, letters.heading.size)))
    notes += of_lines(scales.lines, letters)
    notes += of_lines(scales.pace_lines(pace), letters)
    for caption in CAPTIONS:
        changing = caption_lines(letters, caption, size)
        notes.append("; ".join(of_lines(changing, letters, letters.heading.size)))
        assert not clashes([*legends[0].lines, *changing], size)
    assert not clashes([*scales.lines, *scales.pace_lines(pace)], 2 * size)
    below = np.zeros((letters.footer + 2, 2 * size, 4), np.uint8)
    picture = Image.fromarray(below)
    scales.draw(below, picture, ImageDraw.Draw(picture))
    notes += of_picture(below[: letters.footer // 2, :, :3], 8)
    record(f"words_{size}_{colour}", dict.fromkeys(notes))


def test_marks_above_the_disk(record):
    drawer = painter(
        theme="dark", magnify=2.0, full_speed=0.1, spoke=0, edge=0.02, full_force=0.02
    )
    x = drawer.lattice.positions * [1.1, 0.9] + [0.0, -0.08]
    x = np.maximum(x, [-9.0, 0.05])  # flat below
    camera = Camera.fit((-1.3, 1.2, -0.1, 2.3), 400, 360, (0.0, 400.0, 10.0, 350.0))
    notes = []
    for unit, speed in ((0.5, -0.05), (2.0, 0.1), (1.0, 1e-4)):
        v = np.full_like(x, speed) * [0.3, 1.0]
        for mark in drawer.marks(camera, x, v, drawer.placed(x), unit):
            place = digest(camera.to_scene(mark.corners))
            notes.append(f"{mark.ink} rim {number(mark.rim)} {place}")
    record("marks", notes)


def test_the_values_of_colours(record):
    record("colours", [" ".join(one).replace("#", "") for one in colours()])


def crossed():
    """Return squares of points with both diagonals, of which one is in no triangle, and
    a core of stiffer springs."""
    line = np.arange(-4.0, 5.0) / 4.0
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    near = cKDTree(grid).query_pairs(0.36, output_type="ndarray")
    squares = np.arange(81).reshape(9, 9)[:-1, :-1].reshape(-1, 1)
    halves = np.concatenate([squares + [0, 1, 10], squares + [0, 10, 9]])
    stiffness = 1.0 + (np.abs(grid[near]).max(axis=(1, 2)) < 0.6)
    return Lattice.from_points(grid, near, triangles=halves, stiffness=stiffness)


BODIES = {"crossed": crossed, "fine": lambda: Lattice.disk(3000, 0)}


@pytest.mark.parametrize("body", BODIES)
def test_springs_on_fields(body, monkeypatch, record):
    monkeypatch.setattr(painting, "get_field_info", lambda array: array)
    lattice = BODIES[body]()
    camera = Camera.fit((-1.1, 1.1, -1.1, 1.1), 360, 360, (0.0, 360.0, 0.0, 360.0))
    notes = []
    x = 1.01 * lattice.positions
    for draw in ("both", "field", "springs", "points"):
        for is_soft in (True, False)[: 1 + (draw == "both")]:
            drawer = painting.Painter(lattice, Springs(), draw=draw, limit=0.02)
            sheet = Sheet((360, 360), notes)
            sheet.camera = camera
            drawer.paint(sheet, camera, x, 0.0 * x, x, 0.5, is_soft)
    record(f"springs_{body}", dict.fromkeys(notes))


# ---- figures of Matplotlib


def seen(monkeypatch):
    """Return a list of the figures that are drawn from now on."""
    figures = []
    canvas = backend_agg.FigureCanvasAgg

    def noting(figure):
        figures.append(figure)
        return canvas(figure)

    monkeypatch.setattr(backend_agg, "FigureCanvasAgg", noting)
    return figures


RUNS = {
    "impact": ("exponential_wall", *THROW),
    "oblique": ("absorbing_wall", *THROW, "wall.points=60", "impact.spin=0.1"),
    "loading": ("compression", *SMALL, "compression.method=newton"),
    "relaxation": ("compression", *SMALL, "compression.method=relaxation"),
}


def test_plots(record):
    notes = {}  # each line once, so that other runs have what differs
    for name in ("oblique", "loading", "relaxation"):
        found = invented(*RUNS[name])
        figure = run_figure(plot_scene(found.scenario, found.series), "e = 0.97 ± 0.01")
        notes |= dict.fromkeys([name, *of_figure(figure)])
    record("plots", notes)


def test_a_panel_beside_a_film(monkeypatch, record):
    figures = seen(monkeypatch)
    drawn = draw_panel(
        panel_scene(invented(*RUNS["oblique"]), Letters(600, 1.4, "dark"))
    )
    record("panel", [*of_figure(figures[0]), f"{drawn.boxes}"])


V = np.geomspace(3e-3, 5e-2, 9)
THROWS = ["eta_star", "seed", "velocity"]
SWEEPS = {  # scene, axes, values of eta*, number of lattices
    "restitution": ("exponential_wall", THROWS, (0.0, 5.0, 30.0), 6),
    "compression": ("compression", ["seed", "pressure"], (0.0,), 2),
    "over_points": ("exponential_wall", ["points"], (0.0,), 1),
}


def rows_of(damping, lattices):
    """Return rows of a sweep whose results are formulae."""
    rows = []
    for seed, (k, v), eta in product(range(lattices), enumerate(V), damping):
        e = 0.9 - 0.01 * k * k * v - (0.003 + 1e-3 * seed) * eta * np.sqrt(v)
        xi = v * (1.0 + 0.01 * seed - 0.3 * np.log(v))
        row = {"status": "done", "young": 1.1, "poisson": 0.3, "contact_time": 6.0}
        row |= {"velocity": v, "pressure": v, "points": 100 * (k + 1), "seed": seed}
        row |= {"eta_star": eta, "restitution": e, "xi": xi}
        rows.append(row | {"xi_nominal": 1.1 * xi, "xi_extrapolated": 0.0})
    return rows


@pytest.mark.parametrize("name", SWEEPS)
def test_figures_of_sweeps(name, record):
    kind, axes, *numbers_of_rows = SWEEPS[name]
    scene = load_scene(kind)
    homes = {name: scene.homes(name)[0] for name in axes}
    diagram = analyse(scene, homes, rows_of(*numbers_of_rows))
    notes = list(of_figure(figure_to_change(diagram)))
    summaries = [curve.summary() for curve in diagram.curves[:2]]
    rows = [*map(str, curve_rows(summaries))]
    for summary in summaries:
        fits = summary.pop("fits")
        notes += of_json(summary)
        notes += [f"  {name}: {short(fit)}" for name, fit in fits.items()]
    notes += rows
    record(f"sweep_{name}", notes)


@pytest.mark.parametrize(
    ("name", "colour"), [("impact", "fringes"), ("oblique", "pressure")]
)
def test_states_on_axes(name, colour, record):
    run = invented(*RUNS[name])
    figure = draw_state(run, video(colour=colour), "greatest")
    record(f"state_{name}_{colour}", of_figure(figure))


# ---- pages


def of_json(value):
    style = {"width": 10_000, "allow_unicode": True, "sort_keys": False}
    return yaml.safe_dump(short(value), **style, default_flow_style=None).splitlines()


TYPES = {"centres": "<f4", "velocities": "<f4", "forces": "<f4"}


def test_a_sandbox_begins_unmagnified_and_its_springs_have_their_own_values():
    scenario = load_scene("exponential_wall", SMALL).scenario()
    message = scene_message(scenario, scenario.scene.video, scenario.point_force)
    assert message["options"]["magnify"] == 1.0
    lattice = scenario.lattice
    state = 1.01 * lattice.positions, scenario.velocities
    for name, n in (("strain", len(lattice.bonds)), ("speed", 41)):
        values = colour_values(
            name, Triangles(lattice), scenario.model.springs, *state, of_springs=True
        )
        assert len(values) == n


def test_films_that_are_pages(tmp_path, record):
    look = video(fps=10, seconds=4.3, theme="dark", colour="strain")
    path = tmp_path / "film.html"
    span = Span(start="contact", end="end")
    write_page(path, [invented(*RUNS["impact"])], look, silent, span)
    head, data = packed(path)
    (run,) = head["runs"]
    run["captions"] = [run["captions"][k] for k in (0, 12, 20, -1)]
    curves = "; ".join(str([*short(one).values()]) for one in head.pop("curves"))
    for key in ("quantities", "themes"):  # of any scene: they are among messages
        del run["scene"][key]
    limits = short(run.pop("limits"))
    arrays = {}
    for key, (first, count) in run["arrays"].items():
        assert first % 4 == 0  # as JavaScript wants it
        array = np.frombuffer(data, TYPES.get(key, "u1"), count, first)
        arrays[key] = digest(array)
    notes = [*of_json(head), str(limits), curves, str(arrays)]
    record("pages_of_films", notes)
