"""The laws of motion, each with its parameters, its Taichi functions, and its energy
and forces in NumPy."""

from taichi_disk.mechanics.physics.body_forces import (
    ExponentialWall as ExponentialWall,
    Load as Load,
    MouseSpring as MouseSpring,
)
from taichi_disk.mechanics.physics.boundaries import (
    Boundary as Boundary,
    MatchedBoundary as MatchedBoundary,
    PinnedBoundary as PinnedBoundary,
    ResetBoundary as ResetBoundary,
    matched_impedance as matched_impedance,
)
from taichi_disk.mechanics.physics.elastic_wall import ElasticWall as ElasticWall
from taichi_disk.mechanics.physics.law import (
    BodyForce as BodyForce,
    Law as Law,
    Wall as Wall,
)
from taichi_disk.mechanics.physics.model import Model as Model
from taichi_disk.mechanics.physics.smooth_contact import (
    SmoothElasticWall as SmoothElasticWall,
)
from taichi_disk.mechanics.physics.springs import Springs as Springs
