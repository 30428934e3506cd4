"""Tables of points as spreadsheets, pandas, NumPy and ParaView write them."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk.errors import InputError
from taichi_disk.lattice import Lattice, read_lattice
from taichi_disk.lattice.tables import read_table

POINTS = Lattice.disk(60, seed=3).positions
NUMBERED = [(k, x, y) for k, (x, y) in enumerate(POINTS.tolist())]


def table(header, pattern):
    """Return `header` and a row for each point, `pattern` with k, x and y filled in."""
    return header + "".join(pattern.format(k=k, x=x, y=y) for k, x, y in NUMBERED)


DIALECTS = {
    "without names": table("", "{x},{y}\n"),
    "NumPy": table("# x y\n", "{x:.18e} {y:.18e}\n"),
    "pandas' index": table(",x,y\n", "{k},{x},{y}\n"),
    "pandas, tabs": table("\tx\ty\n", "{k}\t{x}\t{y}\n"),
    "numbered": table("id,x,y\n", "{k},{x},{y}\n"),
    "numbered, without names": table("", "{k},{x},{y}\n"),
    "numbered, z": table("", "{k} {x} {y} 0.0\n"),
    "units": table("X [R],Y [R]\n", "{x},{y}\n"),
    "units, ISO": table("x/R, y/R\n", "{x}, {y}\n"),
    "semicolons": table("x;y\n", "{x};{y}\n"),
    "decimal commas": table("x;y\n", "{x};{y}\n").replace(".", ","),
    "decimal commas, spaces": table("", "{x}  {y}\n").replace(".", ","),
    "tabs": table("x\ty\n", "{x}\t{y}\n"),
    "decimal commas, tabs": table("x\ty\n", "{x}\t{y}\n").replace(".", ","),
    "ParaView": table('"Points:0","Points:1","Points:2"\n', "{x},{y},0\n"),
    "a plane z": table("z,y,x\n", "2.5,{y},{x}\n"),
    "names of points": table("name,x,y\n", "p{k},{x},{y}\n"),
    "z = 0": table("", "{x},{y},0\n"),
    "minus signs": table("x,y\n", "{x},{y}\n").replace("-", "\u2212"),
    "Windows": table("x,y\n", "{x},{y}\n").replace("\n", "\r\n"),
    "quotes": table('"x","y"\n', '"{x}","{y}"\n'),
    "R, names of rows": table('"x" "y"\n', '"{k}" {x} {y}\n'),
    "R, commas": table('"x","y","type"\n', '"p{k}",{x},{y},"rim"\n'),
    "MATLAB": table("% x y\n", "{x:.18e},{y:.18e}\n"),
    "C": table("// points\nx;y\n", "{x};{y}\n"),
    "trailing commas": table("x,y\n", "{x},{y},\n"),
    "trailing semicolons": table("x;y;\n", "{x};{y};\n").replace(".", ","),
    "units, underscore": table("id,x_R,y_R\n", "{k},{x},{y}\n"),
    "Fortran": table("", "  {x:.18e}  {y:.18e}\n").replace("e", "D"),
    "empty remarks": table("x,y,remark\n", "{x},{y},\n"),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_unambiguous_dialect_gives_the_same_points(dialect):
    positions, masses = read_table(DIALECTS[dialect])
    assert positions.shape == POINTS.shape
    assert masses is None
    assert positions == pytest.approx(POINTS, abs=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        table("", "{x},{y},{k}.5\n"),
        table("", "{k},{x},{y},{k}.5\n"),
        table("Mass [kg];x;y\n", "{k},5;{x};{y}\n"),
        table("x,y,z,m\n", "{x},{y},0,{k}.5\n"),
    ],
)
def test_masses_are_read_by_name_or_place(text):
    positions, masses = read_table(text)
    assert positions == pytest.approx(POINTS, abs=1e-15)
    assert (masses == np.arange(60) + 0.5).all()


def test_a_first_column_that_may_be_x_is_x():
    positions, masses = read_table("0,0,1\n1,0,1\n2,1,1\n")
    assert (positions == [[0, 0], [1, 0], [2, 1]]).all()
    assert (masses == 1.0).all()


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize("suffix", [".csv", ".txt", ".tsv"])
def test_a_file_may_have_a_byte_order_mark(tmp_path, encoding, suffix):
    path = tmp_path / f"points{suffix}"
    path.write_text(DIALECTS["pandas' index"], encoding=encoding)
    expected = Lattice.from_points(POINTS)
    assert (read_lattice(path).positions == expected.positions).all()
    assert (Lattice.read(path).bonds == expected.bonds).all()


WANTED = "needs the columns x, y and optionally mass"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", f"has no points; it {WANTED}"),
        ("x,y\n", f"has no points; it {WANTED}"),
        ("x\n1\n2\n", f"{WANTED}; found x"),
        ("1\n2\n", f"{WANTED}; found 1 columns without names"),
        ("u,v\n0,0\n1,0\n", f"{WANTED}; found u, v"),
        (",0,1\n0,0.5,0.5\n", f"{WANTED}; found , 0, 1"),
        ("x,y,X\n0,0,1\n", "has 2 columns x: leave one"),
        ("0,0,1,2\n1,0,1,2\n", f"{WANTED}; found 4 columns without names"),
        ("x,y\n0,5,0,3\n", "line 2 has 4 values, but the first line has 2"),
        ("x,y\n\n# note\n0,0\n1\n2,2\n", "line 5 has 1 values"),
        ("x,y\n0,0\n1,\n2,3\n", "line 3 has 1 values, but the first line has 2"),
        ("x,y\n0,0\n,1\n2,3\n", "line 3: could not convert string to float: ''"),
        ("x;y\n0,5;1\n1;b\n2;3,5\n", "line 3: could not convert string to float: 'b'"),
        ("x,y,z\n0,0,1\n1,0,2\n", "z must be the same for all points, not 1 to 2"),
    ],
)
def test_what_is_not_clear_is_refused_in_one_sentence(text, message):
    with pytest.raises(InputError) as refusal:
        read_table(text)
    assert str(refusal.value).startswith(message)
