"""The laws of motion: each with its numbers, its Taichi functions, and its energy and forces in NumPy."""

from taichi_disk import runtime

runtime.prepare_environment()  # Taichi, which the laws import, reads it when it is imported

from taichi_disk.physics.body_forces import ExponentialWall, Load, MouseSpring  # noqa: E402
from taichi_disk.physics.boundaries import Boundary, MatchedBoundary, PinnedBoundary, ResetBoundary, matched_impedance  # noqa: E402
from taichi_disk.physics.elastic_wall import ElasticWall  # noqa: E402
from taichi_disk.physics.law import BodyForce, Law  # noqa: E402
from taichi_disk.physics.model import Model  # noqa: E402
from taichi_disk.physics.springs import Springs  # noqa: E402

__all__ = [
    "BodyForce",
    "Boundary",
    "ElasticWall",
    "ExponentialWall",
    "Law",
    "Load",
    "MatchedBoundary",
    "Model",
    "MouseSpring",
    "PinnedBoundary",
    "ResetBoundary",
    "Springs",
    "matched_impedance",
]
