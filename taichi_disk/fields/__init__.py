"""What a state means to an eye: stress, rates, strains and energies. NumPy in, NumPy out."""

from taichi_disk.fields.quantities import QUANTITIES, Field, Quantity, at_points, field, fringes
from taichi_disk.fields.stress import Triangles, point_stress, stress

__all__ = ["QUANTITIES", "Field", "Quantity", "Triangles", "at_points", "field", "fringes", "point_stress", "stress"]
