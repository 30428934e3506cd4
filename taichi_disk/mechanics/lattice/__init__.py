"""Lattices of mass points and springs, for the disk and the elastic wall. NumPy only;
SciPy is imported when used."""

from taichi_disk.mechanics.lattice.custom import numbers as numbers
from taichi_disk.mechanics.lattice.files import file_digest as file_digest
from taichi_disk.mechanics.lattice.lattice import (
    Lattice as Lattice,
    disk_of as disk_of,
)
from taichi_disk.mechanics.lattice.network import (
    Moduli as Moduli,
    bulk_moduli as bulk_moduli,
)
from taichi_disk.mechanics.lattice.own_start import (
    OwnStart as OwnStart,
    outline_name as outline_name,
    own_start as own_start,
    own_velocities as own_velocities,
)
from taichi_disk.mechanics.lattice.random_points import circle_faults as circle_faults
from taichi_disk.mechanics.lattice.triangles import Array as Array
from taichi_disk.mechanics.lattice.wall import (
    check_thickness as check_thickness,
    with_wall as with_wall,
)
