"""Holds, structures and their files."""

from __future__ import annotations

import pickle
from math import cos, pi, radians, sin
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from tests.walking.trials.structures import surface_of
from wbc.clearance import Motion, Pair, Sweeper, SweptBody, SweptScene, Tree, TriangleMesh
from wbc.errors import DuplicateNameError, NotFiniteError, RangeError, RotationError, ShapeError, UnknownNameError
from wbc.shapes import Box, Capsule, Cylinder, HalfSpace, Sphere
from wbc.walking import (
    CylinderSurface,
    Hold,
    Obstacle,
    PlaneSurface,
    Structure,
    StructureFileError,
    cylinder,
    module,
    parse_structure,
    plane,
    read_structure,
    remove_columns,
    remove_fraction,
    remove_rows,
    save_structure,
    truss,
)
from wbc.walking.holds.built_in import BUILT_IN, INCH, grid_pose

ALL = {name: make() for name, make in BUILT_IN.items()}
POSE = pin.SE3(pin.utils.rotate("x", 0.7) @ pin.utils.rotate("z", -1.1), np.array([0.3, -2.0, 5.0]))


@pytest.mark.parametrize("name", ALL)
def test_built_in_structures_are_compliant_and_sound(name: str) -> None:
    structure = ALL[name]
    assert structure.name == name
    for hold in structure:
        np.testing.assert_allclose(hold.pose.rotation.T @ hold.pose.rotation, np.eye(3), atol=1e-14)
        assert (hold.roll, hold.max_tilt) == ("free", 0.05)
    # Grasp points lie on the structure, and the way out of every one of them is open
    np.testing.assert_allclose(structure.clearance(structure.positions), 0.0, atol=1e-12)
    lifted = structure.positions - 3 * INCH * structure.axes
    np.testing.assert_allclose(structure.clearance(lifted), 3 * INCH, atol=1e-12)
    apart = np.linalg.norm(structure.positions[:, None] - structure.positions[None], axis=-1)
    assert apart[np.triu_indices(len(structure), 1)].min() > 0.1


def test_plane_and_module_and_truss_have_their_sizes() -> None:
    np.testing.assert_allclose(plane(3, 4, 0.5)["3,4"].position, [2.0, 1.5, 0.0])
    assert len(plane(3, 4)) == 12
    assert np.hypot(*ALL["module"]["15,0"].position[1:]) == pytest.approx(2.17)
    assert len(module(length=4.0)) < len(ALL["module"])
    assert [type(obstacle.shape) for obstacle in ALL["module"].obstacles] == [Box, Box, Box]
    assert {type(obstacle.shape) for obstacle in ALL["truss"].obstacles} == {Capsule}
    assert truss(bays=2)["L1,8"].position[0] == pytest.approx(2 * 0.94)
    assert cylinder(rigid=True)["1,1"].max_tilt == 0.0


def test_rows_columns_and_fractions_can_go() -> None:
    grid = ALL["cylinder"]
    less = remove_rows(grid, "12-14")
    assert len(less) == 600 - 75
    assert not {f"{t},{a}" for t in range(1, 26) for a in (12, 13, 14)} & set(less.ids)
    assert remove_rows(grid, 12).ids == remove_rows(grid, "12").ids
    assert len(remove_columns(grid, "1-2, 25")) == 600 - 72
    assert "3,12" in remove_columns(grid, "1-2,25")
    assert remove_columns(grid, 3).surface is grid.surface
    thinned = remove_fraction(grid, 0.3, seed=4)
    assert len(thinned) == 420
    assert thinned.ids == remove_fraction(grid, 0.3, seed=4).ids
    assert thinned.ids != remove_fraction(grid, 0.3, seed=5).ids
    assert remove_fraction(grid, 0.0).ids == grid.ids
    for bad in ("14-12", "a", "", "12-", "30"):
        with pytest.raises(RangeError, match="rows"):
            remove_rows(grid, bad)
    with pytest.raises(ShapeError, match="columns"):
        remove_columns(grid, 1.5)
    with pytest.raises(RangeError, match="named by two whole numbers"):
        remove_rows(ALL["truss"], "1")
    with pytest.raises(RangeError, match="fraction"):
        remove_fraction(grid, 1.5)
    with pytest.raises(ShapeError, match="at least one hold"):
        remove_fraction(grid, 1.0)


def test_holds_are_found_by_id() -> None:
    grid = ALL["cylinder"]
    assert grid["13,12"].id == "13,12"
    assert grid.index("1,2") == 1
    assert "25,24" in grid
    assert "26,1" not in grid
    with pytest.raises(UnknownNameError) as caught:
        grid["13,25"]
    assert caught.value.choices[0] in ("13,2", "13,5", "13,12", "13,15", "13,20", "13,24")
    with pytest.raises(UnknownNameError):
        grid.without(["1,1", "x"])
    with pytest.raises(ShapeError):
        grid.without("1,1")
    assert len(grid.without(["1,1", "1,1", "2,2"])) == 598
    k = grid.index("7,9")
    hold = grid["7,9"]
    np.testing.assert_array_equal(grid.positions[k], hold.position)
    np.testing.assert_array_equal(grid.axes[k], hold.axis)
    np.testing.assert_array_equal(grid.frames[k], hold.pose.homogeneous)
    np.testing.assert_array_equal(grid.references[k], hold.pose.rotation[:, 0])
    with pytest.raises(ValueError, match="read-only"):
        grid.positions[0] = 0.0


@pytest.mark.parametrize("name", ALL)
def test_a_moved_structure_keeps_its_clearances(name: str) -> None:
    structure = ALL[name]
    moved = structure.moved(POSE)
    rng = np.random.default_rng(1)
    points = structure.positions[rng.integers(len(structure), size=50)] + rng.normal(size=(50, 3)) * 0.5
    there = np.array([POSE.act(point) for point in points])
    np.testing.assert_allclose(moved.clearance(there), structure.clearance(points), atol=1e-12)
    np.testing.assert_allclose(moved.axes, structure.axes @ POSE.rotation.T, atol=1e-14)
    assert moved.digest != structure.digest == structure.moved(np.eye(4)).digest


def test_clearances_by_hand() -> None:
    surface = CylinderSurface(pin.SE3(pin.utils.rotate("y", pi / 2), np.zeros(3)), 2.0)
    np.testing.assert_allclose(surface.height(np.array([[5.0, 0.0, 3.0], [1.0, 1.0, 0.0]])), [1.0, -1.0])
    np.testing.assert_allclose(surface.normal(np.array([5.0, 0.0, 3.0])), [0, 0, 1], atol=1e-15)
    assert np.linalg.norm(surface.normal(np.zeros(3))) == pytest.approx(1.0)
    tilted = PlaneSurface(POSE)
    np.testing.assert_allclose(tilted.height(POSE.act(np.array([3.0, 1.0, -0.4]))), -0.4)
    np.testing.assert_allclose(tilted.normal(np.zeros((2, 3))), np.tile(POSE.rotation[:, 2], (2, 1)))
    box = Obstacle("box", Box((2.0, 4.0, 6.0)), POSE)
    inside = [(0.9, 0.0, 0.0, -0.1), (2.0, 3.0, 0.0, 2**0.5), (0.0, 0.0, 3.5, 0.5), (1.0, 1.0, 1.0, 0.0)]
    for *point, distance in inside:
        assert float(box.distance(POSE.act(np.array(point)))) == pytest.approx(distance, abs=1e-12)
    pipe = Obstacle("pipe", Capsule(0.5, 2.0), POSE)
    for *point, distance in [(1.5, 0.0, 0.7, 1.0), (0.0, 0.0, 2.5, 1.0), (0.3, 0.0, 0.0, -0.2)]:
        assert float(pipe.distance(POSE.act(np.array(point)))) == pytest.approx(distance, abs=1e-12)


@pytest.mark.parametrize("name", ALL)
def test_clearance_of_segments_is_the_least_of_their_points(name: str) -> None:
    structure = ALL[name].moved(POSE)
    rng = np.random.default_rng(2)
    a = structure.positions[rng.integers(len(structure), size=40)] + rng.normal(size=(40, 3)) * 0.4
    b = a + rng.normal(size=(40, 3)) * 0.6
    b[:3] = a[:3]
    found = structure.segment_clearance(a, b)
    share = np.linspace(0.0, 1.0, 801)[:, None, None]
    sampled = structure.clearance(a + share * (b - a)).min(axis=0)
    # A signed distance changes by no more than the way, so between two samples by half a step
    step = np.linalg.norm(b - a, axis=1) / 800
    assert (found <= sampled + 1e-9).all()
    assert (found >= sampled - step / 2 - 1e-9).all()
    np.testing.assert_allclose(structure.segment_clearance(b, a), found, atol=1e-8)
    np.testing.assert_allclose(structure.segment_clearance(a, a), structure.clearance(a), atol=1e-7)


def test_without_a_surface_the_nearest_hold_has_a_tangent_plane() -> None:
    low = Hold("low", pin.SE3(pin.utils.rotate("x", pi), np.zeros(3)))
    high = Hold("high", pin.SE3(pin.utils.rotate("x", pi), np.array([5.0, 0.0, 1.0])))
    structure = Structure("two", (low, high))
    np.testing.assert_allclose(structure.clearance([[0.3, 0.2, 0.4], [4.9, 0.0, 0.4]]), [0.4, -0.6], atol=1e-15)
    assert structure.clearance([0.0, 0.0, 2.0]).shape == ()
    assert float(structure.segment_clearance([0.3, 0.2, 0.4], [0.3, 0.2, 0.1])) == pytest.approx(0.1)


def test_rolls() -> None:
    pose = pin.SE3.Identity()
    assert Hold("a", pose).rolls == ()
    assert Hold("a", pose, "fixed").rolls == (0.0,)
    np.testing.assert_allclose(Hold("a", pose, 4).rolls, [0, pi / 2, pi, 3 * pi / 2])
    for bad in (1, 0, -2, 361, True, 2.5, "loose"):
        with pytest.raises(RangeError, match="roll"):
            Hold("a", pose, bad)  # type: ignore[arg-type]


def test_bad_holds_and_structures_are_refused() -> None:
    pose = pin.SE3.Identity()
    for bad in ("", " ", " a", "a\nb", 3):
        with pytest.raises(ShapeError, match="id"):
            Hold(bad, pose)  # type: ignore[arg-type]
    with pytest.raises(RangeError, match="max_tilt"):
        Hold("a", pose, "free", -0.1)
    with pytest.raises(NotFiniteError, match="max_tilt"):
        Hold("a", pose, "free", np.nan)
    with pytest.raises(RotationError, match="pose"):
        Hold("a", pin.SE3(np.diag([1.0, 1.0, -1.0]), np.zeros(3)))
    with pytest.raises(DuplicateNameError, match="a"):
        Structure("s", (Hold("a", pose), Hold("a", pose)))
    with pytest.raises(ShapeError, match="obstacles"):
        Structure("s", (Hold("a", pose),), (Box((1.0, 1.0, 1.0)),))  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="shape"):
        Obstacle("floor", HalfSpace(), pose)  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="'sail': expected a closed mesh"):
        Obstacle("sail", TriangleMesh(np.eye(3)[None]), pose)
    with pytest.raises(ShapeError, match="points"):
        ALL["plane"].clearance([1.0, 2.0])


def cluttered() -> Structure:
    """One obstacle of each kind."""
    rng = np.random.default_rng(5)
    shapes = (
        Box((0.3, 0.2, 0.5)), Capsule(0.1, 0.4), Sphere(0.3), Cylinder(0.2, 0.5),
        TriangleMesh(surface_of(rng.normal(size=(40, 3)) * 0.3), solid=True),
    )  # fmt: skip
    there = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3)) for _ in shapes]
    obstacles = [Obstacle(f"{k}", shape, place) for k, (shape, place) in enumerate(zip(shapes, there, strict=True))]
    return Structure("clutter", (Hold("h", pin.SE3.Identity()),), tuple(obstacles))


@pytest.mark.parametrize("kind", range(5))
def test_distances_of_obstacles_are_those_of_the_swept_proof(kind: int) -> None:
    """Segments are capsules without a radius, for which wbc.clearance has an exact distance of its own."""
    rng = np.random.default_rng([6, kind])
    obstacle = cluttered().obstacles[kind]
    a = obstacle.placement.translation + rng.normal(size=(120, 3)) * rng.choice([0.15, 0.5], (120, 1))
    b = a + rng.normal(size=(120, 3)) * 0.4
    found, points, through = obstacle.segment_distance(a, b), obstacle.distance(a), 0
    tree = Tree.of_model(pin.Model())
    sizes = np.linalg.norm(b - a, axis=1)
    for k in range(len(a)):
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (b[k] - a[k]) / sizes[k]).matrix()
        core = SweptBody("core", Capsule(0.0, sizes[k]), placement=pin.SE3(turn, (a[k] + b[k]) / 2))
        point = SweptBody("point", Sphere(0.0), placement=pin.SE3(np.eye(3), a[k]))
        thing = SweptBody("thing", obstacle.shape, placement=obstacle.placement)
        scene = SweptScene(tree, [core, point, thing], [Pair("core", "thing"), Pair("point", "thing")])
        exact, at_point = Sweeper(scene).at(Motion.linear(tree, [0.0, 1.0], np.zeros((2, 0))), 0.0)
        # The depth of a body that is partly inside is another thing than that of its deepest point
        if found[k] > 0.0 or exact.distance > 0.0:
            assert found[k] == pytest.approx(exact.distance, abs=1e-8)
        else:
            through += 1
        assert points[k] == pytest.approx(at_point.distance, abs=1e-8)
    assert 5 < through < 115


def test_obstacles_of_every_kind_survive_a_file(tmp_path: Path) -> None:
    structure = cluttered()
    back = read_structure(save_structure(structure, tmp_path / "all, of it.csv"))
    assert (tmp_path / "all__of_it-5.stl").is_file()
    assert [o.shape for o in back.obstacles[:4]] == [o.shape for o in structure.obstacles[:4]]
    points = np.random.default_rng(7).normal(size=(200, 3))
    np.testing.assert_allclose(back.clearance(points), structure.clearance(points), atol=1e-12)
    # A mesh of a file has the precision of the file, so that it is written the same again
    again = read_structure(save_structure(back, tmp_path / "other.csv"))
    text = (tmp_path / "other.csv").read_text()
    np.testing.assert_allclose(again.clearance(points), structure.clearance(points), atol=1e-12)
    (tmp_path / "larger.csv").write_text(text.replace("other-5.stl,,", "other-5.stl,2,"))
    larger = read_structure(tmp_path / "larger.csv")
    shapes = [one.obstacles[4].shape for one in (larger, again)]
    assert isinstance(shapes[0], TriangleMesh)
    assert isinstance(shapes[1], TriangleMesh)
    np.testing.assert_allclose(shapes[0].corners, 2.0 * shapes[1].corners, atol=1e-6)
    assert pickle.loads(pickle.dumps(again)).digest == again.digest != larger.digest


@pytest.mark.parametrize(
    ("cells", "made", "field", "said"),
    [
        ("none.stl,,", b"", "line 6: d1", "no such file"),
        ("x" * 300 + ".stl,,", b"", "line 6: d1", "no such file"),
        ("rock.obj,,", b"", "line 6: d1", "expected an STL file"),
        (",,", b"", "line 6: d1", "expected a text"),
        ("bad.stl,,", b"solid nothing", "line 6: d1", ""),
        ("bad.stl,,", b"", "line 6: d1", ""),
        ("bad.stl,,", bytes(80) + b"\x09\0\0\0" + bytes(70), "line 6: d1", ""),
        ("open.stl,,", b"", "line 6: d1", "open"),
        ("open.stl,0,", b"", "line 6: d2", "scale above 0"),
        ("open.stl,inches,", b"", "line 6: d2", "expected a number"),
        ("open.stl,1,2", b"", "line 6: d3", "a file and a scale"),
    ],
)
def test_meshes_that_cannot_be_read_are_named(cells: str, made: bytes, field: str, said: str, tmp_path: Path) -> None:
    file = save_structure(cluttered(), tmp_path / "good.csv")
    stl = (tmp_path / "good-5.stl").read_bytes()
    (tmp_path / "bad.stl").write_bytes(made)
    # The last triangle left out
    count = int.from_bytes(stl[80:84], "little") - 1
    (tmp_path / "open.stl").write_bytes(stl[:80] + count.to_bytes(4, "little") + stl[84:-50])
    lines = file.read_text().splitlines()
    text = "\n".join([*lines[:5], lines[-1].replace("good-5.stl,,", cells)])
    (tmp_path / "one.csv").write_text(text)
    with pytest.raises(StructureFileError) as caught:
        read_structure(tmp_path / "one.csv")
    assert caught.value.field == field
    assert said in str(caught.value)


@pytest.mark.parametrize("name", ALL)
def test_files_give_structures_back(name: str, tmp_path: Path) -> None:
    structure = ALL[name].moved(POSE)
    back = read_structure(save_structure(structure, tmp_path / "file.csv"))
    assert (back.name, back.ids) == ("file", structure.ids)
    np.testing.assert_allclose(back.frames, structure.frames, atol=1e-14)
    np.testing.assert_array_equal(back.tilts, structure.tilts)
    assert [o.id for o in back.obstacles] == [o.id for o in structure.obstacles]
    assert [o.shape for o in back.obstacles] == [o.shape for o in structure.obstacles]
    points = structure.positions[:20] + 0.3
    np.testing.assert_allclose(back.clearance(points), structure.clearance(points), atol=1e-12)
    assert pickle.loads(pickle.dumps(structure)).digest == structure.digest


GOOD = """# a small one
id, x, y, z, ax, ay, az, rx, ry, rz, roll, max_tilt
h1, 0, 0, 0, 0, 0, -2, 1, 0, 5, free, 0.05

"the second, h2", 0.5, 0, 0, 0, 0, -1, 1, 0, 0, 4, 0

[obstacles]
id, shape, x, y, z, ax, ay, az, rx, ry, rz, d1, d2, d3
tank, box, 1, 0, 0.2, 0, 0, 1, 1, 1, 0, 0.3, 0.3, 0.4
pipe, capsule, 2, 0, 0.1, 1, 0, 0, 0, 0, 1, 0.05, 1.5,
[surface]
shape, x, y, z, ax, ay, az, rx, ry, rz, d1
plane, 0, 0, 0, 0, 0, 1, 1, 0, 0,
"""


def test_a_file_by_hand() -> None:
    structure = parse_structure(GOOD)
    assert structure.ids == ("h1", "the second, h2")
    np.testing.assert_allclose(structure["h1"].pose.rotation, np.diag([1.0, -1.0, -1.0]), atol=1e-15)
    assert structure["the second, h2"].roll == 4
    tank, pipe = structure.obstacles
    assert tank.shape == Box((0.3, 0.3, 0.4))
    np.testing.assert_allclose(tank.placement.rotation[:, 0], [0.5**0.5, 0.5**0.5, 0.0], atol=1e-15)
    assert pipe.shape == Capsule(0.05, 1.5)
    np.testing.assert_allclose(pipe.placement.rotation[:, 2], [1, 0, 0], atol=1e-15)
    assert isinstance(structure.surface, PlaneSurface)
    round_ = parse_structure(
        GOOD.replace("plane, 0, 0, 0, 0, 0, 1, 1, 0, 0,", "cylinder, 0, 0, 0, 0, 0, 1, 1, 0, 0, 2.5")
    )
    assert isinstance(round_.surface, CylinderSurface)
    assert round_.surface.radius == 2.5


def test_any_id_survives_a_file(tmp_path: Path) -> None:
    ids = ("#1", "[obstacles]", "a,b", 'say "hi"', '"', "é 2", "id", "-")
    structure = Structure("s", tuple(Hold(name, pin.SE3.Identity(), 3) for name in ids))
    back = read_structure(save_structure(structure, tmp_path / "file.csv"))
    assert back.ids == ids
    assert {hold.roll for hold in back} == {3}


def test_garbled_files_raise_nothing_else() -> None:
    rng = np.random.default_rng(3)
    signs = list('0123456789.,-e"#[]\n x\x00') + ["nan", "inf", "free", "[surface]", "1e400", "\u2028"]
    refused = 0
    for _ in range(400):
        text = GOOD
        for _ in range(rng.integers(1, 4)):
            k = int(rng.integers(len(text)))
            text = text[:k] + signs[int(rng.integers(len(signs)))] + text[k + int(rng.integers(3)) :]
        try:
            assert len(parse_structure(text)) > 0
        except StructureFileError:
            refused += 1
    assert 100 < refused < 400


def test_the_page_shows_a_file_that_is_read() -> None:
    page = (Path(__file__).parents[2] / "docs" / "walking.md").read_text()
    lines = page[page.index("    id, x, y") : page.index("(x, y, z) is the origin")].splitlines()
    structure = parse_structure("\n".join(line.strip() for line in lines))
    assert (structure.ids, len(structure.obstacles)) == (("h1", "h2"), 4)
    with pytest.raises(StructureFileError) as caught:
        parse_structure("\n\n".join([lines[0].strip(), lines[1].strip().replace("0.05", "-0.05")]))
    assert str(caught.value) in page


@pytest.mark.parametrize(
    ("old", "new", "field", "said"),
    [
        ("h1, 0,", "h1, zero,", "line 3: x", "expected a number"),
        ("h1, 0,", "h1, nan,", "line 3: x", "finite"),
        ("h1, 0,", "h1, 1e999,", "line 3: x", "finite"),
        ("h1, 0,", ", 0,", "line 3: id", "expected a text"),
        ("free, 0.05", "free, -0.05", "line 3: max_tilt", "at least 0"),
        ("free, 0.05", "free, 3", "line 3: max_tilt", "[0, 1.5708]"),
        ("free, 0.05", "free", "line 3", "expected 12 values, not 11"),
        ("free, 0.05", "loose, 0.05", "line 3: roll", "fixed"),
        ("free, 0.05", "999999999, 0.05", "line 3: roll", "2 to 360"),
        ("free, 0.05", "4.0, 0.05", "line 3: roll", "2 to 360"),
        ("h1, 0,", "h\t1, 0,", "line 3: id", "on one line"),
        ("4, 0\n", "1, 0\n", "line 5: roll", "2 to 360"),
        ("0, 0, -2, 1, 0, 5", "0, 0, 0, 1, 0, 5", "line 3: ax, ay, az", "direction"),
        ("0, 0, -2, 1, 0, 5", "0, 0, -2, 0, 0, 5", "line 3: rx, ry, rz", "parallel"),
        ("0, 0, -2, 1, 0, 5", "0, 0, -2, 0, 0, 0", "line 3: rx, ry, rz", "direction"),
        ('"the second, h2"', "h1", "line 5: id", "two of this id"),
        ('"the second, h2"', '"the second', "line 5", "cannot be read"),
        ("id, x, y, z, ax", "id, x, y, ax", "line 2", "expected the columns"),
        ("[obstacles]", "[walls]", "line 7", "no such section"),
        ("tank, box", "tank, bull", "line 9: shape", "capsule"),
        ("0.3, 0.3, 0.4", "0.3, 0.3, 0", "line 9: d1, d2, d3", "expected a value"),
        ("0.05, 1.5,", "0.05, 1.5, 2", "line 10: d3", "2 sizes"),
        ("0.05, 1.5,", "0.05, -1.5,", "line 10: d2", "at least 0"),
        ("pipe, ", "tank, ", "line 10: id", "two of this id"),
        ("plane, 0", "saddle, 0", "line 13: shape", "cylinder"),
        ("1, 0, 0,\n", "1, 0, 0,\nplane, 0, 0, 0, 0, 0, 1, 1, 0, 0,\n", "line 14", "one surface"),
    ],
)
def test_bad_lines_are_named(old: str, new: str, field: str, said: str) -> None:
    assert GOOD.count(old) >= 1
    before, after = GOOD.rsplit(old, 1) if old.startswith("1, 0, 0,") else GOOD.split(old, 1)
    with pytest.raises(StructureFileError) as caught:
        parse_structure(before + new + after)
    assert caught.value.field == field
    assert said in str(caught.value)


def test_bad_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(StructureFileError, match="cannot be read"):
        read_structure(tmp_path / "none.csv")
    with pytest.raises(StructureFileError, match="no hold"):
        parse_structure("# nothing\n")
    with pytest.raises(StructureFileError, match="written"):
        save_structure(ALL["plane"], tmp_path / "no" / "folder.csv")
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(StructureFileError, match="cannot be read"):
        read_structure(binary)


def test_grid_poses_follow_the_heading() -> None:
    turned = grid_pose(10, 3, 2.0, heading=0.3)
    straight = grid_pose(10, 3, 2.0)
    np.testing.assert_allclose(turned.rotation[:, 2], straight.rotation[:, 2], atol=1e-15)
    expected = cos(0.3) * straight.rotation[:, 0] + sin(0.3) * straight.rotation[:, 1]
    np.testing.assert_allclose(turned.rotation[:, 0], expected, atol=1e-15)
    assert np.hypot(*turned.translation[:2]) == pytest.approx(2.0)
    # y is the direction of +T: that of the tangent where T grows
    ahead = grid_pose(10.001, 3, 2.0).translation - straight.translation
    np.testing.assert_allclose(ahead / np.linalg.norm(ahead), straight.rotation[:, 1], atol=radians(0.01))


def mounted(on: str, header: str = ", on") -> str:
    return f"""id, x, y, z, ax, ay, az, rx, ry, rz, roll, max_tilt{header}
a, 0,0,0, 0,0,-1, 1,0,0, free, 0.05, {on}
b, 1,0,0, 0,0,-1, 1,0,0, free, 0.05,

[obstacles]
id, shape, x, y, z, ax, ay, az, rx, ry, rz, d1, d2, d3
"bar, 1", sphere, 0,0,1, 0,0,1, 1,0,0, 0.1,,

[surface]
shape, x, y, z, ax, ay, az, rx, ry, rz, d1
plane, 0,0,0, 0,0,1, 1,0,0,
"""


def test_a_hold_says_what_it_is_mounted_on(tmp_path: Path) -> None:
    for on, row in (('"bar, 1"', 0), ("surface", -1), ("", -2)):
        made = parse_structure(mounted(on))
        assert made.mounts == (row, -2)
        again = read_structure(save_structure(made, tmp_path / "again.csv"))
        assert (again.mounts, again.digest) == (made.mounts, made.digest)
        assert made.moved(pin.SE3.Random()).mounts == made.without(["b"]).mounts + (-2,) == (row, -2)
    assert [path.name for path in tmp_path.iterdir()] == ["again.csv"]
    with pytest.raises(StructureFileError, match=r"line 2: on: neither an obstacle nor the surface.*valid: .*bar, 1"):
        parse_structure(mounted("bar 1"))
    with pytest.raises(StructureFileError, match="expected 12 values"):
        parse_structure(mounted("surface", header=""))
    with pytest.raises(UnknownNameError, match="hold a: on"):
        Structure("none", (Hold("a", pin.SE3.Identity(), on="there"),))
    with pytest.raises(ShapeError, match=r"Hold\.on"):
        Hold("a", pin.SE3.Identity(), on=" there")
    assert parse_structure(mounted("")).digest != parse_structure(mounted("surface")).digest
