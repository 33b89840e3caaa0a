"""Height maps: distances against prisms by Coal and closed forms; MuJoCo's fields; rows of a tick; proofs."""

from __future__ import annotations

import pickle
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.distances import coal_distance
from tests.geometry.world import clear_of, distance, shapes
from tests.random_robots import random_pose
from tests.repeats import repeats
from wbc.clearance import Motion, Pair, Sweeper, SweptBody, SweptScene, Tree
from wbc.errors import NotFiniteError, RangeError, ShapeError
from wbc.proximity import Body, distances
from wbc.shapes import Box, Convex, Ellipsoid, HeightMap, PlacedShape, Sphere
from wbc.validation import Array

HERE = pin.SE3.Identity()


def rough(rng: np.random.Generator, rows: int = 5, columns: int = 7, rise: float = 0.3) -> HeightMap:
    return HeightMap(rng.uniform(0.0, rise, size=(rows, columns)), (2.0, 1.2), 0.1)


def prisms(ground: HeightMap) -> list[Convex]:
    """The ground below each triangle."""
    rows, columns = ground.heights.shape
    x, y = (np.linspace(-half, half, n) for half, n in ((ground.size[0] / 2, columns), (ground.size[1] / 2, rows)))
    out = []
    for i in range(rows - 1):
        for j in range(columns - 1):
            for middle in ((0, 1), (1, 0)):
                top = np.array(
                    [[x[j + b], y[i + a], ground.heights[i + a, j + b]] for a, b in ((0, 0), middle, (1, 1))]
                )
                out.append(Convex(np.concatenate([top, top * [1.0, 1.0, 0.0] - [0.0, 0.0, ground.base]])))
    return out


def slope(angle: float, turn: float) -> tuple[HeightMap, Array]:
    """A plane, and its normal."""
    normal = np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
    x, y = np.meshgrid(np.linspace(-2.0, 2.0, 21), np.linspace(-1.5, 1.5, 16))
    return HeightMap(-(normal[0] * x + normal[1] * y) / normal[2], (4.0, 3.0), 5.0), normal


def test_outside_the_distance_is_that_of_the_nearest_prism() -> None:
    rng = np.random.default_rng(0)
    apart = 0
    for _ in range(repeats(6)):
        ground = rough(rng)
        for solid in (*shapes(rng), Ellipsoid((0.3, 0.1, 0.2))):
            at, there = random_pose(rng, 1.0), random_pose(rng, 0.3)
            found, back = distance(solid, at, ground, there), distance(ground, there, solid, at)
            assert back.gap == found.gap
            assert back.normal == pytest.approx(-found.normal)
            assert back.point == pytest.approx(found.point + found.gap * found.normal, abs=1e-12)
            if found.gap > 1e-6:
                apart += 1
                expected = min(coal_distance(solid, at, part, there, 1e-9) for part in prisms(ground))
                assert found.gap == pytest.approx(expected, abs=1e-8), solid
    assert apart > 8


def test_on_a_slope_it_is_the_height_above_the_plane_in_the_ground_and_out_of_it() -> None:
    rng = np.random.default_rng(1)
    signs = set()
    for _ in range(repeats(40)):
        ground, normal = slope(float(rng.uniform(0.0, 0.7)), float(rng.uniform(0.0, 6.28)))
        there = random_pose(rng, 1.0)
        for solid in (Sphere(0.1), Box((0.2, 0.1, 0.3)), Ellipsoid((0.1, 0.15, 0.2))):
            foot = rng.uniform(-0.4, 0.4, 2)
            place = np.array([*foot, -(normal[:2] @ foot) / normal[2]]) + rng.uniform(-0.5, 0.5) * normal
            at = there * pin.SE3(random_pose(rng).rotation, place)
            found, n = distance(solid, at, ground, there), there.rotation @ normal
            if isinstance(solid, Box):
                lowest = float((solid.row_corners() @ at.rotation.T @ n).min())
            else:
                lowest = -float(np.linalg.norm(np.array(solid.sizes[:3]) * (at.rotation.T @ n))) - solid.sizes[4]
            expected = float(n @ (at.translation - there.translation)) + lowest
            signs.add(expected > 0.0)
            assert found.gap == pytest.approx(expected, abs=1e-8)
            assert found.normal == pytest.approx(-n, abs=1e-5)
    assert signs == {True, False}


def test_the_depth_begins_where_the_distance_ends() -> None:
    """A box that sinks into rough ground: the signed distance falls without a jump."""
    rng = np.random.default_rng(2)
    for _ in range(repeats(6)):
        ground, turn = rough(rng), random_pose(rng).rotation
        heights = np.linspace(0.6, -0.2, 400)
        gaps = [
            distance(Box((0.3, 0.2, 0.1)), pin.SE3(turn, np.array([0.1, 0.05, z])), ground, HERE).gap for z in heights
        ]
        assert gaps[0] > 0.0 > gaps[-1]
        touching = int(np.flatnonzero(np.array(gaps) < 0.0)[0])
        assert abs(gaps[touching] - gaps[touching - 1]) <= 1.001 * (heights[0] - heights[1])
        assert np.diff(gaps).max() < 0.02


def test_mujoco_has_the_same_surface() -> None:
    """Its rays meet the ground where the triangles are, of a field that a shape became."""
    ground = HeightMap(np.random.default_rng(3).uniform(-0.2, 0.3, size=(4, 6)), (2.0, 1.2), 0.5)
    spec = mujoco.MjSpec()
    at = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.3), np.array([0.3, 0.1, 0.2]))
    turn = pin.Quaternion(at.rotation)
    geom = spec.worldbody.add_geom(pos=at.translation, quat=[turn.w, turn.x, turn.y, turn.z])
    ground.become(geom, spec, "ground")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(4)
    for _ in range(60):
        start = at.act(np.array([rng.uniform(-0.99, 0.99), rng.uniform(-0.59, 0.59), 2.0]))
        far = mujoco.mj_ray(model, data, start, -at.rotation[:, 2], None, 1, -1, np.zeros(1, dtype=np.int32))
        met = pin.SE3(np.eye(3), start - far * at.rotation[:, 2])
        assert distance(Sphere(0.0), met, ground, at).gap == pytest.approx(0.0, abs=1e-6)


FILE = """<mujoco><asset>
<hfield name="h" nrow="3" ncol="4" size="1 2 .5 .1" elevation="0 0 1 0  0 .5 .2 0  0 0 0 1"/></asset>
<worldbody><geom type="hfield" hfield="h" pos="0 0 .1"/><body name="a" pos="0 0 1"><joint name="j" axis="0 1 0"/>
<geom type="ellipsoid" size=".1 .05 .3"/></body></worldbody></mujoco>"""


def test_fields_and_ellipsoids_of_a_file_are_shapes_of_links(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(FILE)
    robot = wbc.robots.fit_shapes(wbc.robots.load(tmp_path / "robot.xml"), kind="convex")
    (ground,), (body,) = robot.shapes["universe"], robot.shapes["a"]
    model = mujoco.MjModel.from_xml_string(FILE)
    assert isinstance(ground.shape, HeightMap)
    assert ground.shape.heights.ravel() == pytest.approx(0.5 * model.hfield_data)
    assert (ground.shape.size, ground.shape.base) == ((2.0, 4.0), 0.1)
    assert body.shape == Ellipsoid((0.1, 0.05, 0.3))
    pair = (Body("a", "a", body.placement, body.shape), Body("b", "world", ground.placement, ground.shape))
    # The top of the field, 0.35 below the least of the ellipsoid, is beside it
    assert 0.2 < distances(robot, [pair], robot.neutral)[0] < 0.5


def test_an_obstacle_in_a_tick_is_kept_clear_of() -> None:
    ground = HeightMap(np.random.default_rng(5).uniform(0.0, 0.1, size=(6, 6)), (1.0, 1.0), 0.1)
    clear_of(ground, pin.SE3(pin.rpy.rpyToMatrix(0.05, -0.1, 0.4), np.array([0.4, 0.2, 0.0])), tuple(prisms(ground)))


def test_between_instants_it_is_proven() -> None:
    """Bodies that fly over the ground: bounds below all that was sampled, and near it."""
    rng, tree = np.random.default_rng(6), Tree.of_model(pin.Model(), floating=True)
    for _ in range(repeats(3)):
        ground = rough(rng, rise=0.2)
        for solid in (Sphere(0.1), Box((0.3, 0.1, 0.2)), Ellipsoid((0.2, 0.1, 0.15))):
            bodies = [SweptBody("flyer", solid, "universe"), SweptBody("ground", ground)]
            scene = SweptScene(tree, bodies, [Pair("flyer", "ground", 0.01)])
            ends = [
                pin.SE3(random_pose(rng).rotation, np.array([x, rng.uniform(-0.4, 0.4), 0.6])) for x in (-1.0, 0.0, 1.0)
            ]
            rows = np.array([pin.SE3ToXYZQUAT(pose) for pose in ends])
            motion, sweeper = Motion.linear(tree, [0.0, 0.5, 1.0], np.zeros((3, 0)), rows), Sweeper(scene)
            found = sweeper.sweep(motion, aim="least", far=np.inf)
            sampled = min(sweeper.at(motion, t)[0].distance for t in np.linspace(0.0, 1.0, 101)) - 0.01
            assert found.bound[0] <= sampled + 1e-9
            assert found.found[0] - found.bound[0] <= 1.01e-4


def test_it_is_drawn_hashed_and_pickled() -> None:
    ground = rough(np.random.default_rng(7))
    corners = ground.triangles()
    volume = abs(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0)
    assert volume == pytest.approx(sum(np.abs(_volume(part)) for part in prisms(ground)))
    again = pickle.loads(pickle.dumps(ground))
    assert (again, hash(again), repr(again)) == (ground, hash(ground), repr(ground))
    assert ground != rough(np.random.default_rng(8))


def _volume(part: Convex) -> float:
    from scipy.spatial import ConvexHull

    return float(ConvexHull(part.points).volume)


@pytest.mark.parametrize(
    ("heights", "size", "base", "error", "match"),
    [
        (np.zeros(4), (1.0, 1.0), 0.1, ShapeError, "heights"),
        (np.zeros((1, 4)), (1.0, 1.0), 0.1, ShapeError, "heights"),
        ([[0.0, np.nan], [0.0, 0.0]], (1.0, 1.0), 0.1, NotFiniteError, "heights"),
        (np.zeros((1001, 1001)), (1.0, 1.0), 0.1, RangeError, "heights"),
        (np.zeros((2, 2)), (1.0, 0.0), 0.1, RangeError, "size"),
        (np.zeros((2, 2)), (1.0,), 0.1, ShapeError, "size"),
        (np.zeros((2, 2)), (1.0, 1.0), 0.0, RangeError, "base"),
    ],
)
def test_bad_maps(heights: object, size: object, base: object, error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        HeightMap(heights, size, base)  # type: ignore[arg-type]


def test_two_maps_have_no_distance() -> None:
    robot = wbc.robots.load("ur5").with_shapes({"wrist_3_link": [PlacedShape(rough(np.random.default_rng(1)), HERE)]})
    (one,), ground = robot.shapes["wrist_3_link"], rough(np.random.default_rng(2))
    stack = wbc.Stack(robot, dt=0.01)
    with pytest.raises(ShapeError, match="HeightMap and HeightMap have no distance"):
        distances(
            robot,
            [(Body("a", "wrist_3_link", one.placement, one.shape), Body("b", "world", HERE, ground))],
            robot.neutral,
        )
    with pytest.raises(ShapeError, match="HeightMap and HeightMap have no distance"):
        stack.add(wbc.tasks.Obstacle(ground), name="ground")
