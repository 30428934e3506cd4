"""Tables of points: what is read, and that everything else is refused."""

import numpy as np
import pytest

from taichi_disk.base.errors import InputError
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.lattice.tables import read_table

POINTS = Lattice.disk(60, seed=3).positions
NUMBERED = [(k, x, y) for k, (x, y) in enumerate(POINTS.tolist())]


def table(header, pattern):
    """Return `header` and a row for each point, `pattern` with k, x and y filled in."""
    return header + "".join(pattern.format(k=k, x=x, y=y) for k, x, y in NUMBERED)


TABLES = {
    "without names": table("", "{x},{y}\n"),
    "blanks": table("", "  {x}   {y}\n"),
    "tabs, y first": table("y\tx\n", "{y}\t{x}\n"),
    "semicolons": table("x;y\n", "{x};{y}\n"),
    "a comment": table("# made by hand\nx, y\n\n", "{x}, {y}\n"),
    "units": table("X [mm],Y (mm)\n", "{x},{y}\n"),
    "another unit": table("x/R y/R\n", "{x} {y}\n"),
    "other columns": table(",z,name,y,x,xy\n", "{k},2.5,p{k},{y},{x},\n"),
    "pandas, tabs": table("\tx\ty\n", "{k}\t{x}\t{y}\n"),
    "decimal commas": table("x;y\n", "{x};{y}\n").replace(".", ","),
    "decimal commas, blanks": table("", "{x}  {y}\n").replace(".", ","),
    "decimal commas, tabs": table("x\ty\n", "{x}\t{y}\n").replace(".", ","),
    "R's write.csv": table('"","x","y"\n', '"{k}",{x},{y}\n'),
    "Excel's end": table("x;y\n", "{x};{y}\n").replace(".", ",") + ";\n;\n",
    "Windows": table("x,y\n", "{x:.18E},{y:.18e}\n").replace("\n", "\r\n"),
}


@pytest.mark.parametrize("form", TABLES)
def test_every_plain_form_gives_the_same_points(form):
    positions, masses = read_table(TABLES[form])
    assert masses is None
    assert positions == pytest.approx(POINTS, abs=1e-15)


@pytest.mark.parametrize("name", ["Mass/kg", "masses"])
def test_masses_are_read_by_name(name):
    positions, masses = read_table(table(f"{name};x;y\n", "{k},5;{x};{y}\n"))
    assert positions == pytest.approx(POINTS, abs=1e-15)
    assert (masses == np.arange(60) + 0.5).all()


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize("suffix", [".csv", ".txt", ".tsv"])
def test_a_file_makes_a_lattice_and_a_note(tmp_path, encoding, suffix):
    path = tmp_path / f"points{suffix}"
    path.write_text(TABLES["pandas, tabs"], encoding=encoding)
    lattice = Lattice.read(path)
    assert (lattice.positions == POINTS).all()
    assert lattice.notes == ("60 points; x, y, no masses",)
    path.write_text(table("x,y,mass\n", "{x},{y},{k}.5\n"), encoding=encoding)
    lattice = Lattice.read(path)
    assert lattice.masses == pytest.approx((np.arange(60) + 0.5) / 1800)
    assert lattice.notes == ("60 points; x, y, mass from the header",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it has no points (no lines)"),
        ("x,y\n", "it has no points (x | y)"),
        ("u,v\n0,0\n1,0\n", "line 1 does not name x and y (u | v)"),
        ("x,z\n0,0\n1,0\n", "line 1 does not name x and y (x | z)"),
        ("x,y,X\n0,0,1\n", "line 1 names x twice (x | y | X)"),
        ("0,0,1\n1,0,1\n", "line 1 has 3 numbers and no names (0 | 0 | 1)"),
        ("0\n1\n", "line 1 has 1 numbers and no names"),
        # names of fewer columns than there are would move y into x
        ("x,y\n0,0.5,0.5\n", "line 2 has 3 columns instead of 2 (0 | 0.5 | 0.5)"),
        ("x,y\n\n# note\n0,0\n1\n", "line 5 has 1 columns instead of 2 (1)"),
        ("x,y\n0;0\n1;0\n", "line 2 has 1 columns instead of 2 (0;0)"),
        ("# y x\n0 1\n", "line 1 may name columns behind #: remove the # or the line"),
        ("# r, y\n0 1\n", "line 1 may name columns behind #"),
        ("x y\n# Mass [kg]\n0 1\n", "line 2 may name columns behind #"),
        ("0,5, 1,2\n", "line 1 has 4 numbers and no names (0 | 5 | 1 | 2)"),
        ("x,y\n0,0\n,1\n", "line 3 lacks a number ( | 1)"),
        ("x;y\n0,5;1\n1;b\n", "line 3 lacks a number (1 | b)"),
        ("x,y\n0,nan\n", "line 2 lacks a number (0 | nan)"),
        ("x,y\n0_0,1\n", "line 2 lacks a number (0_0 | 1)"),
        ("x,y\n1,234.5,0\n", "line 2 has 3 columns"),
        ('"xes","y"\n0,1\n', "line 1 does not name x and y (xes | y)"),
        ("1.0D0 2.0D0\n", "line 1 does not name x and y (1.0D0 | 2.0D0)"),
        ("\u22121,0\n", "line 1 does not name x and y (\u22121 | 0)"),
    ],
)
def test_everything_else_is_refused_in_one_sentence(text, message):
    with pytest.raises(InputError) as refusal:
        read_table(text)
    assert str(refusal.value).startswith(message)
    assert "other points, Lattice.outline other outlines" in str(refusal.value)
