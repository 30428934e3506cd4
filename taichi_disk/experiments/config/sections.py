"""The sections of a scene: every key with its default, bounds, unit and meaning.

Units throughout: disk mass M = disk radius R = reference speed c = 1; a point of the
    disk weighs m = M/N.
Equation and figure numbers are those of Kuninaka and Hayakawa's paper on the 2-D
elastic disk.
"""

from __future__ import annotations

import re
from dataclasses import Field, dataclass, field, fields
from functools import cache
from math import cos, sin, sqrt
from typing import (
    TYPE_CHECKING,
    Any,
    ClassVar,
    Literal,
    TypeAlias,
    get_args,
    get_type_hints,
)

from taichi_disk.base.errors import either
from taichi_disk.mechanics.potential import ExponentialPotential

# tells mypy what `Frozen` does; `typing` has dataclass_transform since Python 3.11
if TYPE_CHECKING:
    from typing_extensions import dataclass_transform as _dataclasses
else:

    def _dataclasses(**_):
        return lambda cls: cls


Auto: TypeAlias = Literal["auto"]
Boundary: TypeAlias = Literal["reset", "pinned", "dashpot"]
Contact: TypeAlias = Literal["springs", "smooth"]
Colour: TypeAlias = Literal[
    "strain", "force", "pressure", "shear", "rate", "fringes", "speed", "kinetic"
]
Dashpot: TypeAlias = Literal["vector", "axial"]
Draw: TypeAlias = Literal["field", "springs", "both", "points"]
Theme: TypeAlias = Literal["light", "dark"]


# control characters and lone surrogates; U+DC80 to U+DCFF stand for the bytes of a name
# that is not UTF-8
_UNUSABLE = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udc7f\udd00-\udfff]")


@dataclass(frozen=True)
class Key:
    """Allowed values of a key: one of `words`, a number from `low` to `high`, true or
    false, or the name of a file."""

    kind: type  # bool, int or float; str if only words or names of files are allowed
    words: tuple[str, ...]
    meaning: str
    unit: str = ""
    low: float = 0
    high: float = 0
    step: float = 0  # numbers must be multiples of it, unless it is 0

    @property
    def is_file(self) -> bool:
        return self.kind is str and not self.words

    def accepts(self, value: Any) -> bool:
        """Return whether the key may have this value. A whole number may be a float, as
        in tables of pandas and ranges of NumPy."""
        if isinstance(value, str):
            if self.is_file:
                return _is_file_name(value)
            return value in self.words
        if self.kind is bool:
            return type(value) is bool
        if type(value) not in (int, float) or not self.low <= value <= self.high:
            return False
        if self.kind is int and value % 1:
            return False
        return self.step == 0 or value % self.step == 0

    def allowed(self) -> str:
        if self.kind is bool:
            return "true or false"
        if self.kind is str:
            return either(self.words or ("none", "the name of a file"))
        number = "a number"
        if self.kind is int:
            number = "a whole number"
        if self.step == 2:
            number = "an even whole number"
        elif self.step:
            number = f"a multiple of {self.step:g}"
        bounds = f"{number} from {_shown(self.low)} to {_shown(self.high)}"
        allowed = either([*self.words, bounds])
        if self.unit:
            allowed += f" [{self.unit}]"
        return allowed


def _is_file_name(text: str) -> bool:
    is_misspelt = text.lower() in ("", "none") and text != "none"
    return not is_misspelt and _UNUSABLE.search(text) is None


def _shown(bound: float) -> str:
    if isinstance(bound, int):
        return str(bound)
    return f"{bound:.5g}".replace("e-0", "e-").replace("e+0", "e")


def key(default: Any, meaning: str, unit: str = "", **bounds: float) -> Any:
    """Define a key of a section; its annotation gives kind and words. `bounds`: low,
    high and step of a number."""
    return field(default=default, metadata={"meaning": meaning, "unit": unit, **bounds})


@_dataclasses(frozen_default=True)
class Frozen:
    """Every subclass is a frozen dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True)(cls)


class Section(Frozen):
    """A group of keys. Values are validated when a scene is loaded or changed."""

    @classmethod
    @cache
    def schema(cls) -> dict[str, Key]:
        hints = get_type_hints(cls)
        return {item.name: _key_of(hints[item.name], item) for item in fields(cls)}


def _key_of(hint: Any, item: Field[Any]) -> Key:
    # members of a union; or the words of a Literal; or nothing, if it is a single type
    parts = get_args(hint) or (hint,)
    words = []
    kind: type = str
    for part in parts:
        if isinstance(part, str):
            words.append(part)
        elif isinstance(part, type):
            kind = part
        else:
            words += get_args(part)
    return Key(kind, tuple(words), **item.metadata)


class LatticeSection(Section):
    points: int = key(
        1099, "number of mass points N of the disk", low=3, high=2_000_000
    )
    seed: int = key(
        0,
        "seed of the random points; the same seed gives the same lattice",
        high=2**32 - 1,
    )
    rim: bool = key(
        True, "evenly spaced points on the circle; false: random points only"
    )
    min_spacing: float = key(
        0.7,
        "smallest distance of random points, in hexagonal spacings; 0: none",
        high=0.75,
    )
    hole: float = key(0.0, "radius of a concentric hole; 0: none", "R", high=0.95)
    core_radius: float = key(
        0.0, "radius of a concentric core of another material; 0: none", "R", high=0.95
    )
    core_stiffness: float = key(
        1.0, "factor of k_a, k_b and eta in the core", low=1e-3, high=1e3
    )
    core_density: float = key(
        1.0,
        "density of the core relative to the rest; the disk has 1 M",
        low=1e-3,
        high=1e3,
    )
    file: str = key(
        "none",
        "table, .npz file or mesh with custom points instead of random ones; relative"
        " to the scene file",
    )
    outline: str = key(
        "none",
        "drawing (.svg) or table of an outline to fill instead of the circle",
    )
    velocities: str = key(
        "none",
        ".npz file with initial velocities [c] of the points instead of the scene's",
    )


class MaterialSection(Section):
    """Springs and dashpots, eq. (1): f = -k_a s - k_b s^3 - eta (v_i - v_j), eta =
    eta_star m c/R with m = M/N."""

    k_a: float = key(1.0, "linear spring constant", "M c^2/R^2", low=1e-9, high=1e6)
    k_b: float = key(1e-3, "cubic spring constant", "M c^2/R^4", high=1e6)
    eta_star: float = key(
        10.0,
        "viscosity eta R/(m c) per point, as in the paper; 0: no dashpots",
        high=1e6,
    )
    viscosity: Auto | float = key(
        "auto",
        "dashpot constant eta, independent of N; auto: eta_star/N",
        "M c/R",
        high=1e6,
    )
    dashpot: Dashpot = key(
        "vector",
        "vector: resists all relative motion (paper); axial: only along the spring",
    )

    def eta(self, points: int) -> float:
        """Return the dashpot constant of the springs in a disk of `points` points [M
        c/R]."""
        if self.viscosity == "auto":
            return self.eta_star / points
        return self.viscosity

    @property
    def dashpots(self) -> tuple[str, float]:
        """Name and value of the key that sets the dashpots; the value 0 means no
        dashpots."""
        if self.viscosity == "auto":
            return "eta_star", self.eta_star
        return "viscosity", self.viscosity


class WallSection(ExponentialPotential, Section):
    """Rigid wall: potential V0 exp(-a y) for every point of the disk, eqs. (3) and
    (6)."""

    a: float = key(
        300.0, "hardness of the wall: potential V0 exp(-a y)", "1/R", low=0.1, high=1e6
    )
    V0: float = key(
        150.0, "wall potential at distance 0", "M c^2", low=1e-12, high=1e12
    )


class RoughWallSection(WallSection):
    friction: float = key(
        0.0, "Coulomb friction coefficient between wall and mass points", high=10
    )


class ElasticWallSection(ExponentialPotential, Section):
    """A lattice of points below the disk; potential V0 exp(-a l) at distance l from its
    surface springs."""

    points: int = key(1269, "number of mass points of the wall", low=4, high=2_000_000)
    k_a: Literal["same"] | float = key(
        "same",
        "spring constant; scales k_b and dashpots, too; same: material.k_a",
        "M c^2/R^2",
        low=1e-9,
        high=1e6,
    )
    width: float = key(
        3.8,
        "width of the wall; its depth follows from the density of points",
        "R",
        low=0.1,
        high=100,
    )
    a: float = key(
        300.0,
        "hardness of the contact: potential V0 exp(-a l)",
        "1/R",
        low=0.1,
        high=1e6,
    )
    V0: float = key(
        150.0, "contact potential at distance 0", "M c^2", low=1e-12, high=1e12
    )
    contact: Contact = key(
        "springs",
        "distance l from springs of the surface (paper) or from a smooth curve",
    )
    threshold: float = key(
        0.1,
        "distance l beyond which there is no contact force",
        "R",
        low=1e-3,
        high=1e3,
    )
    boundary: Boundary = key(
        "reset",
        "sides and bottom: velocities reset at intervals, pinned points, or dashpots",
    )
    reset_interval: float = key(
        3e-3, "time between two resets (boundary: reset)", "R/c", low=1e-6, high=1e3
    )


class ImpactSection(Section):
    """Initial conditions of an impact."""

    velocity: float = key(0.02, "initial speed", "c", low=1e-6, high=10)
    angle: float = key(
        0.0,
        "angle of incidence from the normal, positive to the right",
        "rad",
        low=-1.5,
        high=1.5,
    )
    spin: float = key(
        0.0, "initial angular velocity, counter-clockwise", "c/R", low=-10, high=10
    )
    turn: float = key(
        0.0,
        "initial rotation of the lattice, counter-clockwise",
        "rad",
        low=-3.1416,
        high=3.1416,
    )
    gap: Auto | float = key(
        "auto",
        "initial height of the lowest point; auto: wall potential = 1e-7 v^2/2",
        "R",
        low=1e-9,
        high=1e3,
    )
    max_time: Auto | float = key(
        "auto", "time limit for the disk to leave the wall", "R/c", low=1e-6, high=1e6
    )
    gravity: float = key(0.0, "downward acceleration of the disk", "c^2/R", high=0.1)
    drop: float = key(
        0.0, "height of a fall that gives the velocity; 0: none", "R", high=100
    )
    bounces: int = key(1, "number of impacts; several need gravity", low=1, high=100)

    def __post_init__(self) -> None:
        if self.fall_speed and self.velocity == ImpactSection.velocity:
            object.__setattr__(self, "velocity", self.fall_speed)

    @property
    def rise(self) -> float:
        """How high a disk rises that keeps its speed [R]; 0 without gravity."""
        if not self.gravity:
            return 0.0
        return 0.5 * self.velocity**2 / self.gravity

    @property
    def fall_speed(self) -> float:
        """Speed after a fall from the height `drop` [c]; 0 without gravity."""
        return sqrt(2.0 * self.gravity * self.drop)

    @property
    def towards(self) -> float:
        """Velocity component towards the wall [c]."""
        return self.velocity * cos(self.angle)

    @property
    def along(self) -> float:
        """Velocity component along the wall, to the right [c]."""
        return self.velocity * sin(self.angle)


class ElasticImpactSection(ImpactSection):
    offset: Auto | float = key(
        "auto",
        "initial x of the centre; auto: hits the wall's middle",
        "R",
        low=-100,
        high=100,
    )


class CompressionSection(Section):
    """Load -P/N on every point, eq. (3), until the disk is at rest."""

    pressure: float = key(0.01, "compressing force P", "M c^2/R", low=1e-9, high=10)
    method: Literal["relaxation", "newton"] = key(
        "relaxation",
        "relaxation: simulate until the disk is at rest; newton: solve for the"
        " equilibrium",
    )
    tolerance: float = key(
        1e-6,
        "convergence threshold on the residual force, relative to P/N",
        low=1e-9,
        high=1e-2,
    )
    max_time: Auto | float = key(
        "auto", "time limit of method: relaxation", "R/c", low=1e-6, high=1e6
    )


class TimeSection(Section):
    integrator: Literal["auto", "velocity_verlet", "trapezoidal", "takahashi_imada"] = (
        key(
            "auto",
            "trapezoidal: implicit dashpots; takahashi_imada: order 4, no dashpots;"
            " auto: order 4 if the forces allow it, else whichever is faster",
        )
    )
    dt: Auto | float = key(
        "auto",
        "time step; auto: safety times the largest stable step",
        "R/c",
        low=1e-9,
        high=1e3,
    )
    safety: float = key(0.8, "fraction of the largest stable step", low=1e-6, high=1)
    tolerance: Literal["none"] | float = key(
        "none",
        "largest absolute time-step error of e, or of xi [R]; the run adapts its step",
        low=1e-10,
        high=1e-2,
    )
    sample_interval: Auto | float = key(
        "auto", "time between two rows of timeseries.csv", "R/c", low=1e-9, high=1e6
    )


class VideoSection(Section):
    size: Auto | int = key(
        "auto",
        "height; auto: 720, of a GIF 480",
        "px",
        low=64,
        high=2160,
        step=2,
    )
    fps: Auto | int = key(
        "auto",
        "frames per second; auto: 30, of a GIF 15, at most 50",
        "1/s",
        low=1,
        high=120,
    )
    seconds: float = key(8.0, "length of the film", "s", low=0.1, high=600)
    colour: Colour = key("shear", "quantity shown in colour")
    draw: Draw = key("both", "what is drawn; both: coloured field and springs")
    theme: Theme = key("light", "background of pictures")
    magnify: Auto | float = key(
        "auto",
        "factor on displacements; auto: disk looks 0.05 R flatter",
        low=1,
        high=1000,
    )
    panel: bool = key(
        True,
        "curves of v_cm, wall force and energies beside one disk (16:9); from size"
        " 360 on",
    )
    flight: float = key(
        0.33,
        "height above the wall at which the film of an impact begins and ends; 0: no"
        " flight",
        "R",
        high=2,
    )
    ringing: Literal["auto", "none"] = key(
        "auto", "auto: vibration after an impact on a rigid wall is shown stronger"
    )
    goal: Literal["none"] | float = key(
        "none",
        "task of a page that throws its disk: e to reach, such as 0.8",
        low=0.01,
        high=1,
    )
    text: float = key(1.0, "factor on the size of letters", low=0.5, high=3)
    words: Literal["all", "few"] = key(
        "all", "few: title, pace, motion and result, for slides"
    )
    supersample: float = key(
        1.0,
        "samples per pixel width; 2: smoothest and slowest",
        low=1,
        high=2,
        step=0.5,
    )
    format: Literal["mp4", "webm", "gif", "html", "png"] = key(
        "mp4", "html: page with player; png: folder of pictures"
    )

    def size_and_rate(self, form: str) -> tuple[int, int]:
        """Return height [px] and frames per second of a film in a format."""
        size = self.size
        fps = self.fps
        if size == "auto":
            size = 480 if form == "gif" else 720
        if fps == "auto":
            fps = 15 if form == "gif" else 30
        return size, fps


# Ends of the sliders of pages, inside the bounds of the keys.
SLIDERS = {
    "material.eta_star": (0.0, 100.0),
    "impact.velocity": (1e-3, 0.1),
}
