"""Whether what a sweep concludes is true: how often the 95 % intervals of a fit contain
the parameters, and how often a law is refuted that holds, or one that does not.

    python -m tests.validation.laws_trial [--lattices 150] [--draws 1000]

The program computes a population of small lattices, about half a minute, and draws
sweeps of a few lattices from it. Appendix F of docs/numerics.md has the extremes.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from tempfile import TemporaryDirectory

import numpy as np

from taichi_disk import load_sweep, run_sweep
from taichi_disk.mechanics.lattice import Array
from taichi_disk.studies.figures.curves import analyse
from taichi_disk.studies.figures.theory import fit_restitution, paper_restitution

SPEEDS = np.geomspace(3e-3, 5e-2, 12)  # [c]
LAW = {"d1": 1.02, "d2": 0.3}  # of the synthetic draws
NOISE = 2e-3
COUNTS = (5, 8, 16, 32)  # of lattices in a sweep
PARAMETERS = ("d1", "d2")


def population(lattices):
    """Return e (lattices, speeds) on a wall so hard that eq. (5) does not hold."""
    scene = {
        "scene": "exponential_wall",
        "lattice": {"points": 60},
        "wall": {"a": 3000.0},
        "material": {"viscosity": 0.0091},
        "sweep": {"seed": {"range": lattices}, "velocity": SPEEDS.tolist()},
    }
    with TemporaryDirectory() as folder:
        swept = run_sweep(load_sweep(scene), folder, jobs=1)
    (curve,) = analyse(swept.sweep.scenes[0], swept.sweep.axes, swept.rows).curves
    return curve.y


@dataclass(frozen=True)
class Source:
    """Sweeps that are drawn at random: `draw` maps a generator and a number of lattices
    to e (lattices, speeds), `true` are the parameters of eq. (5) fitted to its mean."""

    name: str
    draw: Callable[[np.random.Generator, int], Array]
    true: dict[str, float]


def synthetic(name, own, common):
    """Return normal scatter about eq. (5): `own` (speeds,) for each speed, and `common`
    for all speeds of a lattice, as parts of NOISE."""
    mean = paper_restitution(SPEEDS, **LAW)

    def draw(random, lattices):
        scatter = own * random.normal(size=(lattices, len(SPEEDS)))
        return mean + NOISE * (scatter + common * random.normal(size=(lattices, 1)))

    return Source(name, draw, LAW)


def sampled(name, e):
    """Return draws, with repetition, from a population e (lattices, speeds)."""

    def draw(random, lattices):
        return e[random.choice(len(e), lattices)]

    return Source(name, draw, fit_restitution(SPEEDS, e).values)


def with_law(e):
    """Return the population moved so that eq. (5) holds for its mean."""
    return e - fit_restitution(SPEEDS, e).residuals


SYNTHETIC = [
    synthetic("independent errors", np.ones(12), 0.0),
    synthetic("errors that grow with speed", np.geomspace(0.1, 1.0, 12), 0.0),
    synthetic("errors half common to a lattice", np.ones(12), 1.0),
    synthetic("errors nearly common", np.full(12, 0.2), 1.0),
]


def fits(source, lattices, draws):
    random = np.random.default_rng(lattices)
    found = []
    for _ in range(draws):
        found.append(fit_restitution(SPEEDS, source.draw(random, lattices)))
    return found


def coverage(source, found):
    """Return how often the intervals of d1 and of d2 contain the true value."""
    fractions = []
    for name in PARAMETERS:
        limits = np.array([fit.intervals[name] for fit in found])
        true = source.true[name]
        contained = (limits[:, 0] <= true) & (true <= limits[:, 1])
        fractions.append(float(contained.mean()))
    return fractions


def refused(found):
    return float(np.mean([fit.is_refuted for fit in found]))


def tables(e, draws):
    """Yield two tables in Markdown, for a population e (lattices, speeds)."""
    true = sampled("this population, moved so that (5) holds", with_law(e))
    false = sampled("this population, for which (5) does not hold", e)
    sources = [*SYNTHETIC, true, false]
    found = {}
    for source in sources:
        for count in COUNTS:
            found[source.name, count] = fits(source, count, draws)
    counts = " | ".join(f"{count} lattices" for count in COUNTS)
    rule = "|---" * (1 + len(COUNTS)) + "|"
    yield f"| intervals of d1, d2 that contain the true value | {counts} |"
    yield rule
    for source in sources:
        cells = []
        for count in COUNTS:
            parts = coverage(source, found[source.name, count])
            cells.append(", ".join(f"{part:.3f}" for part in parts))
        yield f"| {source.name} | {' | '.join(cells)} |"
    yield ""
    yield f"| sweeps that refute (5) | {counts} |"
    yield rule
    for source in sources:
        cells = []
        for count in COUNTS:
            cells.append(f"{100.0 * refused(found[source.name, count]):.1f} %")
        yield f"| {source.name} | {' | '.join(cells)} |"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--lattices", type=int, default=150)
    parser.add_argument("--draws", type=int, default=1000)
    options = parser.parse_args()
    e = population(options.lattices)
    fit = fit_restitution(SPEEDS, e)
    print(f"{len(e)} lattices: e of their mean is off (5) by up to", end=" ")
    print(f"{abs(fit.residuals).max():.4f}, p = {fit.p_value:.1g}\n")
    for line in tables(e, options.draws):
        print(line)


if __name__ == "__main__":
    main()
