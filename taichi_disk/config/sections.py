"""The sections of a scene: every key with its default, bounds, unit and meaning.

Units throughout: disk mass M = disk radius R = reference speed c = 1; a point of the disk weighs m = M/N.
Equation and figure numbers are those of Kuninaka and Hayakawa's paper on the 2-D elastic disk.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cache
from math import cos, sin
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias, get_args, get_type_hints

from taichi_disk.config.potential import ExponentialPotential
from taichi_disk.errors import either

if TYPE_CHECKING:  # tells mypy what `Frozen` does; typing has it from Python 3.11 on
    from typing_extensions import dataclass_transform as _dataclasses
else:

    def _dataclasses(**_):
        return lambda cls: cls


Auto: TypeAlias = Literal["auto"]
Boundary: TypeAlias = Literal["reset", "pinned", "dashpot"]
Contact: TypeAlias = Literal["springs", "smooth"]
Colour: TypeAlias = Literal["strain", "force", "pressure", "shear", "rate", "fringes", "speed", "kinetic"]
Dashpot: TypeAlias = Literal["vector", "axial"]
Draw: TypeAlias = Literal["field", "springs", "both", "points"]
Theme: TypeAlias = Literal["light", "dark"]


@dataclass(frozen=True)
class Key:
    """What a key may be: one of `words`, a number from `low` to `high`, true or false, or the name of a file.

    Attributes:
        kind: bool, int, float; str where there are words or names of files alone.
        step: the number is a multiple of it, unless it is 0.
    """

    kind: type
    words: tuple[str, ...]
    meaning: str
    unit: str = ""
    low: float = 0
    high: float = 0
    step: float = 0

    def accepts(self, value: Any) -> bool:
        """Whether the key may have this value. Nothing is converted, but that a whole number is taken for a float."""
        if isinstance(value, str):
            return value in self.words or (self.kind is str and not self.words and value != "" and value.isprintable())
        if type(value) is not self.kind and (type(value), self.kind) != (int, float):
            return False
        return self.kind is bool or (self.low <= value <= self.high and not (self.step and value % self.step))

    def allowed(self) -> str:
        """The values that the key may have, in words."""
        if self.kind is bool:
            return "true or false"
        if self.kind is str:
            return either(self.words or ("none", "the name of a file"))
        number = "a whole number" if self.kind is int else "a number"
        if self.step:
            number = "an even whole number" if self.step == 2 else f"a multiple of {self.step:g}"
        low, high = (
            str(bound) if isinstance(bound, int) else f"{bound:.5g}".replace("e-0", "e-").replace("e+0", "e")
            for bound in (self.low, self.high)
        )
        return either([*self.words, f"{number} from {low} to {high}"]) + (f" [{self.unit}]" if self.unit else "")


def key(default: Any, meaning: str, unit: str = "", **bounds: float) -> Any:
    """A key of a section; its annotation says its kind and words. `bounds`: low, high and step of a number."""
    return field(default=default, metadata={"meaning": meaning, "unit": unit, **bounds})


@_dataclasses(frozen_default=True)
class Frozen:
    """Every subclass is a frozen dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True)(cls)


class Section(Frozen):
    """A group of keys. Values are checked where a scene is loaded or changed."""

    @classmethod
    @cache
    def schema(cls) -> dict[str, Key]:
        """The keys by name, in the order in which they are written."""
        found = {}
        for one in fields(cls):
            hint = get_type_hints(cls)[one.name]
            parts = get_args(hint) or (hint,)  # of a union, or the words of a Literal
            words = tuple(word for part in parts for word in ([part] if isinstance(part, str) else get_args(part)))
            kind = next((part for part in parts if isinstance(part, type)), str)
            found[one.name] = Key(kind, words, **one.metadata)
        return found


class LatticeSection(Section):
    points: int = key(1099, "number of mass points N of the disk", low=3, high=2_000_000)
    seed: int = key(0, "seed of the random points; the same seed gives the same lattice", low=0, high=2**32 - 1)
    rim: bool = key(True, "evenly spaced points on the circle; false: the literal random disk")
    min_spacing: float = key(
        0.7, "least distance of the random points, in spacings of the hexagonal lattice; 0: none", low=0, high=0.75
    )
    hole: float = key(0.0, "radius of a concentric hole, evenly spaced points on its edge; 0: none", "R", high=0.95)
    core_radius: float = key(0.0, "radius of a concentric core of another material; 0: none", "R", high=0.95)
    core_stiffness: float = key(1.0, "k_a, k_b and eta of the core's springs over the others'", low=1e-3, high=1e3)
    core_density: float = key(1.0, "density of the core over the rest's; the disk is of 1 M in all", low=1e-3, high=1e3)
    file: str = key("none", "points of your own, CSV or .npz, instead of random ones; relative to the scene file")
    velocities: str = key("none", "an .npz file with velocities [c] of the points at the start, instead of the scene's")


class MaterialSection(Section):
    """Springs and dashpots, eq. (1): f = -k_a s - k_b s^3 - eta (v_i - v_j), eta = eta_star m c/R with m = M/N."""

    k_a: float = key(1.0, "linear spring constant", "M c^2/R^2", low=1e-9, high=1e6)
    k_b: float = key(1e-3, "cubic spring constant", "M c^2/R^4", low=0, high=1e6)
    eta_star: float = key(10.0, "viscosity eta R/(m c) of the dashpots; 0: none", low=0, high=1e6)
    viscosity: Auto | float = key(
        "auto", "dashpot constant eta of one spring, the same body at any N; auto: eta_star/N", "M c/R", low=0, high=1e6
    )
    dashpot: Dashpot = key(
        "vector", "resists all relative velocity of its ends, a rotation's too (the paper); axial: along the spring"
    )

    def eta(self, points: int) -> float:
        """The dashpot constant of every spring of a disk of so many points [M c/R]."""
        return self.eta_star / points if self.viscosity == "auto" else self.viscosity

    @property
    def dashpots(self) -> tuple[str, float]:
        """The key that sets the dashpots, and its value, 0 for none."""
        return ("eta_star", self.eta_star) if self.viscosity == "auto" else ("viscosity", self.viscosity)


class WallSection(ExponentialPotential, Section):
    """Rigid wall: potential V0 exp(-a y) for every point of the disk, eqs. (3) and (6)."""

    a: float = key(300.0, "steepness of the wall's potential V0 exp(-a y)", "1/R", low=0.1, high=1e6)
    V0: float = key(150.0, "the wall's potential at distance 0", "M c^2", low=1e-12, high=1e12)


class RoughWallSection(WallSection):
    friction: float = key(0.0, "Coulomb's coefficient of friction on every point that the wall pushes", low=0, high=10)


class ElasticWallSection(ExponentialPotential, Section):
    """A lattice of points below the disk; potential V0 exp(-a l) at distance l from its surface springs."""

    points: int = key(1269, "number of mass points of the wall", low=4, high=2_000_000)
    k_a: Literal["same"] | float = key(
        "same",
        "linear spring constant of the wall, to which its k_b and dashpots are in proportion; same: material.k_a",
        "M c^2/R^2",
        low=1e-9,
        high=1e6,
    )
    width: float = key(3.8, "width of the wall; its depth follows from equal point density", "R", low=0.1, high=100)
    a: float = key(300.0, "steepness of the contact potential V0 exp(-a l)", "1/R", low=0.1, high=1e6)
    V0: float = key(150.0, "the contact potential at distance 0", "M c^2", low=1e-12, high=1e12)
    contact: Contact = key(
        "springs", "distance from the surface spring below a point, as the paper has it, or from a smooth curve"
    )
    threshold: float = key(0.1, "distance l beyond which there is no contact force", "R", low=1e-3, high=1e3)
    boundary: Boundary = key(
        "reset", "sides and bottom: velocities zeroed at intervals, held fast, or matched (absorbing) dashpots"
    )
    reset_interval: float = key(
        3e-3, "time between two zeroings of the boundary's velocities (boundary: reset)", "R/c", low=1e-6, high=1e3
    )


class ImpactSection(Section):
    """How the disk meets the wall."""

    velocity: float = key(0.02, "speed at the start", "c", low=1e-6, high=10)
    angle: float = key(
        0.0, "between the flight and the wall's normal, positive to the right", "rad", low=-1.5, high=1.5
    )
    spin: float = key(0.0, "angular velocity at the start, counter-clockwise", "c/R", low=-10, high=10)
    turn: float = key(0.0, "angle by which the disk is turned at the start", "rad", low=-3.1416, high=3.1416)
    gap: Auto | float = key(
        "auto",
        "distance of the lowest point from the wall at the start; auto: potential 1e-7 of v^2/2",
        "R",
        low=1e-9,
        high=1e3,
    )
    max_time: Auto | float = key(
        "auto", "give up when the disk has not left the wall by this time", "R/c", low=1e-6, high=1e6
    )

    @property
    def towards(self) -> float:
        """The velocity towards the wall [c]."""
        return self.velocity * cos(self.angle)

    @property
    def along(self) -> float:
        """The velocity along the wall, to the right [c]."""
        return self.velocity * sin(self.angle)


class ElasticImpactSection(ImpactSection):
    offset: Auto | float = key(
        "auto",
        "x of the disk's centre at the start; auto: such that it meets the wall in its middle",
        "R",
        low=-100,
        high=100,
    )


class CompressionSection(Section):
    """A force -P/N on every point, eq. (3), until the disk is at rest."""

    pressure: float = key(0.01, "compressing force P", "M c^2/R", low=1e-9, high=10)
    method: Literal["relaxation", "newton"] = key(
        "relaxation", "wait until the vibration has died out, or solve for the equilibrium"
    )
    tolerance: float = key(1e-6, "at rest once no force exceeds this part of P/N", low=1e-9, high=1e-2)
    max_time: Auto | float = key(
        "auto", "give up when the disk is not at rest by this time (method: relaxation)", "R/c", low=1e-6, high=1e6
    )


# How each integrator takes dashpots: from a predicted velocity, solved for (the paper's only), or not at all.
Dashpots: TypeAlias = Literal["explicit", "implicit", "none"]
DASHPOTS: dict[str, Dashpots] = {
    "velocity_verlet": "explicit",
    "trapezoidal": "implicit",
    "takahashi_imada": "none",
    "vefrl": "none",
}

CORRECTED = ("takahashi_imada",)  # integrators whose velocities are not those of the points, which a reset stops


class TimeSection(Section):
    integrator: Literal["auto", "velocity_verlet", "trapezoidal", "takahashi_imada", "vefrl"] = key(
        "auto",
        "trapezoidal takes dashpots implicitly; takahashi_imada and vefrl: order 4, no dashpots; auto: order 4 if the "
        "forces allow it, else what reaches the end first",
    )
    dt: Auto | float = key("auto", "time step; auto: safety times the largest stable one", "R/c", low=1e-9, high=1e3)
    safety: float = key(0.8, "fraction of the largest stable step", low=1e-6, high=1)
    tolerance: Literal["none"] | float = key(
        "none",
        "largest error of e, or of xi [R], absolute; the run finds the step and reports the error estimate",
        low=1e-10,
        high=1e-2,
    )
    sample_interval: Auto | float = key("auto", "time between two lines of the time series", "R/c", low=1e-9, high=1e6)


class VideoSection(Section):
    size: int = key(720, "width and height, even", "px", low=64, high=2160, step=2)
    fps: int = key(30, "frames per second", "1/s", low=1, high=120)
    seconds: float = key(8.0, "length of the film", "s", low=0.1, high=600)
    colour: Colour = key("shear", "what the colours show")
    draw: Draw = key("both", "the field between the points, the springs, both, or the points alone")
    theme: Theme = key("light", "light or dark background")
    magnify: Auto | float = key(
        "auto",
        "displacements are drawn so many times as large, and the film says so; auto: as flattened by 0.05 R, about",
        low=1,
        high=1000,
    )
    panel: bool = key(
        True, "curves of v_cm, wall's force and energies at the right, from a size of 360 on; the film is then 16 : 9"
    )
    supersample: float = key(1.0, "samples across a pixel: 2 is smoothest and slowest", low=1, high=2, step=0.5)
    format: Literal["mp4", "webm", "gif", "html", "png"] = key(
        "mp4", "of the film; html: a page that plays it; png: a folder of numbered pictures"
    )
