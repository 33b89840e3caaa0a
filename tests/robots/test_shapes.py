"""Collision shapes: from primitives with their exact excess, fitted to meshes, and stored in the table."""

from __future__ import annotations

import math
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import nnls

import wbc.robots
from tests.refusals import assert_refused
from tests.robots.files import example
from wbc.errors import NotFiniteError, RobotFileError, ShapeError, UnknownNameError
from wbc.robot import Robot
from wbc.robot.geometry.fitting import fit_capsule
from wbc.robot.geometry.hull import excess
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.shapes.around import around_cylinder, around_ellipsoid


def outside(shapes: tuple[PlacedShape, ...], points: np.ndarray) -> float:
    """How far the farthest point is outside the union of the shapes; an independent formula."""
    gaps = []
    for shape in shapes:
        local = (points - shape.placement.translation) @ shape.placement.rotation
        half = shape.shape.length / 2 if isinstance(shape.shape, Capsule) else 0.0
        along = np.maximum(np.abs(local[:, 2]) - half, 0.0)
        gaps.append(np.sqrt(local[:, 0] ** 2 + local[:, 1] ** 2 + along**2) - shape.shape.radius)
    return float(np.min(gaps, axis=0).max())


def hull_distance(corners: np.ndarray, point: np.ndarray) -> float:
    """Distance of a point to a convex hull: non-negative least squares for the weights of the corners."""
    heavy = 1e4
    matrix = np.vstack([corners.T, heavy * np.ones(len(corners))])
    weights, _ = nnls(matrix, np.append(point, heavy))
    return float(np.linalg.norm(corners.T @ weights - point))


def surface(shape: PlacedShape, n: int) -> np.ndarray:
    """Points all over a capsule's or sphere's surface."""
    half = shape.shape.length / 2 if isinstance(shape.shape, Capsule) else 0.0
    unit = np.random.default_rng(3).normal(size=(n, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    points = shape.shape.radius * unit + np.sign(unit[:, 2:]) * np.array([0, 0, half])
    return points @ shape.placement.rotation.T + shape.placement.translation


def mesh(relative: str) -> np.ndarray:
    return np.array(coal.MeshLoader().load(str(example(relative)), np.ones(3)).vertices())


def urdf_points(robot: Robot) -> dict[str, np.ndarray]:
    """Vertices of the collision meshes and corners of the boxes of each link, through Pinocchio's own reader."""
    model = pin.buildModelFromUrdf(robot.source)
    folder = Path(robot.source).parents[4]
    geometry = pin.buildGeomFromUrdf(model, robot.source, pin.GeometryType.COLLISION, None, [str(folder)])
    points: dict[str, list[np.ndarray]] = {}
    for item in geometry.geometryObjects:
        frame = model.frames[item.parentFrame]
        if isinstance(item.geometry, coal.Box):
            signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
            vertices = signs * item.geometry.halfSide
        else:
            vertices = np.array(item.geometry.vertices()) * item.meshScale
        local = frame.placement.inverse() * item.placement
        points.setdefault(frame.name, []).append(vertices @ local.rotation.T + local.translation)
    return {link: np.vstack(parts) for link, parts in points.items()}


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_stored_shapes_contain_every_vertex_and_state_their_excess(name: str) -> None:
    robot = wbc.robots.load(name)
    points = urdf_points(robot)
    assert set(points) == set(robot.shapes)
    assert "from the table" in robot.notes["shapes"]
    for link, vertices in points.items():
        (shape,) = robot.shapes[link]
        assert outside((shape,), vertices) <= 1e-9
        measured = excess(vertices, *shape.ends(), shape.shape.radius)
        assert measured <= shape.excess < measured + 2.5e-4


@settings(max_examples=20)
@given(
    st.integers(1, 60),
    st.floats(0.01, 10.0),
    st.integers(0, 2**31),
    st.sampled_from([(1, 1, 1), (1, 1, 0), (1, 0, 0), (5, 1, 1), (1, 1, 0.05)]),
)
def test_any_cloud_is_contained(n: int, size: float, seed: int, stretch: tuple[float, ...]) -> None:
    points = size * np.random.default_rng(seed).normal(size=(n, 3)) * np.array(stretch) + size
    shape = fit_capsule(points)
    assert outside((shape,), points) <= 1e-9 * size
    assert 0 <= shape.excess <= 2 * shape.shape.radius + 1e-9 * size


def test_points_of_a_capsule_give_it_back() -> None:
    true = PlacedShape(Capsule(0.1, 0.6), pin.SE3(pin.utils.rotate("y", 0.7), np.array([1.0, 2.0, 3.0])))
    shape = fit_capsule(surface(true, 3000))
    assert isinstance(shape.shape, Capsule)
    assert shape.shape.radius == pytest.approx(0.1, rel=0.01)
    assert shape.shape.length == pytest.approx(0.6, rel=0.02)
    assert shape.excess < 0.005


def test_single_point_and_bad_clouds() -> None:
    shape = fit_capsule(np.array([[1.0, 2.0, 3.0]]))
    assert shape.shape == Sphere(0.0)
    np.testing.assert_array_equal(shape.placement.translation, [1, 2, 3])
    assert_refused(lambda: fit_capsule(np.zeros((0, 3))), ShapeError, "")
    assert_refused(lambda: fit_capsule(np.zeros(3)), ShapeError, "")
    assert_refused(lambda: fit_capsule(np.array([[0, 0, np.nan]])), NotFiniteError, "")


@pytest.mark.parametrize(
    ("radius", "half"), [(0.1, 0.5), (0.2, 0.2), (0.3, 0.02), (0.05, 0.05), (0.2666643374642336, 5.976195030713273e-07)]
)
def test_capsule_around_cylinder(radius: float, half: float) -> None:
    r, h, gap = around_cylinder(radius, half)
    turn = np.linspace(0, 2 * math.pi, 400, endpoint=False)
    ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(400, half)])
    corners = np.vstack([ring, ring * [1, 1, -1]])
    a, b = np.array([0, 0, -h]), np.array([0, 0, h])
    shape = PlacedShape(Capsule(r, 2 * h), pin.SE3.Identity())
    assert outside((shape,), corners) <= 1e-12
    assert excess(corners, a, b, r) == pytest.approx(gap, abs=1e-4 * radius + radius * (1 - math.cos(math.pi / 400)))
    volume = 2 * h * r**2 + 4 / 3 * r**3
    assert volume <= 2 * half * radius**2 + 4 / 3 * radius**3 + 1e-12


@pytest.mark.parametrize("half", [(0.1, 0.2, 0.5), (0.3, 0.1, 0.1), (0.2, 0.2, 0.2), (0.01, 0.4, 0.3)])
def test_capsule_around_box(tmp_path: Path, half: tuple[float, float, float]) -> None:
    size = " ".join(str(2 * x) for x in half)
    path = tmp_path / "box.urdf"
    path.write_text(
        '<robot name="box"><link name="l"><collision><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>'
        f'<geometry><box size="{size}"/></geometry></collision></link></robot>'
    )
    (shape,) = wbc.robots.load(path).shapes["l"]
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    corners = (signs * half) @ pin.rpy.rpyToMatrix(0.4, 0.5, 0.6).T + [0.1, 0.2, 0.3]
    assert outside((shape,), corners) <= 1e-12
    assert excess(corners, *shape.ends(), shape.shape.radius) == pytest.approx(shape.excess, abs=1e-5)


def test_capsule_around_ellipsoid() -> None:
    radii = np.array([0.3, 0.1, 0.2])
    r, h, gap = around_ellipsoid(radii)
    unit = np.random.default_rng(0).normal(size=(4000, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    points = unit * radii
    axis = np.array([h, 0, 0])
    shape = PlacedShape(Capsule(r, 2 * h), pin.SE3(pin.utils.rotate("y", math.pi / 2), np.zeros(3)))
    assert outside((shape,), points) <= 1e-12
    assert excess(points, axis, -axis, r) == pytest.approx(gap, abs=2e-3)


def test_description_shapes_keep_spheres_and_name_meshes() -> None:
    collision = wbc.robots.load("panda_collision")
    assert any(s.shape == Sphere(0.09) and s.excess == 0.0 for s in collision.shapes["panda_link0"])
    panda = wbc.robots.load("panda", shapes="description")
    assert set(panda.shapes) == {"panda_leftfinger", "panda_rightfinger"}
    assert "panda_link4" in panda.notes["shapes"]
    assert wbc.robots.load("panda", shapes="none").shapes == {}


def test_fitting_some_links_leaves_the_others() -> None:
    panda = wbc.robots.load("panda")
    robot = wbc.robots.fit_shapes(panda, ["panda_link7"])
    assert set(robot.shapes) == set(panda.shapes)
    assert robot.shapes["panda_link6"] == panda.shapes["panda_link6"]
    assert robot.shapes["panda_link7"] != panda.shapes["panda_link7"]
    assert_refused(lambda: wbc.robots.fit_shapes(panda, ["panda_link77"]), UnknownNameError, "")


def test_missing_and_unreadable_meshes_are_named(tmp_path: Path) -> None:
    (tmp_path / "bad.stl").write_text("solid nothing")
    geometry = "<collision><geometry>{}</geometry></collision>"
    meshes = {"gone": "package://nowhere/gone.stl", "bad": "bad.stl", "far": "file:///nowhere/far.obj"}
    links = "".join(
        f'<link name="{link}">{geometry.format(f"""<mesh filename="{name}"/>""")}</link>'
        for link, name in meshes.items()
    )
    joints = "".join(
        f'<joint name="j{link}" type="fixed"><parent link="root"/><child link="{link}"/></joint>' for link in meshes
    )
    ball = geometry.format('<sphere radius="0.2"/>')
    (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="root">{ball}</link>{links}{joints}</robot>')
    robot = wbc.robots.load(tmp_path / "r.urdf", shapes="fit")
    assert set(robot.shapes) == {"root"}
    for link in meshes:
        assert f"{link}: mesh" in robot.notes["shapes"]


def test_package_folders_are_searched(tmp_path: Path) -> None:
    package = tmp_path / "packages" / "parts"
    package.mkdir(parents=True)
    source = example("panda_description/meshes/collision/finger.stl")
    (package / "finger.stl").write_bytes(source.read_bytes())
    path = tmp_path / "elsewhere" / "r.urdf"
    path.parent.mkdir()
    path.write_text(
        '<robot name="r"><link name="root"><collision><geometry>'
        '<mesh filename="package://parts/finger.stl" scale="2 2 2"/></geometry></collision></link></robot>'
    )
    robot = wbc.robots.load(path, shapes="fit", package_dirs=[tmp_path / "packages"])
    assert outside(robot.shapes["root"], 2 * mesh("panda_description/meshes/collision/finger.stl")) <= 1e-9
    assert wbc.robots.load(path, shapes="fit").shapes == {}


def test_a_model_needs_its_own_geometry() -> None:
    robot = wbc.robots.load(wbc.robots.load("ur5").model)
    assert_refused(lambda: wbc.robots.fit_shapes(robot), RobotFileError, "not read from a file")
    geometry = pin.GeometryModel()
    frame = robot.model.getFrameId("forearm_link")
    item = pin.GeometryObject(
        "ball", robot.model.frames[frame].parentJoint, frame, pin.SE3.Identity(), coal.Sphere(0.1)
    )
    geometry.addGeometryObject(item)
    assert wbc.robots.fit_shapes(robot, geometry=geometry).shapes["forearm_link"][0].shape == Sphere(0.1)
