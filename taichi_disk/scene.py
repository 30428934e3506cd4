"""What a scene may say: every key with its default, bounds, unit and meaning.

Units throughout: disk mass M = disk radius R = reference speed c = 1; a point of the disk weighs m = M/N.
Equation and figure numbers are those of Kuninaka and Hayakawa's paper on the 2-D elastic disk.
A scene is frozen once built. `taichi_disk.scene_file.load_scene` reads one from YAML.
"""

from __future__ import annotations

from collections.abc import Collection
from math import log
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

Auto: TypeAlias = Literal["auto"]
Colouring: TypeAlias = Literal["strain", "force", "speed", "kinetic"]
Show: TypeAlias = Literal["both", "springs", "points"]
Format: TypeAlias = Literal["mp4", "webm", "gif", "png"]
LOOSEST_REST = 1e-2  # compression.tolerance


def _key(default: Any, meaning: str, unit: str = "", **bounds: Any) -> Any:
    return Field(default, description=meaning, json_schema_extra={"unit": unit}, **bounds)


class _Strict(BaseModel):
    # strict: neither "1" nor true is a number. An int is taken where a float is asked for, not the reverse.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class LatticeSection(_Strict):
    """The disk's points."""

    points: int = _key(1099, "number of mass points N of the disk", ge=3, le=2_000_000)
    seed: int = _key(0, "seed of the random points; the same seed gives the same lattice", ge=0, le=2**32 - 1)
    rim: bool = _key(True, "evenly spaced points on the circle; false: the literal random disk")
    min_spacing: float = _key(
        0.7,
        "least distance of the random points, in spacings of the hexagonal lattice; 0: none",
        ge=0,
        le=0.75,
    )


class MaterialSection(_Strict):
    """Springs and dashpots, eq. (1): f = -k_a s - k_b s^3 - eta (v_i - v_j), eta = eta_star m c/R."""

    k_a: float = _key(1.0, "linear spring constant", "M c^2/R^2", ge=1e-9, le=1e6)
    k_b: float = _key(1e-3, "cubic spring constant", "M c^2/R^4", ge=0, le=1e6)
    eta_star: float = _key(10.0, "viscosity eta R/(m c) of the dashpots; 0: none", ge=0, le=1e6)


class CompressionMaterial(MaterialSection):
    """Damped strongly by default, so that the vibration dies out."""

    eta_star: float = _key(100.0, "viscosity eta R/(m c) of the dashpots; 0: none", ge=0, le=1e6)


class ConservativeMaterial(MaterialSection):
    """No dashpots by default: the wall's boundary absorbs the energy."""

    eta_star: float = _key(0.0, "viscosity eta R/(m c) of the dashpots; 0: none", ge=0, le=1e6)


class WallSection(_Strict):
    """Rigid wall: potential V0 exp(-a y) for every point of the disk, eqs. (3) and (6)."""

    a: float = _key(300.0, "steepness of the wall's potential V0 exp(-a y)", "1/R", ge=0.1, le=1e6)
    V0: float = _key(150.0, "the wall's potential at distance 0", "M c^2", ge=1e-12, le=1e12)


class ElasticWallSection(_Strict):
    """A lattice of points below the disk; potential V0 exp(-a l) at distance l from its surface springs."""

    points: int = _key(1269, "number of mass points of the wall", ge=4, le=2_000_000)
    width: float = _key(3.8, "width of the wall; its depth follows from equal point density", "R", ge=0.1, le=100)
    a: float = _key(300.0, "steepness of the contact potential V0 exp(-a l)", "1/R", ge=0.1, le=1e6)
    V0: float = _key(150.0, "the contact potential at distance 0", "M c^2", ge=1e-12, le=1e12)
    threshold: float = _key(0.1, "distance l beyond which there is no contact force", "R", ge=1e-3, le=1e3)
    boundary: Literal["reset", "pinned", "dashpot"] = _key(
        "reset",
        "sides and bottom: velocities zeroed at intervals, held fast, or matched (absorbing) dashpots",
    )
    reset_interval: float = _key(
        3e-3,
        "time between two zeroings of the boundary's velocities (boundary: reset)",
        "R/c",
        ge=1e-6,
        le=1e3,
    )


class ImpactSection(_Strict):
    """How the disk meets the wall."""

    velocity: float = _key(0.02, "speed towards the wall at the start", "c", ge=1e-6, le=10)
    gap: Auto | Annotated[float, Field(gt=0, le=1e3)] = _key(
        "auto", "distance of the lowest point from the wall at the start; auto: potential 1e-10 of v^2/2", "R"
    )
    max_time: Auto | Annotated[float, Field(ge=1e-6, le=1e6)] = _key(
        "auto", "give up when the disk has not left the wall by this time", "R/c"
    )


class CompressionSection(_Strict):
    """A force -P/N on every point, eq. (3), until the disk is at rest."""

    pressure: float = _key(0.01, "compressing force P", "M c^2/R", ge=1e-9, le=10)
    method: Literal["relaxation", "newton"] = _key(
        "relaxation", "wait until the vibration has died out, or solve for the equilibrium"
    )
    tolerance: float = _key(1e-6, "at rest once no force exceeds this part of P/N", ge=1e-9, le=LOOSEST_REST)
    max_time: Auto | Annotated[float, Field(ge=1e-6, le=1e6)] = _key(
        "auto", "give up when the disk is not at rest by this time (method: relaxation)", "R/c"
    )


class TimeSection(_Strict):
    """Time stepping."""

    integrator: Literal["auto", "velocity_verlet", "trapezoidal", "vefrl"] = _key(
        "auto",
        "trapezoidal takes dashpots implicitly; vefrl: order 4, no dashpots; auto: what reaches the end first",
    )
    dt: Auto | Annotated[float, Field(ge=1e-9, le=1e3)] = _key(
        "auto", "time step; auto: safety times the largest stable one", "R/c"
    )
    safety: float = _key(0.8, "fraction of the largest stable step", gt=0, le=1)
    tolerance: Literal["none"] | Annotated[float, Field(ge=1e-10, le=1e-2)] = _key(
        "none", "largest error of e, or of xi [R], absolute; the run finds the step and tells the error it estimates"
    )
    precision: Literal["f64", "f32"] = _key("f64", "of the numbers that are stepped; f32: sweeps are faster")
    sample_interval: Auto | Annotated[float, Field(ge=1e-9, le=1e6)] = _key(
        "auto", "time between two lines of the time series", "R/c"
    )


class VideoSection(_Strict):
    """The film."""

    size: int = _key(720, "width and height, even", "px", ge=64, le=2160, multiple_of=2)
    fps: int = _key(30, "frames per second", "1/s", ge=1, le=120)
    seconds: float = _key(8.0, "length of the film", "s", ge=0.1, le=600)
    colour: Colouring = _key("strain", "what colours show: strain or force of a spring, speed or kinetic of its ends")
    draw: Show = _key("both", "springs, points or both; points without springs are coloured as those would be")
    panel: bool = _key(False, "curves of v_cm, wall's force and energies at the right; the film is then 16 : 9")
    supersample: float = _key(1.5, "samples across a pixel: 1 is rough and quick", ge=1, le=2, multiple_of=0.5)
    format: Format = _key("mp4", "of the film; png: a folder of numbered pictures")


def yaml_scalar(value: bool | int | float | str) -> str:
    """YAML text that reads back as the same value, in YAML 1.1 as in 1.2."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = repr(value)  # the shortest text that reads back bit-equal
        # Without a point, YAML 1.1 readers (PyYAML too) take 1e-05 for a string.
        return text if "." in text else text.replace("e", ".0e")
    return str(value)


class _SceneBase(_Strict):
    def _conflicts(self) -> list[tuple[str, str]]:
        """(dotted key, what is wrong) for each disagreement between keys."""
        return []

    @model_validator(mode="after")
    def _agree(self) -> Any:
        if conflicts := self._conflicts():
            text = "; ".join(f"{key}: {what}" for key, what in conflicts)
            raise PydanticCustomError("conflict", "{text}", {"text": text, "conflicts": conflicts})
        return self

    def to_yaml(self, leave_out: Collection[str] = ()) -> str:
        """The whole scene, every default filled in, with units; reading it gives an equal scene.

        `leave_out`: dotted keys that are not written.
        """
        lines = []
        for name in type(self).model_fields:
            section = getattr(self, name)
            if isinstance(section, str):
                lines.append(f"{name}: {section}")
                continue
            lines.append(f"{name}:")
            for key, field in type(section).model_fields.items():
                if f"{name}.{key}" in leave_out:
                    continue
                extra = field.json_schema_extra
                unit = f"[{extra['unit']}] " if isinstance(extra, dict) and extra["unit"] else ""
                entry = f"  {key}: {yaml_scalar(getattr(section, key))}"
                lines.append(f"{entry:<32} # {unit}{field.description}")
        return "\n".join(lines) + "\n"


def _time_conflicts(time: TimeSection, damping: list[str]) -> list[tuple[str, str]]:
    """`damping`: the keys, with their values, that make forces depend on velocity."""
    conflicts = []
    if time.dt != "auto" and time.sample_interval != "auto" and time.sample_interval < time.dt:
        text = f"{time.sample_interval:g} is shorter than the time step time.dt = {time.dt:g} [R/c]"
        conflicts.append(("time.sample_interval", text))
    if time.tolerance != "none" and time.dt != "auto":
        conflicts.append(("time.tolerance", f"finds the step itself: write time.dt: auto, not {time.dt:g}"))
    if time.tolerance != "none" and time.precision == "f32" and time.tolerance < 1e-6:
        conflicts.append(
            ("time.tolerance", "in f32 rounding alone moves the result by up to 4e-7: write 1.0e-6 or more, or f64")
        )
    if time.integrator == "vefrl" and damping:
        text = f"vefrl cannot take forces that depend on velocity ({damping[0]}): write auto, or velocity_verlet"
        conflicts.append(("time.integrator", text))
    return conflicts


def _dashpots(material: MaterialSection) -> list[str]:
    return [f"material.eta_star = {material.eta_star:g}"] if material.eta_star else []


def _least_distance(wall: WallSection | ElasticWallSection, velocity: float, fraction: float) -> float:
    """Distance from the wall at which its potential V0 exp(-a y) is `fraction` of v^2/2 (M = 1) [R]."""
    return (log(wall.V0) - log(fraction / 2) - 2 * log(velocity)) / wall.a


def least_threshold(wall: ElasticWallSection, velocity: float) -> float:
    """Distance at which the contact may be cut off: farther away its potential is 1e-5 of v^2/2 or less [R]."""
    return _least_distance(wall, velocity, 1e-5)


def _gap_conflicts(wall: WallSection | ElasticWallSection, impact: ImpactSection) -> list[tuple[str, str]]:
    # Nearer than this the disk starts with potential energy to spare and is shot away: e > 1.
    least = _least_distance(wall, impact.velocity, 1e-3)
    if impact.gap == "auto" or impact.gap >= least:
        return []
    return [
        (
            "impact.gap",
            f"at {impact.gap:g} R the wall's potential exceeds 1e-3 of the kinetic energy: "
            f"start at {_rounded_up(least)} R or farther, or write auto",
        )
    ]


def _rounded_up(value: float) -> str:
    return f"{value * 1.001:.4g}"


class CompressionScene(_SceneBase):
    """The disk pressed on a rigid wall (figures 1 and 2): xi against P, eq. (2)."""

    scene: Literal["compression"] = "compression"
    lattice: LatticeSection = LatticeSection()
    material: CompressionMaterial = CompressionMaterial()
    wall: WallSection = WallSection()
    compression: CompressionSection = CompressionSection()
    time: TimeSection = TimeSection()
    video: VideoSection = VideoSection()

    def _conflicts(self) -> list[tuple[str, str]]:
        conflicts = _time_conflicts(self.time, _dashpots(self.material))
        if self.time.tolerance != "none" and self.compression.method == "newton":
            text = "Newton's method takes no time step, and solves to rounding: write none, or method: relaxation"
            conflicts.append(("time.tolerance", text))
        if self.time.precision == "f32" and self.compression.method == "relaxation":
            # Forces flicker by up to 4.5e-7 N, in parts of P/N: the rounding of the springs' forces beside it.
            least = max(1e-4, 1e-6 * self.lattice.points)
            if self.compression.tolerance < least:
                instead = (
                    f"compression.tolerance: {_rounded_up(least)} or more, or f64"
                    if 1.001 * least < LOOSEST_REST
                    else "f64"
                )
                text = f"in f32 this disk comes to rest to {least:.2g} at best: write {instead}"
                conflicts.append(("time.precision", text))
        return conflicts


class ExponentialWallScene(_SceneBase):
    """Head-on impact on a rigid wall (figure 3): restitution e against v, eq. (5)."""

    scene: Literal["exponential_wall"] = "exponential_wall"
    lattice: LatticeSection = LatticeSection()
    material: MaterialSection = MaterialSection()
    wall: WallSection = WallSection()
    impact: ImpactSection = ImpactSection()
    time: TimeSection = TimeSection()
    video: VideoSection = VideoSection()

    def _conflicts(self) -> list[tuple[str, str]]:
        return _time_conflicts(self.time, _dashpots(self.material)) + _gap_conflicts(self.wall, self.impact)


class AbsorbingWallScene(_SceneBase):
    """Head-on impact on an elastic wall whose sides and bottom absorb the energy (figures 4 to 6)."""

    scene: Literal["absorbing_wall"] = "absorbing_wall"
    lattice: LatticeSection = LatticeSection()
    material: ConservativeMaterial = ConservativeMaterial()
    wall: ElasticWallSection = ElasticWallSection()
    impact: ImpactSection = ImpactSection()
    time: TimeSection = TimeSection()
    video: VideoSection = VideoSection()

    def _conflicts(self) -> list[tuple[str, str]]:
        damping = _dashpots(self.material) + ["wall.boundary = dashpot"] * (self.wall.boundary == "dashpot")
        conflicts = _time_conflicts(self.time, damping) + _gap_conflicts(self.wall, self.impact)
        # The contact force is cut off at the threshold; the energy lost there must not show in the ledger.
        least = least_threshold(self.wall, self.impact.velocity)
        if self.wall.threshold < least:
            conflicts.append(
                (
                    "wall.threshold",
                    f"at {self.wall.threshold:g} R the contact potential exceeds 1e-5 of the kinetic energy, "
                    f"so that energy would jump there: write {_rounded_up(least)} R or more",
                )
            )
        dt = self.time.dt
        if self.wall.boundary == "reset" and dt != "auto" and dt > self.wall.reset_interval:
            interval = self.wall.reset_interval
            conflicts.append(("time.dt", f"{dt:g} is longer than wall.reset_interval = {interval:g} [R/c]"))
        return conflicts


Scene: TypeAlias = CompressionScene | ExponentialWallScene | AbsorbingWallScene
SCENES: dict[str, type[CompressionScene] | type[ExponentialWallScene] | type[AbsorbingWallScene]] = {
    "compression": CompressionScene,
    "exponential_wall": ExponentialWallScene,
    "absorbing_wall": AbsorbingWallScene,
}
