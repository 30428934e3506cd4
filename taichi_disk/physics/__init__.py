"""The laws of motion, one to a file: each with its Taichi functions, its bound on the time step, its NumPy twin."""

from taichi_disk import runtime

runtime.prepare_environment()  # Taichi, which the laws import, reads it when it is imported

from taichi_disk.physics.boundaries import Boundary, MatchedBoundary, PinnedBoundary, ResetBoundary, matched_impedance  # noqa: E402
from taichi_disk.physics.elastic_wall import ElasticWall  # noqa: E402
from taichi_disk.physics.exponential_wall import ExponentialWall  # noqa: E402
from taichi_disk.physics.law import BodyForce, Law  # noqa: E402
from taichi_disk.physics.load import Load  # noqa: E402
from taichi_disk.physics.model import Model  # noqa: E402
from taichi_disk.physics.mouse_spring import MouseSpring  # noqa: E402
from taichi_disk.physics.smooth_contact import SmoothElasticWall  # noqa: E402
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
    "SmoothElasticWall",
    "Springs",
    "matched_impedance",
]
