"""Distances of all kinds of bodies against Coal and against brute force; never above the true one."""

from __future__ import annotations

from itertools import combinations_with_replacement
from math import pi
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from tests.clearance.world import free_tree, judged, numbers, random_pose, solids, still
from tests.repeats import repeats
from wbc.clearance import CylinderInside, EndlessCylinder, Motion, Pair, Sweeper, SweptBody, SweptScene, TriangleMesh
from wbc.errors import ShapeError
from wbc.shapes import Box, Capsule, Convex, Cylinder, Ellipsoid, HalfSpace, Shape, Solid, Sphere
from wbc.validation import Array

#: No distance may be above the judge's by more, or below: Coal is off on round shapes by so much
OVER, UNDER = 1e-9, 3e-6


def measured(a: Shape, at: pin.SE3, b: Shape, there: pin.SE3) -> tuple[float, Array]:
    """Distance and nearest points of two bodies, the first on a base that stands still."""
    scene = SweptScene(
        free_tree(), [SweptBody("a", a, "universe"), SweptBody("b", b, "world", there)], [Pair("a", "b")]
    )
    found = Sweeper(scene).at(still(at), 0.5)[0]
    return found.distance, found.points


def test_all_solids_as_coal_finds_them() -> None:
    rng = np.random.default_rng(0)
    for _ in range(repeats(6)):
        for a, b in combinations_with_replacement(solids(rng), 2):
            there = random_pose(rng, 1.0)
            rows = np.array([numbers(random_pose(rng, 2.0)) for _ in range(5)])
            scene = SweptScene(
                free_tree(), [SweptBody("a", a, "universe"), SweptBody("b", b, "world", there)], [Pair("a", "b")]
            )
            motion, sweeper = Motion.linear(scene.tree, np.arange(5.0), np.zeros((5, 0)), rows), Sweeper(scene)
            for k, row in enumerate(rows):
                found, at = sweeper.at(motion, k)[0], pin.XYZQUATToSE3(row)
                expected = judged(a, at, b, there)
                assert expected - UNDER <= found.distance <= expected + OVER, (a, b, row)
                assert np.linalg.norm(found.points[1] - found.points[0]) == pytest.approx(abs(found.distance), abs=1e-9)


#: (a, its pose, b, its pose, distance): parallel, touching, nested, without length, thin
TURNED = pin.SE3(pin.utils.rotate("y", pi / 2), np.zeros(3))


def up(x: float, y: float = 0.0, z: float = 0.0) -> pin.SE3:
    """Without a turn."""
    return pin.SE3(np.eye(3), np.array([x, y, z]))


DEGENERATE: list[tuple[Solid, pin.SE3, Solid, pin.SE3, float]] = [
    (Capsule(0.1, 1.0), up(0.0), Capsule(0.2, 2.0), up(0.5), 0.2),
    (Capsule(0.1, 1.0), up(0.0), Capsule(0.2, 2.0), up(0.0, 0.0, 1.9), 0.1),
    (Capsule(0.1, 1.0), up(0.0), Capsule(0.1, 1.0), up(0.0), -0.2),
    (Capsule(0.1, 1.0), up(0.0), Capsule(0.1, 1.0), TURNED, -0.2),
    (Capsule(0.0, 0.0), up(0.3), Capsule(0.0, 0.0), up(0.0), 0.3),
    (Capsule(0.0, 1.0), up(0.0), Sphere(0.0), up(0.0, 0.0, 0.25), 0.0),
    (Sphere(0.1), up(0.0), Sphere(0.5), up(0.0), -0.6),
    (Sphere(0.1), up(0.6), Sphere(0.5), up(0.0), 0.0),
    (Box((1.0, 1.0, 1.0)), up(0.0), Box((1.0, 1.0, 1.0)), up(1.0), 0.0),
    (Box((1.0, 1.0, 1.0)), up(0.0), Box((1.0, 1.0, 1.0)), up(1.5), 0.5),
    (Box((2.0, 2.0, 2.0)), up(0.0), Sphere(0.1), up(0.9), -0.2),
    (Box((2.0, 2.0, 2.0)), up(0.0), Capsule(0.1, 0.5), up(0.8), -0.3),
    (Cylinder(0.5, 1.0), up(0.0), Sphere(0.1), up(0.0, 0.0, 0.8), 0.2),
    (Cylinder(0.5, 1.0), up(0.0), Capsule(0.1, 1.0), up(0.9), 0.3),
    (Cylinder(0.5, 1.0), up(0.0), Cylinder(0.5, 1.0), up(0.0, 0.0, 1.25), 0.25),
    (Cylinder(1e-3, 10.0), up(0.0), Box((10.0, 1e-3, 10.0)), up(0.0, 0.5), 0.4985),
    (Capsule(1e-3, 100.0), TURNED, Capsule(1e-3, 100.0), up(0.0, 0.02), 0.018),
]


@pytest.mark.parametrize("case", DEGENERATE, ids=range(len(DEGENERATE)))
def test_bodies_that_lie_in_special_ways(case: tuple[Solid, pin.SE3, Solid, pin.SE3, float]) -> None:
    a, at, b, there, expected = case
    rng = np.random.default_rng(1)
    for moved in (pin.SE3.Identity(), random_pose(rng, 1.0), random_pose(rng, 10.0)):
        for one, other in (((a, at), (b, there)), ((b, there), (a, at))):
            found, _ = measured(one[0], moved * one[1], other[0], moved * other[1])
            assert found == pytest.approx(expected, abs=1e-8)
            assert found <= expected + 1e-9


def test_nearly_parallel_capsules_against_a_fine_grid() -> None:
    """The formula of the two lines loses its digits there; ends do not."""
    rng = np.random.default_rng(2)
    for angle in (1e-3, 1e-5, 1e-7, 1e-9, 0.0):
        a = pin.SE3(pin.utils.rotate("x", angle), np.array([0.01, 0.3 * rng.normal(), 0.3 * rng.normal()]))
        found, _ = measured(Capsule(0.0, 2.0), a, Capsule(0.0, 1.0), pin.SE3.Identity())
        s = np.linspace(-1.0, 1.0, 20001)[:, None]
        points = a.translation + s * a.rotation[:, 2]
        foot = np.clip(points[:, 2], -0.5, 0.5)
        grid = np.linalg.norm(points - foot[:, None] * [0.0, 0.0, 1.0], axis=1).min()
        assert grid - 1e-4 <= found <= grid + 1e-9


def test_planes_and_endless_cylinders_against_points_of_the_solids() -> None:
    rng = np.random.default_rng(3)
    for _ in range(repeats(5)):
        wall, radius = random_pose(rng, 1.0), float(rng.uniform(2.0, 6.0))
        for solid in solids(rng):
            at = random_pose(rng, 1.5)
            points, ball = surface_points(rng, solid)
            local = (points @ at.rotation.T + at.translation - wall.translation) @ wall.rotation
            flat = np.linalg.norm(local[:, :2], axis=1)
            height, _ = measured(solid, at, HalfSpace(), wall)
            assert height == pytest.approx(local[:, 2].min() - ball, abs=1e-2 * np.ptp(points) + 1e-9)
            assert height <= local[:, 2].min() - ball + 1e-9
            inner, _ = measured(solid, at, CylinderInside(radius), wall)
            assert inner <= radius - flat.max() - ball + 1e-9
            assert inner == pytest.approx(radius - flat.max() - ball, abs=1e-2 * np.ptp(points) + 1e-9)
            outer, ends = measured(solid, at, EndlessCylinder(0.1), wall)
            assert outer <= flat.min() - 0.1 - ball + 1e-9
            if outer > 0.0:
                foot = (ends[1] - wall.translation) @ wall.rotation
                assert np.linalg.norm(foot[:2]) == pytest.approx(0.1, abs=1e-6)


def surface_points(rng: np.random.Generator, solid: Solid) -> tuple[Array, float]:
    """Points of a solid without its ball, many, its corners among them; and the ball."""
    if isinstance(solid, (Sphere, Capsule)):
        half = solid.length / 2 if isinstance(solid, Capsule) else 0.0
        return np.linspace(-half, half, 2001)[:, None] * [0.0, 0.0, 1.0], solid.radius
    if isinstance(solid, Convex):
        weights = rng.dirichlet(np.full(len(solid.points), 0.1), 4000)
        return np.concatenate([solid.points, weights @ solid.points]), 0.0
    if isinstance(solid, Box):
        grid = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 15)] * 3), axis=-1).reshape(-1, 3)
        return grid * solid.size, 0.0
    if isinstance(solid, Ellipsoid):
        away = rng.normal(size=(20000, 3))
        return away / np.linalg.norm(away, axis=1, keepdims=True) * solid.semi_axes, 0.0
    angle, z, r = (x.ravel() for x in np.meshgrid(np.linspace(0, 2 * pi, 721), [-0.5, 0.0, 0.5], [0.0, 0.5, 1.0]))
    rim = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1) * solid.radius
    return np.column_stack([rim, z * solid.length]), 0.0


def test_surfaces_of_triangles_against_the_hull_of_a_box() -> None:
    """The twelve triangles of a box, and the box: outside they are as far."""
    rng = np.random.default_rng(4)
    box = Box((0.8, 0.5, 0.3))
    corners = box_triangles(box)
    for _ in range(repeats(4)):
        there = random_pose(rng, 0.5)
        for solid in solids(rng):
            at = random_pose(rng, 2.0)
            expected = judged(solid, at, box, there)
            found, _ = measured(solid, at, TriangleMesh(corners), there)
            if expected > 0.0:
                assert expected - UNDER <= found <= expected + OVER
            else:
                assert found <= 1e-8 or encloses(box, there, solid, at)


def test_a_closed_mesh_has_an_inside(tmp_path: Path) -> None:
    """The triangles of a box as a solid, from a file: a ball outside, wholly within, and in the wall."""
    rng = np.random.default_rng(6)
    box = Box((0.8, 0.5, 0.3))
    corners = box_triangles(box)
    path = tmp_path / "box.stl"
    path.write_text(stl(corners * 1e3))
    mesh = TriangleMesh.read(path, 1e-3)
    assert mesh.solid
    assert len(mesh.corners) == 12
    # 6 mm from the side, 60 mm across; in the middle; outside; through the wall
    for x, expected in ((0.394 - 0.03, -0.036 - 0.03), (0.0, -0.15 - 0.03), (0.5, 0.1 - 0.03), (0.4, -0.03)):
        there = random_pose(rng, 1.0)
        found, points = measured(Sphere(0.03), there * up(x), mesh, there)
        assert found == pytest.approx(expected, abs=3e-6)
        assert np.linalg.norm(points[1] - points[0]) == pytest.approx(abs(found), abs=1e-5)
    for wrong in (corners[1:], np.concatenate([corners[:1, ::-1], corners[1:]])):
        with pytest.raises(ShapeError, match="solid"):
            TriangleMesh(wrong, solid=True)


def stl(corners: Array) -> str:
    """A text of triangles."""
    lines = ["solid box"]
    for face in corners:
        points = "\n".join(f"vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in face)
        lines.append(f"facet normal 0 0 0\nouter loop\n{points}\nendloop\nendfacet")
    return "\n".join([*lines, "endsolid box", ""])


def encloses(box: Box, there: pin.SE3, solid: Solid, at: pin.SE3) -> bool:
    """A solid wholly within the surface touches none of it."""
    local = there.actInv(at).translation
    return bool((np.abs(local) < np.array(box.size) / 2).all())


def box_triangles(box: Box) -> Array:
    """Two a side [12, 3, 3]."""
    half, out = np.array(box.size) / 2, []
    for axis in range(3):
        u, v = (np.roll(np.eye(3)[axis], k) * half for k in (1, 2))
        for side in (-1.0, 1.0):
            middle = side * np.eye(3)[axis] * half
            quad = [middle - u - v, middle + u - v, middle + u + v, middle - u + v][:: int(side)]
            out += [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    return np.array(out)


def test_many_triangles_in_their_tree_are_as_far_as_one_by_one() -> None:
    rng = np.random.default_rng(5)
    corners = rng.normal(size=(100, 1, 3)) * 2.0 + 0.2 * rng.normal(size=(100, 3, 3))
    for _ in range(repeats(3)):
        at, capsule = random_pose(rng, 2.0), Capsule(0.05, float(rng.uniform(0.0, 1.0)))
        found, points = measured(capsule, at, TriangleMesh(corners), pin.SE3.Identity())
        each = [measured(capsule, at, TriangleMesh(one[None]), pin.SE3.Identity())[0] for one in corners]
        assert found == pytest.approx(min(each), abs=1e-12)
        if found > 0.0:
            assert np.linalg.norm(points[1] - points[0]) == pytest.approx(found, abs=1e-9)
