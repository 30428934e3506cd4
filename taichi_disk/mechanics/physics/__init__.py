"""The laws of motion, each with its parameters, its Taichi functions, and its energy
and forces in NumPy."""

from taichi_disk.mechanics.physics.body_forces import ExponentialWall, Load, MouseSpring
from taichi_disk.mechanics.physics.boundaries import (
    Boundary,
    MatchedBoundary,
    PinnedBoundary,
    ResetBoundary,
    matched_impedance,
)
from taichi_disk.mechanics.physics.elastic_wall import ElasticWall
from taichi_disk.mechanics.physics.law import BodyForce, Law, Wall
from taichi_disk.mechanics.physics.model import Model
from taichi_disk.mechanics.physics.smooth_contact import SmoothElasticWall
from taichi_disk.mechanics.physics.springs import Springs
