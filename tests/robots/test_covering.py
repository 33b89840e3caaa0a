"""Several spheres and capsules around a body: it lies within them, and they stand out of it as far as they say."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

import wbc.robots
from tests.robots.files import example
from tests.robots.test_shapes import hull_distance, outside, surface
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.robot.geometry.covering import cover, least_excess_ball
from wbc.robot.geometry.hull import Hull
from wbc.robot.geometry.meshes import Mesh, box_mesh, cylinder_mesh, ellipsoid_mesh, read_mesh
from wbc.shapes import Box, Capsule, Cylinder, Sphere

MESHES = {
    "link5": "panda_description/meshes/collision/link5.stl",  # bent
    "torso": "talos_data/meshes/torso/torso_2_collision.STL",  # bulky
    "arm_3": "talos_data/meshes/arm/arm_3_collision.STL",
}
WAYS = [("capsule", 2), ("capsule", 3), ("spheres", 1), ("spheres", 5)]


def mesh(name: str) -> Mesh:
    return read_mesh(example(MESHES[name]), np.ones(3))


def on_surface(body: Mesh, count: int) -> np.ndarray:
    """Random points on the triangles, larger ones more often."""
    rng = np.random.default_rng(2)
    a, b, c = (body.vertices[body.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    pick = rng.choice(len(area), count, p=area / area.sum())
    s, t = np.sort(rng.random((2, count)), axis=0)[..., None]
    return s * a[pick] + (t - s) * b[pick] + (1 - t) * c[pick]


def within(body: Mesh, count: int) -> np.ndarray:
    """Random points inside a closed mesh: those whose ray along x leaves it an odd number of times."""
    rng = np.random.default_rng(3)
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    points = rng.uniform(low, high, (count, 3))
    a, b, c = (body.vertices[body.triangles[:, k]] for k in range(3))

    def side(p: np.ndarray, q: np.ndarray, y: float, z: float) -> np.ndarray:
        return (q[:, 1] - p[:, 1]) * (z - p[:, 2]) - (q[:, 2] - p[:, 2]) * (y - p[:, 1])

    odd = np.zeros(count, dtype=bool)
    for k, (x, y, z) in enumerate(points):
        u, v, w = side(b, c, y, z), side(c, a, y, z), side(a, b, y, z)
        hit = ((u > 0) == (v > 0)) & ((v > 0) == (w > 0))
        total = np.where(hit, u + v + w, 1.0)
        odd[k] = ((u * a[:, 0] + v * b[:, 0] + w * c[:, 0]) / total > x)[hit].sum() % 2
    return points[odd]


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize(("kind", "count"), WAYS)
def test_the_mesh_and_its_inside_lie_within_the_shapes(name: str, kind: str, count: int) -> None:
    body = mesh(name)
    shapes = cover(body, kind, count, 0.0)
    assert 1 <= len(shapes) <= count
    assert all(isinstance(s.shape, Sphere if kind == "spheres" else (Capsule, Sphere)) for s in shapes)
    inside = within(body, 400)
    assert len(inside) > 50
    for points in (body.vertices, on_surface(body, 3000), inside):
        assert outside(shapes, points) <= 1e-9


@pytest.mark.parametrize(("name", "kind", "count"), [("link5", "capsule", 3), ("torso", "spheres", 4)])
def test_excess_is_the_largest_distance_to_the_hull_of_the_mesh(name: str, kind: str, count: int) -> None:
    body = mesh(name)
    corners = Hull(body.vertices).vertices
    for shape in cover(body, kind, count, 0.0):
        found = [hull_distance(corners, p) for p in surface(shape, 120)]
        assert max(found) <= shape.excess + 1e-6
        assert max(found) >= 0.85 * shape.excess


def test_more_shapes_stand_out_less_and_a_tolerance_spares_them() -> None:
    body = mesh("link5")
    worst = [max(s.excess for s in cover(body, "spheres", count, 0.0)) for count in range(1, 6)]
    assert all(after <= before for before, after in itertools.pairwise(worst))
    assert worst[-1] < 0.25 * worst[0]
    some = cover(body, "spheres", 8, worst[2] + 1e-9)
    assert len(some) == 3
    one = cover(body, "capsule", 1, 0.0)
    assert max(s.excess for s in cover(body, "capsule", 3, 0.0)) < 0.7 * one[0].excess


def test_slabs_keep_every_triangle() -> None:
    body = box_mesh(np.array([1.0, 2.0, 3.0]))
    lower, middle, upper = body.slabs(np.array([0.0, 0.0, 1.0]), np.array([-1.0, 2.0]))
    for points, (low, high) in ((lower, (-3, -1)), (middle, (-1, 2)), (upper, (2, 3))):
        assert (points[:, 2].min(), points[:, 2].max()) == pytest.approx((low, high))
        assert ConvexHull(points).volume == pytest.approx(8.0 * (high - low))


def test_least_ball_of_a_cube_and_of_any_cloud() -> None:
    cube = box_mesh(np.full(3, 0.5)).vertices + 7.0
    shape = least_excess_ball(cube, Hull(cube))
    np.testing.assert_allclose(shape.placement.translation, 7.0, atol=1e-6)
    assert shape.excess == pytest.approx(np.sqrt(0.75) - 0.5, abs=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(5):
        cloud = rng.normal(size=(60, 3)) * rng.uniform(0.1, 2.0, 3)
        hull = Hull(cloud)
        shape = least_excess_ball(cloud, hull)
        assert outside((shape,), cloud) <= 1e-9
        for near in (0.01, 0.1, 0.5):
            for center in shape.placement.translation + near * rng.normal(size=(60, 3)):
                radius = np.linalg.norm(cloud - center, axis=1).max()
                assert radius + hull.beyond(center[None])[0] >= shape.excess - 1e-6


def test_excess_of_ends_outside_and_of_flat_bodies() -> None:
    cube = box_mesh(np.full(3, 0.5)).vertices
    end = np.array([2.0, 1.5, 0.0])
    assert Hull(cube).excess(end, end, 0.3) == pytest.approx(0.3 + np.hypot(1.5, 1.0), abs=1e-7)
    assert Hull(cube).excess(np.zeros(3), np.zeros(3), 0.3) == 0.0
    square = cube * [1, 1, 0]
    assert Hull(square).excess(np.zeros(3), np.zeros(3), 0.3) == pytest.approx(0.3, abs=1e-7)


@pytest.mark.parametrize(
    ("made", "value"),
    [
        (
            lambda: cylinder_mesh(0.3, 0.5),
            lambda p: np.maximum(np.hypot(p[:, 0], p[:, 1]) / 0.3, np.abs(p[:, 2]) / 0.5),
        ),
        (lambda: ellipsoid_mesh(np.array([0.3, 0.1, 0.5])), lambda p: np.linalg.norm(p / [0.3, 0.1, 0.5], axis=1)),
    ],
    ids=["cylinder", "ellipsoid"],
)
def test_polyhedra_contain_round_bodies(made: object, value: object) -> None:
    body, slack = made()  # type: ignore[operator]
    assert 0.0 < slack < 0.01
    assert (value(on_surface(body, 5000)) >= 1.0 - 1e-9).all()  # type: ignore[operator]
    assert (value(body.vertices) <= 1.0 + slack / 0.1).all()  # type: ignore[operator]
    assert within(body, 200).size


def urdf(path: Path, geometry: str, origin: str = "") -> Path:
    path.write_text(
        f'<robot name="r"><link name="l"><collision>{origin}<geometry>{geometry}</geometry></collision></link></robot>'
    )
    return path


def test_boxes_and_cylinders_kept_as_they_are(tmp_path: Path) -> None:
    origin = '<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>'
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([1.0, 2.0, 3.0]))
    for text, shape in (
        ('<box size="0.1 0.2 0.3"/>', Box((0.1, 0.2, 0.3))),
        ('<cylinder radius="0.1" length="0.5"/>', Cylinder(0.1, 0.5)),
        ('<sphere radius="0.1"/>', Sphere(0.1)),
    ):
        path = urdf(tmp_path / "r.urdf", text, origin)
        for choice in ("exact", "convex"):
            (placed,) = wbc.robots.load(path, shapes=choice).shapes["l"]
            assert (placed.shape, placed.excess) == (shape, 0.0)
            assert placed.placement.isApprox(pose)
        (contained,) = wbc.robots.load(path).shapes["l"]
        assert isinstance(contained.shape, (Capsule, Sphere))
    kinds = {type(s.shape) for group in wbc.robots.load("anymal_b", shapes="exact").shapes.values() for s in group}
    assert kinds == {Box, Cylinder, Sphere}


@pytest.mark.parametrize("text", ['<box size="0 0.2 0.3"/>', '<cylinder radius="0" length="0.5"/>'])
def test_bodies_without_volume(text: str, tmp_path: Path) -> None:
    path = urdf(tmp_path / "r.urdf", text)
    for choice in ("exact", "convex"):
        with pytest.raises(RangeError, match=r"Box\.size|Cylinder\.radius"):
            wbc.robots.load(path, shapes=choice)
    points = (
        np.array(list(itertools.product((0.0,), (-0.1, 0.1), (-0.15, 0.15))))
        if "box" in text
        else np.array([[0, 0, 0.25]])
    )
    for choice in ("fit", "spheres"):
        shapes = wbc.robots.load(path, shapes=choice).shapes["l"]
        assert outside(shapes, points) <= 1e-9
        assert all(np.isfinite(s.excess) for s in shapes)


def test_bad_styles() -> None:
    panda = wbc.robots.load("panda")
    for changes, kind in (
        ({"kind": "shperes"}, UnknownNameError),
        ({"count": 0}, RangeError),
        ({"count": 1.5}, ShapeError),
        ({"count": True}, ShapeError),
        ({"kind": "convex", "count": 2}, RangeError),
        ({"tolerance": -1.0}, RangeError),
        ({"tolerance": float("nan")}, NotFiniteError),
    ):
        with pytest.raises(kind):
            wbc.robots.fit_shapes(panda, ["panda_link5"], **changes)
    with pytest.raises(UnknownNameError, match="spheres"):
        wbc.robots.load("panda", shapes="sphere")
