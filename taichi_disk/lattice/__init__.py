"""Points and springs: the disk, the elastic wall, their moduli. NumPy and SciPy only; SciPy is imported when used."""

from taichi_disk.lattice.custom import custom_lattice, read_lattice
from taichi_disk.lattice.disk import MAX_POINTS, MIN_POINTS, disk_lattice, hexagonal_spacing, rim_points
from taichi_disk.lattice.lattice import Array, Lattice, bond_lengths
from taichi_disk.lattice.moduli import Moduli, bulk_moduli
from taichi_disk.lattice.wall import check_thickness, wall_height, with_wall

__all__ = [
    "MAX_POINTS",
    "MIN_POINTS",
    "Array",
    "Lattice",
    "Moduli",
    "bond_lengths",
    "bulk_moduli",
    "check_thickness",
    "custom_lattice",
    "disk_lattice",
    "hexagonal_spacing",
    "read_lattice",
    "rim_points",
    "wall_height",
    "with_wall",
]
