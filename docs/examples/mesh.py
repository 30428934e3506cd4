"""A mesh of gmsh as a body: a tube of rubber, thrown at the rigid wall.

python docs/examples/mesh.py

With gmsh, `gmsh -2 tube.geo` makes tube.msh from this file tube.geo:

    Point(1) = {0, 0, 0, 0.06};
    For k In {0:2}
      Point(2 + k) = {Cos(2 * Pi * k / 3), Sin(2 * Pi * k / 3), 0, 0.06};
      Point(5 + k) = {0.5 * Cos(2 * Pi * k / 3), 0.5 * Sin(2 * Pi * k / 3), 0, 0.06};
    EndFor
    For k In {0:2}
      Circle(1 + k) = {2 + k, 1, 2 + (k + 1) % 3};
      Circle(4 + k) = {5 + k, 1, 5 + (k + 1) % 3};
    EndFor
    Curve Loop(1) = {1:3};
    Curve Loop(2) = {4:6};
    Plane Surface(1) = {1, 2};

This script writes a file of the same kind itself, so that it runs without gmsh.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from taichi_disk import Lattice, load_scene, run

OUTER, INNER = 1.0, 0.5  # radii [R]
ROWS = 8  # rows of triangles from the inner to the outer circle
SECTORS = 80  # points on each circle


def tube() -> tuple[np.ndarray, np.ndarray]:
    """Return the points (n, 2) [R] and triangles (t, 3) of the tube."""
    radius = INNER + (OUTER - INNER) * np.arange(ROWS + 1) / ROWS
    # Points of odd circles stand between those of even circles.
    turn = np.arange(SECTORS) + 0.5 * (np.arange(ROWS + 1)[:, None] % 2)
    angle = 2.0 * np.pi * turn / SECTORS
    x = radius[:, None] * np.cos(angle)
    y = radius[:, None] * np.sin(angle)
    triangles = []
    for row in range(ROWS):
        shift = row % 2  # how far the next circle's points stand behind
        for k in range(SECTORS):
            a = row * SECTORS + k
            b = row * SECTORS + (k + 1) % SECTORS
            c = (row + 1) * SECTORS + (k + shift) % SECTORS
            d = (row + 1) * SECTORS + (k + shift - 1) % SECTORS
            triangles += [(a, c, b), (a, d, c)]
    return np.column_stack([x.ravel(), y.ravel()]), np.array(triangles)


def write_msh(path: Path, points: np.ndarray, triangles: np.ndarray) -> None:
    """Write a mesh in gmsh's format 2.2, with the centre of the circles as a point."""
    centre = np.zeros((1, 2))
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes"]
    lines.append(str(len(points) + 1))
    for number, (x, y) in enumerate(np.concatenate([centre, points]), start=1):
        lines.append(f"{number} {x:.16g} {y:.16g} 0")
    lines += ["$EndNodes", "$Elements", str(len(triangles) + 1)]
    lines.append("1 15 2 0 1 1")  # the centre
    for number, corners in enumerate(triangles + 2, start=2):
        lines.append(f"{number} 2 2 0 1 {' '.join(map(str, corners))}")
    lines.append("$EndElements")
    path.write_text("\n".join(lines) + "\n")


with TemporaryDirectory() as folder:
    path = Path(folder) / "tube.msh"
    write_msh(path, *tube())
    body = Lattice.read(path)
    for note in body.notes:
        print(note)
    scene = load_scene("exponential_wall", [f"lattice.file={path}"])
    scene = scene.with_(viscosity=0.01, velocity=0.03)
    result = run(scene, lattices=1)

print(f"{body.disk_points} points, {len(body.bonds)} springs")
print(f"e = {result.restitution:.4f}")
