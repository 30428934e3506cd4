"""Lattices of mass points and springs, for the disk and the elastic wall. NumPy only;
SciPy is imported when used."""

from taichi_disk.mechanics.lattice.custom import numbers
from taichi_disk.mechanics.lattice.files import file_digest
from taichi_disk.mechanics.lattice.lattice import Lattice, disk_of
from taichi_disk.mechanics.lattice.network import Moduli, bulk_moduli
from taichi_disk.mechanics.lattice.own_start import (
    OwnStart,
    outline_name,
    own_start,
    own_velocities,
)
from taichi_disk.mechanics.lattice.random_points import circle_faults
from taichi_disk.mechanics.lattice.triangles import Array
from taichi_disk.mechanics.lattice.wall import check_thickness, with_wall
