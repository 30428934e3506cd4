"""Points and springs: the disk, the elastic wall, their moduli. NumPy and SciPy only; SciPy is imported when used."""

from taichi_disk.lattice.custom import disk_of, file_digest, numbers, read_lattice
from taichi_disk.lattice.disk import disk_lattice
from taichi_disk.lattice.lattice import Array, Lattice
from taichi_disk.lattice.moduli import Moduli, bulk_moduli
from taichi_disk.lattice.wall import check_thickness, with_wall

__all__ = [
    "Array",
    "Lattice",
    "Moduli",
    "bulk_moduli",
    "check_thickness",
    "disk_lattice",
    "disk_of",
    "file_digest",
    "numbers",
    "read_lattice",
    "with_wall",
]
