"""Custom lattices: from arrays, from files, and the messages about invalid ones."""

import io
import math
import os
import re
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from bodies import assert_tiles, changed, holes_of
from scipy.spatial import cKDTree

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.lattice import Lattice, files, with_wall
from taichi_disk.mechanics.lattice.own_start import OwnStart, own_start


def square(half):
    """Return all points (n, 2) of whole numbers from -`half` to `half`."""
    numbers = np.arange(-half, half + 1)
    return np.stack(np.meshgrid(numbers, numbers), axis=-1).reshape(-1, 2)


HEXAGONAL = square(12) @ np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]]) / 8
ROUND = HEXAGONAL[np.hypot(*HEXAGONAL.T) < 1 + 1e-9]
GRID = square(4) / 4
ANGLES = np.arange(24) * np.pi / 12
RIM = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
NEAREST = cKDTree(GRID).query_pairs(0.26, output_type="ndarray")
CROSSED = cKDTree(GRID).query_pairs(0.36, output_type="ndarray")
RISE = np.prod(GRID[CROSSED[:, 1]] - GRID[CROSSED[:, 0]], axis=1)
SLANTED = CROSSED[RISE < 1e-9]
RING = ROUND[np.hypot(*ROUND.T) > 0.6]
CENTRE = ROUND[np.hypot(*ROUND.T) <= 0.6]
# two triangles for each cell of the grid but one, which is a hole
CELL = np.setdiff1d(np.arange(81).reshape(9, 9)[:8, :8], 30)
CORNERS = np.array([[0, 1, 10], [0, 10, 9]])
CELLS = (CELL[:, None, None] + CORNERS).reshape(-1, 3)


@pytest.mark.parametrize(
    "body",
    [Lattice.disk(1099, 0), Lattice.from_points(ROUND), Lattice.from_points(GRID)],
    ids=["disk", "hexagonal", "square"],
)
def test_points_keep_their_numbers_and_make_the_same_body_in_any_order(body):
    order = np.random.default_rng(0).permutation(len(body.positions))
    again = Lattice.from_points(body.positions[order])
    assert (again.positions == body.positions[order]).all()
    bonds = np.sort(order[again.bonds], axis=1)
    assert (bonds[np.lexsort(bonds.T[::-1])] == body.bonds).all()
    assert set(order[again.disk_surface]) == set(body.disk_surface)
    assert again.masses == pytest.approx(body.masses)


@pytest.mark.parametrize("digits", [16, 3])
def test_round_hexagonal_lattice_has_no_spring_beyond_second_neighbours(digits):
    lattice = Lattice.from_points(ROUND.round(digits))
    assert_tiles(lattice.positions, lattice.triangles, lattice.disk_surface)
    assert lattice.rest_lengths.max() < 1.75 / 8
    # All first neighbours are joined: no part of the lattice itself is a sliver.
    neighbours = cKDTree(ROUND).query_pairs(1.01 / 8)
    assert (lattice.rest_lengths < 1.01 / 8).sum() == len(neighbours)


def test_wide_triangles_of_points_at_random_are_dropped_and_nothing_else():
    literal = Lattice.disk(1099, 0, rim=False, min_spacing=0.0)
    lattice = Lattice.from_points(literal.positions)
    assert_tiles(lattice.positions, lattice.triangles, lattice.disk_surface)
    assert literal.rest_lengths.max() > 8 * np.median(literal.rest_lengths)
    assert lattice.rest_lengths.max() < 5 * np.median(lattice.rest_lengths)
    lost = len(literal.triangles) - len(lattice.triangles)
    assert 0 < lost < 0.03 * len(literal.triangles)
    assert lattice.whole


@pytest.mark.parametrize("rise", [-1, 1])
def test_custom_springs_enclose_triangles_and_keep_their_rest_lengths(rise):
    springs = CROSSED[rise * RISE < 1e-9]
    rest = 1.0 + np.arange(len(springs))
    lattice = Lattice.from_points(GRID, springs[:, ::-1], rest)
    assert len(lattice.triangles) == 128
    assert_tiles(lattice.positions, lattice.triangles, lattice.disk_surface)
    given = dict(zip(map(tuple, np.sort(springs).tolist()), rest, strict=True))
    bonds = map(tuple, lattice.bonds.tolist())
    assert dict(zip(bonds, lattice.rest_lengths, strict=True)) == given


def test_springs_that_cross_are_taken_with_triangles():
    corners = Lattice.from_points(GRID).triangles
    lattice = Lattice.from_points(GRID, CROSSED, triangles=corners)
    assert (lattice.triangles == corners).all()
    assert len(lattice.bonds) == len(CROSSED)


@pytest.mark.parametrize("hole", [0.0, 0.3])
def test_springs_of_a_disk_enclose_its_triangles(hole):
    disk = Lattice.disk(300, 1, hole=hole)
    again = Lattice.from_points(disk.positions, disk.bonds)
    corners = {frozenset(three) for three in again.triangles.tolist()}
    assert corners == {frozenset(three) for three in disk.triangles.tolist()}


ONES = np.ones(81)


def spoilt(place, value):
    """Return arrays of the slanted grid, of which one has a `value` at `place`."""
    springs = np.ones(len(SLANTED))
    arrays = {"masses": ONES, "stiffness": springs, "rest_lengths": springs}
    name, number = place
    return GRID, {"springs": SLANTED, name: changed(arrays[name], number, value)}


TWO = np.concatenate([0.2 * ROUND - [0.8, 0], 0.2 * ROUND + [0.8, 0]])
BOW_TIE = np.array([[0, 0], [1, -1], [1, 1], [-1, 1], [-1, -1]])
NO_DISKS = [
    (ROUND[:, 0], {}, "shape (n, 2)"),
    (["a"], {}, "array of real numbers"),
    (10**400, {}, "array of real numbers"),
    ([[1j, 0.0]] * 5, {}, "array of real numbers"),
    (ROUND[:2], {}, "n from 3 to 2000000, not (2, 2)"),
    (np.where(ROUND == 0, np.nan, ROUND), {}, "is not finite"),
    (ROUND * 10, {}, "extend over 20 x"),
    (ROUND + [1.0, 5.0], {}, "x = 1 R"),
    (np.append(ROUND, ROUND[7:8] + 1e-6, axis=0), {}, "points 7 and 241 are the same"),
    (np.linspace(-1, 1, 9)[:, None] * [1, 0.5], {}, "one line"),
    (TWO, {}, "do not form one connected piece"),
    (BOW_TIE, {"triangles": [[0, 1, 2], [0, 3, 4]]}, "share only single points"),
    (BOW_TIE, {"triangles": [[1, 2, 3], [0, 3, 4], [0, 4, 1]]}, "middle of a side"),
    (RIM, {}, "is no corner of a triangle"),
    (GRID, {"springs": CROSSED}, "give `triangles`, as springs that cross need"),
    (GRID, {"springs": CROSSED + 0.5}, "whole numbers"),
    (GRID, {"springs": CROSSED + 1}, "of 0 to 80"),
    (GRID, {"springs": CROSSED * 0}, "joins [0, 0]"),
    (GRID, {"springs": [*CROSSED, CROSSED[0, ::-1]]}, "joined already"),
    (GRID, {"springs": NEAREST}, "point 0 at (-1, -1) is no corner"),
    (GRID, {"springs": SLANTED, "rest_lengths": ONES[:3]}, "shape"),
    (*spoilt(("rest_lengths", 0), 0.0), "rest_lengths[0] is 0"),
    (*spoilt(("rest_lengths", 7), 1e300), "rest_lengths[7]"),
    (GRID, {"rest_lengths": ONES[:3]}, "rest_lengths without springs"),
    (*spoilt(("stiffness", 0), -1.0), "stiffness[0] is"),
    (GRID, {"springs": SLANTED, "stiffness": ONES}, "stiffness must have the shape"),
    (GRID, {"stiffness": ONES}, "stiffness without springs"),
    (GRID, {"masses": 0 * ONES}, "masses[0] is 0"),
    (GRID, {"masses": ONES[1:]}, "masses must have the shape (81,)"),
    (*spoilt(("masses", 5), 1e300), "masses[5] is 1e+300"),
    (*spoilt(("masses", 5), 1e-20), "1e-20: it must be a positive number, from 1e-15"),
    (GRID, {"triangles": np.empty((0, 3), int)}, "no triangles"),
    (GRID, {"triangles": [[0, 0, 0]]}, "triangle 0, [0, 0, 0], is flat"),
    (
        GRID,
        {"triangles": 3 * [[0, 1, 9], [1, 10, 9]]},
        "triangle 2, [0, 1, 9], and triangle 0, [0, 1, 9], overlap",
    ),
    (GRID, {"triangles": CELLS + 80}, "3 points of 0 to 80"),
    (GRID, {"triangles": CELLS * 1.0}, "whole numbers"),
    (GRID, {"triangles": CELLS[:, :2]}, "whole numbers of shape"),
    (GRID, {"springs": NEAREST, "triangles": CELLS}, "has a side that is no spring"),
]


@pytest.mark.parametrize(("points", "arrays", "message"), NO_DISKS)
def test_points_that_make_no_disk_are_refused_with_the_place(points, arrays, message):
    with pytest.raises(InputError, match=re.escape(message)):
        Lattice.from_points(points, **arrays)


def test_the_disk_of_a_runs_lattice_is_read_from_npz(tmp_path):
    core = {"core_radius": 0.6, "core_stiffness": 3.0, "core_density": 2.0}
    plain = Lattice.disk(200, 0, **core)
    both = with_wall(plain, 300, 3.0, 0)
    names = ("positions", "bonds", "rest_lengths", "masses", "disk_points", "stiffness")
    np.savez(tmp_path / "lattice.npz", **{name: getattr(both, name) for name in names})
    disk = Lattice.read(str(tmp_path / "lattice.npz"))
    assert (disk.positions == both.positions[:200]).all()
    for name in ("bonds", "rest_lengths", "masses", "stiffness"):
        assert (getattr(disk, name) == getattr(plain, name)).all()
    np.savez(tmp_path / "a.npz", points=plain.positions, springs=plain.bonds[::-1])
    again = Lattice.read(tmp_path / "a.npz")
    assert (again.positions == plain.positions).all()
    assert (again.bonds == plain.bonds).all()
    np.savez(tmp_path / "a.npz", positions=ROUND, mass=np.ones(len(ROUND)))
    with pytest.raises(InputError, match=r"a\.npz: mass is .* did you mean masses"):
        Lattice.read(tmp_path / "a.npz")
    short = {name: getattr(both, name) for name in ("positions", "bonds")}
    short |= {"rest_lengths": both.rest_lengths[:3], "disk_points": disk.disk_points}
    np.savez(tmp_path / "short.npz", **short)
    with pytest.raises(InputError, match=r"short\.npz"):
        Lattice.read(tmp_path / "short.npz")
    np.savez(tmp_path / "a.npz", x=ROUND)
    with pytest.raises(InputError, match="x is no array of a lattice"):
        Lattice.read(tmp_path / "a.npz")
    np.savez(tmp_path / "final.npz", positions=ROUND, velocities=ROUND, t=1.0)
    with pytest.raises(InputError, match=r"whose lattice is in lattice.npz; a run"):
        Lattice.read(tmp_path / "final.npz")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.csv", None, "No such file"),
        ("a.svg", b"<svg/>", "name a drawing (.svg) as lattice.outline, or give"),
        ("a.csv", b"x,y\n0,0\n1,2,3\n", "line 3 has 3 columns"),
        ("a.csv", b"0,0\n\xfc", ":2: not UTF-8 text (byte 0xfc): save it as UTF-8"),
        ("a.npz", b"PK", "not a zip file"),
    ],
)
def test_files_that_hold_no_disk_are_refused_by_name(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=re.escape(message)) as refusal:
        Lattice.read(tmp_path / name)
    assert str(tmp_path / name) in str(refusal.value)


@pytest.mark.parametrize("offset", [[0.0, 1e6], [0.0, -1000.0], [0.0, 2.0]])
@pytest.mark.parametrize(
    "points",
    [ROUND, GRID, *(Lattice.disk(n, n, rim=n > 200).positions for n in (60, 250))],
)
def test_a_body_that_lies_far_away_gets_the_same_springs(points, offset):
    points = points - [points[:, 0].mean(), 0.0]
    near = Lattice.from_points(points)
    far = Lattice.from_points(points + offset)
    assert (far.bonds == near.bonds).all()
    assert (far.disk_surface == near.disk_surface).all()
    assert (far.positions == near.positions + offset).all()
    again = Lattice.from_points(points + offset, far.bonds)
    assert (again.rest_lengths == far.rest_lengths).all()


DISK = Lattice.disk(50)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("positions", changed(DISK.positions, (7, 1), np.nan), "point 7 is not finite"),
        ("bonds", changed(DISK.bonds, (-1, 1), 50), "must join 2 points of 0 to 49"),
        ("bonds", DISK.bonds[:-1], "has a side that is no spring"),
        ("rest_lengths", changed(DISK.rest_lengths, 0, 0.0), "rest_lengths[0] is 0"),
        ("masses", -DISK.masses, "must add up to 1 M, not -1"),
        ("triangles", DISK.triangles + np.int32(49), "must join 3 points of 0 to 49"),
    ],
)
def test_a_lattice_is_checked_when_a_run_takes_it(name, value, message):
    section = load_scene("exponential_wall").lattice
    with pytest.raises(InputError, match=re.escape(message)):
        own_start(section, replace(DISK, **{name: value}), None)


def test_a_lattice_gets_the_form_that_kernels_need():
    section = load_scene("exponential_wall").lattice
    for name, value in (
        ("positions", DISK.positions.tolist()),
        ("bonds", DISK.bonds.astype(np.int64)),
        ("bonds", DISK.bonds[:, ::-1].copy()),
        ("triangles", DISK.triangles[:, ::-1]),
        ("disk_surface", DISK.disk_surface + np.int32(50)),
    ):
        given = replace(DISK, **{name: value})
        assert own_start(section, given, None).digest == OwnStart(DISK).digest
    # Springs may be listed in any order.
    rest = 1.0 + np.arange(len(DISK.bonds))
    expected = replace(DISK, rest_lengths=rest)
    shuffled = np.random.default_rng(0).permutation(len(rest))
    given = replace(DISK, bonds=DISK.bonds[shuffled], rest_lengths=rest[shuffled])
    assert own_start(section, given, None).digest == OwnStart(expected).digest


def test_a_wide_hole_stays_open_and_a_notch_is_what_the_springs_leave():
    # Springs join first neighbours, 1/8 R, and second ones along the edges.
    ring = Lattice.from_points(RING)
    assert len(holes_of(ring)) == 1
    assert holes_of(ring)[0] == pytest.approx(np.pi * 0.6**2, rel=0.15)
    assert ring.rest_lengths.max() < 0.23
    assert len(ring.masses) == len(RING)
    assert Lattice.from_points(np.concatenate([RING, CENTRE])).whole
    two = ROUND[np.abs(np.hypot(np.abs(ROUND[:, 0]) - 0.5, ROUND[:, 1])) > 0.34]
    assert len(holes_of(Lattice.from_points(two))) == 2
    narrow = ROUND[np.hypot(*ROUND.T) > 0.2]  # a hole of less than 5 springs is bridged
    assert holes_of(Lattice.from_points(narrow)) == []
    near = cKDTree(narrow).query_pairs(1.01 / 8, output_type="ndarray")
    # unless the springs leave it open
    assert len(holes_of(Lattice.from_points(narrow, near))) == 1
    open_ring = RING[(np.abs(RING[:, 1]) > 0.08) | (RING[:, 0] < 0)]
    open_ring = open_ring - [open_ring[:, 0].mean(), 0.0]
    springs = cKDTree(open_ring).query_pairs(1.01 / 8, output_type="ndarray")
    lattice = Lattice.from_points(open_ring, springs)
    assert_tiles(lattice.positions, lattice.triangles, lattice.disk_surface)


def test_a_hole_of_five_springs_is_open():
    # circles through points of the hexagonal lattice: around a point, sqrt(7) springs
    # in radius, and around the middle of a triangle sqrt(16/3)
    wide = ROUND[np.hypot(*ROUND.T) > 2.5 / 8]
    assert len(holes_of(Lattice.from_points(wide))) == 1
    middle = np.array([1.0, np.sqrt(1 / 3)]) / 16
    narrow = ROUND[np.hypot(*(ROUND - middle).T) > 2.2 / 8]
    assert holes_of(Lattice.from_points(narrow)) == []


def test_custom_triangles_stiffness_and_masses_follow_their_points_and_springs():
    masses = 1.0 + np.arange(81)
    by_sides = Lattice.from_points(GRID, triangles=CELLS[:, ::-1], masses=masses)
    assert (by_sides.masses == masses / masses.sum()).all()
    assert holes_of(by_sides) == [pytest.approx(1 / 16)]
    assert by_sides.masses.sum() == pytest.approx(1.0, abs=1e-14)
    springs = by_sides.bonds
    order = np.random.default_rng(0).permutation(len(springs))
    factor = 1.0 + springs.sum(axis=1)
    again = Lattice.from_points(
        GRID, springs[order], stiffness=factor[order], triangles=CELLS
    )
    assert (again.stiffness == factor).all()
    assert len(again.triangles) == len(CELLS) == len(by_sides.triangles)
    assert np.ptp(again.masses) == 0.0


@pytest.mark.parametrize("name", ["a.csv", "a.npz"])
def test_only_a_file_of_a_sensible_size_is_read(tmp_path, name):
    path = tmp_path / name
    path.touch()
    os.truncate(path, 10**12)
    with pytest.raises(InputError, match=f"{name}: is larger than 500 MB"):
        Lattice.read(path)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(InputError, match=f"{name}: is a device or a pipe"):
        Lattice.read(path)


def numpy_file(shape, numbers):
    file = io.BytesIO()
    header = {"shape": shape, "fortran_order": False, "descr": "<f8"}
    np.lib.format.write_array_header_1_0(file, header)
    return file.getvalue() + bytes(8 * numbers)


@pytest.mark.parametrize(
    ("shape", "numbers", "message"),
    [((10**12, 2), 6, "Unable to allocate"), ((10**5, 2), 2 * 10**5, "more than 1 MB")],
)
def test_an_array_that_claims_all_memory_is_refused_before_it_is_read(
    tmp_path, monkeypatch, shape, numbers, message
):
    monkeypatch.setattr(files, "MAX_BYTES", 10**6)
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("positions.npy", numpy_file(shape, numbers))
    with pytest.raises(InputError, match=message):
        Lattice.read(tmp_path / "a.npz")


@pytest.mark.parametrize("number", [-1, 242, 2.5, [1, 2], "a", np.inf])
def test_a_file_s_number_of_points_is_one_it_has(tmp_path, number):
    np.savez(tmp_path / "a.npz", positions=ROUND, disk_points=number)
    text = r"a\.npz: disk_points: must be a whole number from 0 to 241"
    with pytest.raises(InputError, match=text):
        Lattice.read(tmp_path / "a.npz")


def test_masses_whose_sum_is_1_within_rounding_keep_their_bits():
    rng = np.random.default_rng(1)
    sums = []
    for _ in range(10):
        once = Lattice.from_points(GRID, masses=rng.random(len(GRID)))
        again = Lattice.from_points(GRID, masses=once.masses)
        assert (again.masses == once.masses).all()
        sums.append(math.fsum(once.masses))
    assert any(total != 1.0 for total in sums)
