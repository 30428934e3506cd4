"""Curves of a sweep: means of a result over lattices, and fits of the laws for its kind
of scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from os.path import commonpath, relpath, sep
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.base.files import Summary
from taichi_disk.experiments.scenes import Scene
from taichi_disk.experiments.scenes.compression import paper_compression
from taichi_disk.experiments.scenes.scene import Home
from taichi_disk.mechanics.lattice import Array
from taichi_disk.runs.api.lattices import half_width_95
from taichi_disk.studies.figures import theory
from taichi_disk.studies.figures.theory import Fit

Row = dict[str, Any]
SEED = ("lattice", "seed")
FOLDED = "turned inside out"  # stands in the warnings of a point


@dataclass(frozen=True)
class Curve:
    """A curve of a figure: results against an axis for several lattices, all other keys
    being equal."""

    label: Row  # values of the other axes
    x: Array  # (points,), for example speeds [c] or pressures [M c^2/R]
    # (lattices, points) of each result, the drawn one first; NaN if there is none
    results: dict[str, Array]
    # E [M c^2/R^2], mean over samples with the seeds of the curve; NaN for lattices
    # from a file
    young: float
    poisson: float  # nu, as for E
    is_damped: bool  # whether there are dashpots
    folded: int  # number of points that are left out of fits, where lattices fold
    fits: dict[str, Fit] = field(default_factory=dict)

    @property
    def y(self) -> Array:
        return next(iter(self.results.values()))

    @property
    def mean(self) -> Array:
        return np.nanmean(self.y, 0)

    @property
    def deviation(self) -> Array:
        """Standard deviations over lattices (points,); NaN for a single lattice."""
        scatter = np.ma.masked_invalid(self.y).std(axis=0, ddof=1)
        return scatter.filled(np.nan)

    @property
    def half_widths(self) -> Array:
        """Half the 95 % intervals of the means (points,); NaN for a single lattice."""
        count = np.isfinite(self.y).sum(axis=0)
        return half_width_95(self.deviation / np.sqrt(count), count)

    @property
    def is_of_words(self) -> bool:
        return self.x.dtype.kind == "U"

    @property
    def lattices(self) -> int:
        return len(self.y)

    def summary(self) -> Summary:
        deviation = None
        half_widths = None
        if self.lattices > 1:
            deviation = _known(self.deviation)
            half_widths = _known(self.half_widths)
        return {
            **self.label,
            "lattices": self.lattices,
            "young": _known(self.young),
            "poisson": _known(self.poisson),
            "x": self.x.tolist(),
            "folded": self.folded,
            "mean": self.mean.tolist(),
            "standard_deviation": deviation,
            "half_width_95": half_widths,
            "fits": {name: _fit_summary(fit) for name, fit in self.fits.items()},
        }


def _fit_summary(fit: Fit) -> Summary:
    return {
        "values": {name: _known(value) for name, value in fit.values.items()},
        "intervals_95": {name: _known(pair) for name, pair in fit.intervals.items()},
        "rms_residual": _known(fit.rms),
        "p_value": _known(fit.p_value),
        "residuals": _known(fit.residuals),
    }


def _known(numbers: ArrayLike) -> Any:
    """Return a number or a list of numbers, with None where there is none: the law
    cannot be fitted, or there is only one lattice."""
    known = np.asarray(numbers).astype(object)
    known[~np.isfinite(numbers)] = None
    return known.tolist()


# ---- laws


Line = tuple[Array, Array]  # x and y


class Law(NamedTuple):
    """A law and the curves to which it can be fitted."""

    title: str
    meaning: str  # of its parameters
    fit: Callable[[Curve], Fit]
    min_points: int = 1  # number of points that a curve needs
    needs_moduli: bool = False  # whether the moduli must be known
    needs_damping: bool = False  # whether there must be dashpots
    # up to which the law is valid [c], or [sqrt(E/M) R] if it needs moduli
    max_speed: float = np.inf
    # how it is drawn: not at all, or as a line with this legend
    line: Callable[[Curve, Fit], Line] | None = None
    style: str = "-"
    legend: str = ""

    def applies(self, curve: Curve) -> bool:
        unit = 1.0
        if self.needs_moduli:
            unit = curve.young**0.5
        # Lattices of files are no sample, which alone could refute a law.
        is_sample = np.isfinite(curve.young)
        if not is_sample or curve.x.max() > self.max_speed * unit:
            return False
        if not curve.y.all():  # a bounce that does not count has e = 0
            return False
        if self.needs_damping and not curve.is_damped:
            return False
        return len(curve.x) >= self.min_points


def eq5(curve: Curve, d1: float, d2: float) -> Line:
    """Return speeds and e of eq. (5), as far as e is at most 1."""
    v = np.geomspace(curve.x.min(), curve.x.max(), 80)
    e = theory.paper_restitution(v, d1, d2)
    return v[e <= 1.0], e[e <= 1.0]


def _eq2(curve: Curve, fit: Fit) -> Line:
    """Return pressures and compressions of eq. (2)."""
    P = np.linspace(curve.x.min(), curve.x.max(), 60)
    return P, paper_compression(P, curve.young, curve.poisson, fit.values["b"])


def _eq4(curve: Curve, fit: Fit) -> Line:
    """Return speeds and e of eq. (4)."""
    predict = theory.quasistatic_curves(tuple(curve.x.tolist()), curve.young)
    return curve.x, predict(np.array([fit.values["tau0"]]))[0]


LAWS = {
    "eq2": Law(
        "eq. (2)",
        "xi = b P/(pi E) {ln(4 pi E R/(b P)) - 1 - nu}; single lattices have b_min"
        " to b_max",
        lambda c: theory.fit_b(c.x, c.y, c.young, c.poisson),
        needs_moduli=True,
        line=_eq2,
        legend="eq. (2), b fitted",
    ),
    "eq2_nominal": Law(
        "eq. (2), xi = |R - R'|",
        "the same b for the xi of the paper",
        lambda c: theory.fit_b(c.x, c.results["xi_nominal"], c.young, c.poisson),
        needs_moduli=True,
    ),
    "eq5": Law(
        "eq. (5)",
        "e = d1 sqrt(1 - d2/sqrt(ln(4 c/v)))",
        lambda c: theory.fit_restitution(c.x, c.y),
        min_points=3,
        max_speed=3.9,
        line=lambda c, fit: eq5(c, **fit.values),
        legend="eq. (5), d₁ and d₂ fitted",
    ),
    "curvature": Law(
        "curvature of e(v)",
        "d²e/d(v/c)² in the slow and in the fast half of the speeds; below 0, e(v) is"
        " concave",
        lambda c: theory.fit_curvature(c.x, c.y),
        min_points=8,
    ),
    "eq4": Law(
        "eq. (4) integrated",
        "tau0 [R/c] is the viscosity of the contact over its stiffness",
        lambda c: theory.fit_tau0(c.x, c.y, c.young),
        min_points=3,
        needs_moduli=True,
        needs_damping=True,
        max_speed=2.2,
        line=_eq4,
        style=":",
        legend="eq. (4), τ₀ fitted",
    ),
}
# names of the laws for each kind of scene
LAWS_OF = {
    "compression": ("eq2", "eq2_nominal"),
    "exponential_wall": ("eq5", "curvature", "eq4"),
    "absorbing_wall": ("eq5", "curvature"),
}


# ---- from the rows of a sweep


@dataclass(frozen=True)
class Diagram:
    """Curves of column `y` of points.csv against an axis, whose (section, key) is `x`.
    `base`: a scene of the sweep, for the keys that are not swept."""

    base: Scene
    x: Home
    y: str
    curves: list[Curve]

    @property
    def is_of_laws(self) -> bool:
        """Whether it shows the main result over speed or pressure, as the laws do."""
        return self.x == self.base.abscissa and self.y == self.base.results[0]


def analyse(
    base: Scene,
    axes: dict[str, Home],
    rows: Sequence[Row],
    x: str | None = None,
    y: str | None = None,
) -> Diagram:
    """Return the curves of a sweep, with their fits, from `rows` of points.csv.

    base: a scene of the sweep, for the keys that are not swept; axes: (section, key) of
        the swept columns; x: one of these columns, by default speed or pressure, or
        else the first one that is not the seed; y: a column of numbers, by default the
        main result.
    """
    rows = _with_names_of_files(axes, rows)
    names = {home: name for name, home in axes.items()}
    y = y or base.results[0]
    not_the_seed = min(axes, key=lambda name: axes[name] == SEED)
    x = x or names.get(base.abscissa, not_the_seed)
    diagram = Diagram(base, axes[x], y, [])
    seed = names.get(SEED, "")  # no column if it is not swept
    if x == seed:
        seed = ""
    others = [name for name in axes if name not in (x, seed)]
    results = [y]
    if diagram.is_of_laws:
        results = list(base.results)
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if isinstance(row.get(y), (int, float)):
            groups.setdefault(tuple(row[name] for name in others), []).append(row)
    for values, members in groups.items():
        label = dict(zip(others, values, strict=True))
        # Laws are fitted to disks that have not folded, and where all lattices have a
        # result. If all disks have folded, the curve shows them without a fit.
        sound = members
        if diagram.is_of_laws:
            sound = _sound(members, x)
        places, tables = _tables(sound or members, x, seed, results)
        if diagram.is_of_laws:
            complete = np.isfinite(tables[y]).all(axis=1)
            tables = {name: table[complete] for name, table in tables.items()}
        if not len(tables[y]):
            continue
        young, poisson = _mean_moduli(members, seed)
        curve = Curve(
            label=label,
            x=places,
            results=tables,
            young=young,
            poisson=poisson,
            is_damped=_is_damped(base, axes, label),
            folded=sum(map(_is_folded, members)),
        )
        if diagram.is_of_laws and sound:
            curve = replace(curve, fits=_fits(base, curve))
        diagram.curves.append(curve)
    return diagram


def _with_names_of_files(axes: Iterable[str], rows: Sequence[Row]) -> list[Row]:
    """Return copies of the rows, in which the files of each axis have names without
    folder and ending, or if these are not unique, without the folder they share."""
    named = [dict(row) for row in rows]
    for name in axes:
        paths = {row[name] for row in rows if sep in str(row[name])}
        names = {path: Path(path).stem for path in paths}
        if len(set(names.values())) < len(paths):
            folder = commonpath(paths)
            names = {path: relpath(path, folder) for path in paths}
        for row in named:
            row[name] = names.get(row[name], row[name])
    return named


def _sound(rows: Sequence[Row], x: str) -> list[Row]:
    """Return the rows without those that are folded, and without all rows at a place on
    the axis `x` where most are, so that lattices are complete elsewhere."""
    counts = Counter(row[x] for row in rows)
    folded = Counter(row[x] for row in rows if _is_folded(row))
    return [
        row
        for row in rows
        if 2 * folded[row[x]] < counts[row[x]] and not _is_folded(row)
    ]


def _is_folded(row: Row) -> bool:
    return FOLDED in row.get("warnings", "")


def _tables(
    rows: Sequence[Row], x: str, seed: str, names: Sequence[str]
) -> tuple[Array, dict[str, Array]]:
    """Return the places (points,) on the axis `x`, and a table (lattices, points) of
    each result, NaN where there is no row."""
    lattices = sorted({row.get(seed, 0) for row in rows})
    # words behind numbers
    places = sorted(
        {row[x] for row in rows}, key=lambda place: (isinstance(place, str), place)
    )
    shape = (len(lattices), len(places))
    tables = {name: np.full(shape, np.nan) for name in names}
    for row in rows:
        at = (lattices.index(row.get(seed, 0)), places.index(row[x]))
        for name, table in tables.items():
            table[at] = row[name]
    return np.array(places), tables


def _fits(base: Scene, curve: Curve) -> dict[str, Fit]:
    fits = {}
    for name in LAWS_OF.get(base.scene, ()):
        law = LAWS[name]
        if law.applies(curve):
            fits[name] = law.fit(curve)
    return fits


def _mean_moduli(rows: Sequence[Row], seed: str) -> tuple[float, float]:
    """Return E and nu, means over lattices; a lattice counts once even if it has
    several rows. NaN if they are unknown."""
    moduli = {}
    for row in rows:
        moduli[row.get(seed, 0)] = (row["young"], row["poisson"])
    young, poisson = np.array(list(moduli.values()), float).mean(axis=0)
    return float(young), float(poisson)


def _is_damped(base: Scene, axes: dict[str, Home], label: Row) -> bool:
    swept = {}
    for name, value in label.items():
        section, key = axes[name]
        if section == "material":
            swept[key] = value
    _key, viscosity = replace(base.material, **swept).dashpots
    return viscosity != 0.0
