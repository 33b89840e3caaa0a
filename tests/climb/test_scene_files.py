"""Scenes as files: what is read, written again and refused by line and column."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wbc.clearance import CylinderInside, EndlessCylinder, TriangleMesh
from wbc.climb import scene_files
from wbc.climb.grids import GRIDS, plane_grid
from wbc.climb.loop.records import scene_digest
from wbc.climb.scene import ClimbScene, Foothold, SceneBody
from wbc.climb.scene_files import read_scene, save_scene
from wbc.climb.scenes import draw, families
from wbc.errors import NotFiniteError, StructureFileError, WbcError
from wbc.shapes import Box, Capsule, Convex, Cylinder, Ellipsoid, HalfSpace, HeightMap, Sphere

POSE = pin.SE3(pin.utils.rotate("x", 0.7) @ pin.utils.rotate("z", -1.1), np.array([0.3, -2.0, 5.0]))
GOOD = """# a small one, of the columns that files had before
id, x, y, z, ax, ay, az, rx, ry, rz, roll, max_tilt
h1, 0, 0, 0, 0, 0, -2, 1, 0, 5, free, 0

"the second, h2", 0.5, 0, 5, 0, 0, -1, 1, 0, 0, 4, 0

[obstacles]
id, shape, x, y, z, ax, ay, az, rx, ry, rz, d1, d2, d3
tank, box, 1, 0, 0.2, 0, 0, 1, 1, 1, 0, 0.3, 0.3, 0.4
pipe, capsule, 2, 0, 0.1, 1, 0, 0, 0, 0, 1, 0.05, 1.5,
[surface]
shape, x, y, z, ax, ay, az, rx, ry, rz, d1
plane, 0, 0, 0, 0, 0, 1, 1, 0, 0,
"""


#: Header and first foothold of it
FIRST = "\n".join(GOOD.splitlines()[1:3])


def parsed(text: str, folder: Path, **given: Any) -> ClimbScene:
    """The scene in a text."""
    file = folder / "text.csv"
    file.write_text(text)
    return read_scene(file, **given)


def everything() -> ClimbScene:
    """One body of each kind, and footholds with all that they can say."""
    rng = np.random.default_rng(5)
    hull = Convex(rng.normal(size=(12, 3)))
    solid = TriangleMesh(outwards(hull), solid=True)
    shapes = [
        Box((0.3, 0.2, 0.5)), Capsule(0.1, 0.4), Sphere(0.3), Cylinder(0.2, 0.5), Ellipsoid((0.1, 0.2, 0.3)),
        HalfSpace(), EndlessCylinder(0.4), CylinderInside(7.0), hull, solid, TriangleMesh(solid.corners[1:]),
    ]  # fmt: skip
    bodies = {f"body {k}": SceneBody(shape, _drawn(rng)) for k, shape in enumerate(shapes)}
    ids = ("#1", "[obstacles]", "a,b", 'say "hi"', '"', "é 2", "id", "-")
    more: list[dict[str, Any]] = [
        {"on": "body 3"}, {"friction": 0.25}, {"limbs": ("left foot", "a, b")}, {"rolls": 1}, {"rolls": 360}, {}, {},
        {"on": "body 5", "friction": 1e-3, "limbs": ("x",), "rolls": 2},
    ]  # fmt: skip
    footholds = [Foothold(name, _drawn(rng), **given) for name, given in zip(ids, more, strict=True)]
    return ClimbScene(footholds, bodies, np.array([0.1, -0.2, -1.62]), "everything")


def outwards(hull: Convex) -> np.ndarray:
    """A hull's triangles, their corners counter-clockwise from outside ``(n, 3, 3)`` [m]."""
    corners = hull.triangles()
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turned = np.einsum("ij,ij->i", normals, corners[:, 0] - hull.center) < 0.0
    corners[turned] = corners[turned][:, ::-1]
    return corners


def _drawn(rng: np.random.Generator) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))


def told(scene: ClimbScene) -> list[Any]:
    """All of a scene but its numbers."""
    footholds = [(f.id, f.on, f.friction, f.limbs, f.rolls) for f in scene.footholds]
    return [*footholds, *((name, type(body.shape)) for name, body in scene.bodies.items())]


SCENES = {"everything": everything, **{name: lambda make=make: make().moved(POSE) for name, make in GRIDS.items()}}
SCENES |= {family: lambda family=family: draw(family, 0.6, 3).scene for family in families()}


@pytest.mark.parametrize("name", SCENES)
def test_files_give_scenes_back(name: str, tmp_path: Path) -> None:
    scene = SCENES[name]()
    back = read_scene(save_scene(scene, tmp_path / "all, of it.csv"))
    assert (back.name, told(back)) == ("all, of it", told(scene))
    np.testing.assert_array_equal(back.gravity, scene.gravity)
    for own, read in zip(scene.footholds, back.footholds, strict=True):
        np.testing.assert_allclose(read.pose.homogeneous, own.pose.homogeneous, atol=1e-15)
    for body, placed in scene.bodies.items():
        np.testing.assert_allclose(back.bodies[body].placement.homogeneous, placed.placement.homogeneous, atol=1e-15)
    # What was read is written and read again without a change, meshes included
    again = read_scene(save_scene(back, tmp_path / "other.csv"))
    assert scene_digest(again) == scene_digest(back)
    assert told(again) == told(back)
    assert all(x.pose == y.pose for x, y in zip(again.footholds, back.footholds, strict=True))


def test_a_file_by_hand(tmp_path: Path) -> None:
    scene = parsed(GOOD, tmp_path)
    assert [(f.id, f.on, f.rolls) for f in scene.footholds] == [("h1", "surface", 0), ("the second, h2", "", 4)]
    np.testing.assert_allclose(scene.footholds[0].pose.rotation, np.eye(3), atol=1e-15)
    assert [body.shape for body in scene.bodies.values()] == [Box((0.3, 0.3, 0.4)), Capsule(0.05, 1.5), HalfSpace()]
    np.testing.assert_allclose(scene.bodies["tank"].placement.rotation[:, 0], [0.5**0.5, 0.5**0.5, 0.0], atol=1e-15)
    np.testing.assert_allclose(scene.bodies["pipe"].placement.rotation[:, 2], [1, 0, 0], atol=1e-15)
    assert not scene.gravity.any()
    round_ = parsed(GOOD.replace("plane, 0, 0, 0, 0, 0, 1, 1, 0, 0,", "cylinder, 0,0,0, 0,0,1, 1,0,0, 2.5"), tmp_path)
    assert round_.bodies["surface"].shape == EndlessCylinder(2.5)
    minus = parsed(GOOD.replace("h1, 0", "h1, -0.0").replace("2, 0, 0.1, 1", "2, -0.0, 0.1, 1"), tmp_path)
    assert scene_digest(minus) == scene_digest(scene) == scene_digest(read_scene(save_scene(minus, tmp_path / "a.csv")))
    heavy = GOOD + "[gravity]\nx, y, z\n0, 0, -1.62\n"
    assert parsed(heavy, tmp_path).gravity.tolist() == [0.0, 0.0, -1.62]
    assert parsed(heavy, tmp_path, gravity=(1.0, 0.0, 0.0)).gravity.tolist() == [1.0, 0.0, 0.0]
    with pytest.raises(NotFiniteError, match="gravity"):
        parsed(heavy, tmp_path, gravity=(np.nan, 0.0, 0.0))


def test_the_form_that_the_module_shows_is_read(tmp_path: Path) -> None:
    lines = [line.strip() for line in (scene_files.__doc__ or "").splitlines() if line.startswith("    ")]
    scene = parsed("\n".join(lines), tmp_path)
    assert told(scene)[0] == ("h1", "floor", 0.7, ("left", "right"), 0)
    assert list(scene.bodies) == ["floor", "tank", "pipe"]


def test_a_tilt_that_is_allowed_and_not_used_is_said(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r"text: max_tilt: 1 footholds let limbs lean by up to 0\.05 rad"):
        parsed(GOOD.replace("free, 0", "free, 0.05"), tmp_path)


@pytest.mark.parametrize(("cell", "mount"), [("", "surface"), ("none", ""), ("tank", "tank"), ("surface", "surface")])
def test_a_foothold_says_what_it_is_on(cell: str, mount: str, tmp_path: Path) -> None:
    text = GOOD.replace("max_tilt", "on").replace("free, 0", f"free, {cell}").replace("4, 0\n", "4,\n")
    assert [f.on for f in parsed(text, tmp_path).footholds] == [mount, ""]


@pytest.mark.parametrize(
    ("shape", "point", "out"),
    [
        (Box((0.2, 0.3, 0.5)), (0.0, 0.0, 0.25), (0, 0, 1)), (Capsule(0.1, 0.4), (0.0, 0.0, 0.3), (0, 0, 1)),
        (Sphere(0.3), (0.3, 0.0, 0.0), (1, 0, 0)), (Cylinder(0.2, 0.5), (0.0, -0.2, 0.1), (0, -1, 0)),
        (Ellipsoid((0.1, 0.2, 0.3)), (0.0, 0.2, 0.0), (0, 1, 0)), (HalfSpace(), (4.0, 5.0, 0.0), (0, 0, 1)),
        (EndlessCylinder(0.4), (0.4, 0.0, 9.0), (1, 0, 0)), (CylinderInside(7.0), (0.0, 7.0, -2.0), (0, -1, 0)),
        (Convex(np.vstack([np.eye(3), -np.eye(3)])), (1 / 3, 1 / 3, 1 / 3), 3**-0.5 * np.ones(3)),
        (TriangleMesh(np.eye(3)[None]), (1 / 3, 1 / 3, 1 / 3), 3**-0.5 * np.ones(3)),
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_one_that_does_not_say_so_is_on_a_body_within_a_centimetre(
    shape: Any, point: tuple[float, ...], out: Any, tmp_path: Path
) -> None:
    places = [np.array(point) + far * np.array(out) for far in (-0.0099, 0.0099, 0.0101)]
    footholds = [Foothold(str(k), POSE * pin.SE3(np.eye(3), place)) for k, place in enumerate(places)]
    file = save_scene(ClimbScene(footholds, {"body": SceneBody(shape, POSE)}), tmp_path / "on.csv")
    file.write_text(file.read_text().replace(",none\n", ",\n"))
    assert [f.on for f in read_scene(file).footholds] == ["body", "body", ""]


@pytest.mark.parametrize(
    ("old", "new", "field", "said"),
    [
        ("h1, 0,", "h1, zero,", "line 3: x", "expected a number"),
        ("h1, 0,", "h1, nan,", "line 3: x", "finite"),
        ("h1, 0,", "h1, 1e999,", "line 3: x", "finite"),
        ("h1, 0,", ", 0,", "line 3: id", "expected a text"),
        ("h1, 0,", "h\t1, 0,", "line 3: id", "on one line"),
        ("free, 0", "free, -0.05", "line 3: max_tilt", "within [0, 1.571]"),
        ("free, 0", "free, 3", "line 3: max_tilt", "within [0, 1.571]"),
        ("free, 0", "free", "line 3", "expected 12 values, not 11"),
        ("free, 0", "loose, 0", "line 3: roll", "fixed"),
        ("free, 0", "999999999, 0", "line 3: roll", "2 to 360"),
        ("free, 0", "4.0, 0", "line 3: roll", "2 to 360"),
        ("4, 0\n", "1, 0\n", "line 5: roll", "2 to 360"),
        ("0, 0, -2, 1, 0, 5", "0, 0, 0, 1, 0, 5", "line 3: ax, ay, az", "direction"),
        ("0, 0, -2, 1, 0, 5", "0, 0, -2, 0, 0, 5", "line 3: rx, ry, rz", "parallel"),
        ("0, 0, -2, 1, 0, 5", "0, 0, -2, 0, 0, 0", "line 3: rx, ry, rz", "direction"),
        ('"the second, h2"', "h1", "line 5: id", "two of this id"),
        ('"the second, h2"', '"the second', "line 5", "cannot be read"),
        ("roll, max_tilt", "roll, max_tlit", "line 2", "any of max_tilt, on, friction, limbs"),
        ("roll, max_tilt", "roll, roll", "line 2", "expected the columns"),
        ("id, x, y, z, ax", "id, x, y, ax", "line 2", "expected the columns"),
        ("max_tilt\n", "friction\n", "line 3: friction", "expected a value in (0, inf]"),
        ("max_tilt\n", "on\n", "line 3: on", "no body of this file"),
        (FIRST, FIRST.replace("max_tilt", "limbs").replace("free, 0", "free, a\0b"), "line 3: limbs", "on one line"),
        ("[obstacles]", "[walls]", "line 7", "no such section"),
        ("tank, box", "tank, bull", "line 9: shape", "capsule"),
        ("0.3, 0.3, 0.4", "0.3, 0.3, 0", "line 9: d1, d2, d3", "expected a value"),
        ("0.05, 1.5,", "0.05, 1.5, 2", "line 10: d3", "2 sizes"),
        ("0.05, 1.5,", "0.05, -1.5,", "line 10: d2", "at least 0"),
        ("pipe, ", "tank, ", "line 10: id", "two of this id"),
        ("pipe, ", "none, ", "line 10: id", "on no body"),
        ("pipe, ", "surface, ", "line 13: shape", "two of this id"),
        ("plane, 0", "saddle, 0", "line 13: shape", "cylinder"),
        ("1, 1, 0, 0,\n", "1, 1, 0, 0,\nplane, 0, 0, 0, 0, 0, 1, 1, 0, 0,\n", "line 14: shape", "two of this id"),
        ("1, 1, 0, 0,\n", "1, 1, 0, 0,\n[gravity]\nx,y,z\n0,0,1\n0,0,1\n", "line 17: x", "one gravity"),
    ],
)
def test_bad_lines_are_named(old: str, new: str, field: str, said: str, tmp_path: Path) -> None:
    assert GOOD.count(old) >= 1
    with pytest.raises(StructureFileError) as caught:
        parsed(GOOD.replace(old, new, 1), tmp_path)
    assert caught.value.field == field
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("cells", "made", "field", "said"),
    [
        ("none.stl,,", b"", "d1", "no such file"),
        ("x" * 300 + ".stl,,", b"", "d1", "no such file"),
        ("rock.step,,", b"", "d1", "expected a file .stl"),
        (",,", b"", "d1", "expected a text"),
        ("bad.stl,,", b"solid nothing", "d1", ""),
        ("bad.stl,,", bytes(80) + b"\x09\0\0\0" + bytes(70), "d1", ""),
        ("bad.npy,,", b"", "d1", "cannot be read"),
        ("bad.npy,,", b"\x93NUMPY\x01\x00v\x00{", "d1", "cannot be read"),
        ("open.npy,,", b"", "d1", "open"),
        ("open.npy,0,", b"", "d2", "scale above 0"),
        ("open.npy,inches,", b"", "d2", "expected a number"),
        ("open.npy,1,2", b"", "d3", "a file and a scale"),
    ],
)
def test_meshes_that_cannot_be_read_are_named(cells: str, made: bytes, field: str, said: str, tmp_path: Path) -> None:
    for name in ("bad.stl", "bad.npy"):
        (tmp_path / name).write_bytes(made)
    np.save(tmp_path / "open.npy", np.eye(3)[None])
    with pytest.raises(StructureFileError) as caught:
        parsed(GOOD.replace("box, 1", "mesh, 1").replace("0.3, 0.3, 0.4", cells), tmp_path)
    assert caught.value.field == f"line 9: {field}"
    assert said in str(caught.value)


def test_meshes_of_other_programs_have_a_scale(tmp_path: Path) -> None:
    hull = Convex(np.random.default_rng(1).normal(size=(9, 3)))
    pieces = [f"facet normal 0 0 0\nouter loop\n{''.join(f'vertex {a} {b} {c}' + chr(10) for a, b, c in t)}endloop\n"
              "endfacet\n" for t in outwards(hull)]  # fmt: skip
    (tmp_path / "rock.stl").write_text("solid rock\n" + "".join(pieces) + "endsolid rock\n")
    text = GOOD.replace("box, 1", "mesh, 1").replace("0.3, 0.3, 0.4", "rock.stl, 2,")
    shape = parsed(text, tmp_path).bodies["tank"].shape
    assert isinstance(shape, TriangleMesh)
    np.testing.assert_allclose(shape.corners, 2.0 * outwards(hull), atol=1e-6)
    assert isinstance(parsed(text.replace("mesh,", "convex,"), tmp_path).bodies["tank"].shape, Convex)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda s: ClimbScene(s.footholds, {"none": SceneBody(Sphere(1.0))}), "on no body"),
        (lambda s: ClimbScene(s.footholds, {"a\nb": SceneBody(Sphere(1.0))}), "body"),
        (lambda s: ClimbScene(s.footholds, {"hill": SceneBody(HeightMap(np.eye(3), (1.0, 1.0), 1.0))}), "HeightMap"),
        (lambda s: ClimbScene([Foothold(" a", POSE)]), "foothold"),
        (lambda s: ClimbScene([Foothold("a", POSE, limbs=("x;y",))]), "limbs"),
        (lambda s: ClimbScene([Foothold("a", POSE, rolls=361)]), "rolls"),
    ],
)
def test_what_no_file_holds_is_refused_and_nothing_is_written(change: Any, said: str, tmp_path: Path) -> None:
    scene = plane_grid(2, 2)
    bare = ClimbScene([Foothold(f.id, f.pose) for f in scene.footholds])
    with pytest.raises(StructureFileError, match=said):
        save_scene(change(bare), tmp_path / "file.csv")
    assert not list(tmp_path.iterdir())


def test_files_that_cannot_be_read_or_written_are_refused(tmp_path: Path) -> None:
    with pytest.raises(StructureFileError, match="no such file"):
        read_scene(tmp_path / "none.csv")
    with pytest.raises(StructureFileError, match="no foothold"):
        parsed("# nothing\n", tmp_path)
    with pytest.raises(StructureFileError, match="cannot be written"):
        save_scene(plane_grid(2, 2), tmp_path / "no" / "folder.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(StructureFileError, match="cannot be read"):
        read_scene(tmp_path / "binary.csv")
    others: tuple[Any, ...] = (None, 1e9, True, object(), {}, [[1.0], [1.0, 2.0]], np.zeros((2, 2)), len)
    calls: list[Any] = [read_scene, lambda x: save_scene(plane_grid(2, 2), x), lambda x: save_scene(x, tmp_path / "a")]
    for value, call in itertools.product(others, calls):
        with pytest.raises(WbcError, match=r"path|scene"):
            call(value)


def test_garbled_files_raise_nothing_else(tmp_path: Path) -> None:
    rng, refused = np.random.default_rng(3), 0
    signs = list('0123456789.,-e"#[]\n x\x00') + ["nan", "inf", "free", "[surface]", "1e400", "\u2028"]
    for _ in range(400):
        text = GOOD
        for _ in range(rng.integers(1, 4)):
            k = int(rng.integers(len(text)))
            text = text[:k] + signs[int(rng.integers(len(signs)))] + text[k + int(rng.integers(3)) :]
        try:
            assert parsed(text, tmp_path).footholds
        except StructureFileError:
            refused += 1
    assert 100 < refused < 400
