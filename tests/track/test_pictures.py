"""The renderer against known projections and shadows; a picture of a robot without meshes."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.models import placement

# isort: split
import coal
import pytest
from matplotlib.image import imread

import wbc
from tests.distances import coal_pose, coal_shape
from wbc import track
from wbc.errors import NotFiniteError, RangeError, RotationError, ShapeError, UnknownNameError, WbcError
from wbc.shapes import Box, Capsule, Convex, Cylinder, HalfSpace, PlacedShape, Solid, Sphere
from wbc.track import render
from wbc.track.plots import save_picture, save_plots
from wbc.track.scene import OBSTACLE, PATH, simplified

CAMERA = render.Camera(np.array([4.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0]), math.radians(40.0), 160, 120)
RED = (1.0, 0.0, 0.0)


def test_projection_of_known_points() -> None:
    middle, right, up = CAMERA.project(np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 0.0, 2.0]]))
    focal = 60.0 / math.tan(math.radians(20.0))
    np.testing.assert_allclose(middle, [80.0, 60.0, 4.0])
    np.testing.assert_allclose(right, [80.0 + focal / 4.0, 60.0, 4.0])
    np.testing.assert_allclose(up, [80.0, 60.0 - focal / 4.0, 4.0])
    rays = CAMERA.rays()
    again = CAMERA.project(CAMERA.eye + 3.0 * rays)
    np.testing.assert_allclose(again[30, 40], [40.5, 30.5, 3.0], atol=1e-9)
    mask = np.zeros((120, 160), dtype=bool)
    mask[30, 40] = True
    np.testing.assert_allclose(CAMERA.rays(mask)[0], rays[30, 40])


def test_sphere_covers_its_disc_and_has_its_depth() -> None:
    layer = render.draw([render.sphere(np.array([0.0, 0.0, 1.0]), 0.5, RED)], CAMERA)
    rays = CAMERA.rays()
    # Ray against sphere, in closed form
    a, b = np.sum(rays**2, axis=-1), rays @ (CAMERA.eye - np.array([0.0, 0.0, 1.0]))
    root = b**2 - a * (16.0 - 0.25)
    expected = np.where(root > 0.0, (-b - np.sqrt(np.maximum(root, 0.0))) / a, np.inf)
    seen = np.isfinite(layer.depth)
    assert (seen != np.isfinite(expected)).sum() < 30
    both = seen & np.isfinite(expected) & (root > 0.02)
    assert both.sum() > 800
    np.testing.assert_allclose(layer.depth[both], expected[both], atol=5e-3)
    normals = layer.normals[layer.owner[both]]
    points = CAMERA.eye + rays[both] * layer.depth[both][:, None]
    outward = (points - np.array([0.0, 0.0, 1.0])) / 0.5
    assert np.abs(np.sum(normals * outward, axis=1)).min() > 0.99


def test_nearer_surfaces_hide_farther_ones() -> None:
    near = render.sphere(np.array([1.0, 0.0, 1.0]), 0.2, RED)
    far = render.sphere(np.array([0.0, 0.0, 1.0]), 0.5, (0.0, 0.0, 1.0))
    for meshes in ([near, far], [far, near]):
        layer = render.draw(meshes, CAMERA)
        assert tuple(layer.colours[layer.owner[60, 80]]) == RED
        assert tuple(layer.colours[layer.owner[60 - 20, 80]]) == (0.0, 0.0, 1.0)


def test_a_ball_throws_its_shadow_along_the_light() -> None:
    center = np.array([0.0, 0.0, 1.0])
    shadows = render.Shadows([render.sphere(center, 0.3, RED), render.sphere(np.array([2.0, 2.0, 0.1]), 0.1, RED)])
    below = center - render.LIGHT * (center[2] / render.LIGHT[2])
    around = below + np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    np.testing.assert_allclose(shadows.lit(around, 0.01), [0.0, 1.0, 1.0])


def test_tube_stays_at_its_radius() -> None:
    t = np.linspace(0.0, 3.0, 50) ** 2
    line = np.column_stack([np.cos(t / 3.0), np.sin(t / 3.0), t / 9.0])
    points = render.tube(line, 0.02, RED).triangles.reshape(-1, 3)
    gaps = np.linalg.norm(points[:, None] - line[None], axis=2).min(axis=1)
    assert gaps.max() < 0.1
    assert len(render.tube(np.zeros((4, 3)), 0.02, RED).triangles) == 0


def test_picture_and_plots_of_a_robot_without_meshes(tmp_path: Path) -> None:
    rows = [wbc.robots.DHRow(a=0.4) for _ in range(3)]
    robot = wbc.robots.from_dh(rows)
    lying = pin.SE3(pin.utils.rotate("y", math.pi / 2), np.array([-0.2, 0.0, 0.0]))
    robot = robot.with_shapes({f"link{k}": [PlacedShape(Capsule(0.04, 0.4), lying)] for k in (1, 2, 3)})
    start = np.array([0.3, 0.5, 0.5])
    here = placement(robot, "tip", start)
    there = pin.SE3(here.rotation, here.translation + np.array([0.0, -0.2, 0.0]))
    plan = track.PathRun(
        robot, "tip", track.SplinePath([0.0, 1.0], [here, there]), "down", start, dt=0.02, backend="vm"
    )
    log = track.track(plan)
    file = save_picture(log, robot, tmp_path / "overview.png", size=(120, 80))
    assert file is not None
    pixels = imread(file)
    assert pixels.shape[:2] == (80, 120)
    assert pixels[..., :3].std() > 0.02
    names = {f.stem for f in save_plots(log, tmp_path)}
    assert names == {"joints", "velocities", "accelerations", "errors", "tick_time"}


def test_a_scene_shows_what_was_added(tmp_path: Path) -> None:
    """Each thing where it is and in its colour; the pale links only where they have moved."""
    robot = wbc.robots.from_dh([wbc.robots.DHRow(a=0.5)] * 2)
    robot = robot.with_shapes({f"link{k}": [PlacedShape(Sphere(0.1), pin.SE3.Identity())] for k in (1, 2)})

    def drawn(q2: float, balls: bool = True, hidden: tuple[str, ...] = ()) -> np.ndarray:
        scene = track.Scene(robot, hidden=hidden)
        # Far apart in the corners, these hold the camera where it is
        for side in (-1.0, 1.0):
            scene.add_shape(Box((0.02, 0.02, 0.02)), pin.SE3(np.eye(3), np.array([0.0, 1.5 * side, side + 1.0])))
        scene.add_robot(np.zeros(2))
        scene.add_robot(np.array([0.0, q2]), pale=True)
        if balls:
            scene.add_shape(Sphere(0.2), pin.SE3(np.eye(3), np.array([0.0, -1.0, 1.5])), "ball")
            scene.add_path(np.array([[0.0, -1.0, 0.4], [0.0, 1.0, 0.4]]), "path", radius=0.04)
        pixels = imread(scene.save(tmp_path / "new" / "scene.png", size=(300, 200), azimuth=0.0, elevation=0.0))
        return np.asarray(pixels[..., :3], dtype=float)

    def part(pixels: np.ndarray, colour: tuple[float, float, float]) -> np.ndarray:
        """Pixels of a hue, whatever light falls on them, left of the key."""
        unit = pixels / np.linalg.norm(pixels, axis=2, keepdims=True)
        there = unit @ (np.array(colour) / np.linalg.norm(colour)) > 0.985
        there[:80, 180:] = False
        return there

    still, moved, bare = drawn(0.0), drawn(1.2), drawn(0.0, balls=False)
    rows, columns = np.nonzero(part(still, OBSTACLE))
    assert abs(columns.mean() - 60) < 15
    assert rows.mean() < 80
    rows, columns = np.nonzero(part(still, PATH))
    assert columns.min() < 80
    assert columns.max() > 220
    assert rows.mean() > 100
    assert part(bare, PATH).sum() == 0
    assert np.abs(moved - still).max() > 0.02
    assert np.array_equal(drawn(0.0, hidden=("link*",)), drawn(1.2, hidden=("link1", "link2")))
    assert not np.array_equal(drawn(0.0, hidden=("link*",)), still)
    assert np.array_equal(still, drawn(0.0))


def test_a_film_shows_what_moves_before_and_behind_what_stands_still() -> None:
    robot = wbc.robots.from_dh([wbc.robots.DHRow(a=0.5)])
    scene, wide = track.Scene(robot), Box((0.1, 1.0, 1.0))
    scene.add_shape(wide, pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0])), colour=PATH)
    frame = scene.film(CAMERA)

    def red(x: float, y: float = 0.0) -> np.ndarray:
        scene.add_shape(Sphere(0.2), pin.SE3(np.eye(3), np.array([x, y, 1.0])), colour=RED)
        picture = frame().astype(int)
        return np.asarray(picture[..., 0] - picture[..., 2] > 60)

    ahead, aside, empty = red(1.0), red(0.0, 0.9), frame()
    rows, columns = np.nonzero(ahead)
    assert abs(rows.mean() - 59.5) < 1.0
    assert abs(columns.mean() - 79.5) < 1.0
    radius = 60.0 / math.tan(math.radians(20.0)) * 0.2 / 3.0
    assert ahead.sum() == pytest.approx(math.pi * radius**2, rel=0.1)
    assert np.nonzero(aside)[1].min() > 100
    assert red(-1.0).sum() == 0
    # What was drawn in one picture is not in the next, and what stands still stays as it was
    assert np.array_equal(frame(), empty)
    assert (empty[60, 80] < 250).any()


def test_simplified_meshes_stay_near_the_fine_ones() -> None:
    fine = render.sphere(np.array([0.2, 0.1, 0.0]), 0.5, RED).triangles
    assert simplified(fine, 0.0) is fine
    coarse = simplified(fine, 0.05)
    assert 100 < len(coarse) < len(fine) / 4
    radii = np.linalg.norm(coarse - np.array([0.2, 0.1, 0.0]), axis=-1)
    assert radii.min() > 0.45
    assert radii.max() <= 0.5 + 1e-9


def test_scenes_refuse_what_cannot_be_drawn(tmp_path: Path) -> None:
    robot = wbc.robots.from_dh([wbc.robots.DHRow(a=0.5)] * 2)
    with pytest.raises(UnknownNameError, match=r"Scene\.dark"):
        track.Scene(robot, dark=["hand"])
    with pytest.raises(UnknownNameError, match=r"Scene\.hidden.*did you mean 'link1'"):
        track.Scene(robot, hidden=["link*", "linc1"])
    with pytest.raises(RangeError, match=r"Scene\.detail"):
        track.Scene(robot, detail=-1.0)
    scene = track.Scene(robot)
    scene.add_shape(Sphere(0.1), pin.SE3.Identity(), pale=True)
    refused: list[tuple[type[WbcError], str, Callable[[], object]]] = [
        (ShapeError, "q", lambda: scene.add_robot(np.zeros(3))),
        (ShapeError, "Scene.shape", lambda: scene.add_shape(HalfSpace(), pin.SE3.Identity())),  # type: ignore[arg-type]
        (RotationError, "Scene.pose", lambda: scene.add_shape(Sphere(0.1), np.zeros((4, 4)))),
        (ShapeError, "Scene.points", lambda: scene.add_path(np.zeros((4, 2)))),
        (NotFiniteError, "Scene.points", lambda: scene.add_path(np.full((4, 3), np.nan))),
        (RangeError, "Scene.radius", lambda: scene.add_path(np.zeros((4, 3)), radius=0.0)),
        (RangeError, "Scene.elevation", lambda: scene.save(tmp_path / "a.png", elevation=math.pi / 2)),
        (RangeError, "Scene.size", lambda: scene.save(tmp_path / "a.png", size=(0, 10))),
        (RangeError, "not pale", lambda: scene.save(tmp_path / "a.png")),
    ]
    for kind, field, call in refused:
        with pytest.raises(kind, match=field):
            call()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.2),
        Capsule(0.1, 0.3),
        Box((0.1, 0.2, 0.3)),
        Cylinder(0.1, 0.3),
        Convex(np.random.default_rng(0).normal(size=(30, 3))),
    ],
    ids=lambda s: type(s).__name__,
)
def test_surface_of_every_solid(shape: Solid) -> None:
    """Corners lie on the surface that Coal sees, and the triangles reach as far as it does along every direction."""
    place = pin.SE3(pin.exp3(np.array([0.3, -0.5, 0.7])), np.array([0.1, 0.2, -0.3]))
    points = render.triangles(PlacedShape(shape, place)).reshape(-1, 3)
    geometry, there = coal_shape(shape), coal_pose(place)
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    # Coal errs for a ball on the middle of a cylinder's end
    off_axis = np.linalg.norm(place.rotation[:, :2].T @ (points - place.translation).T, axis=0) > 1e-6
    for point in points[off_axis][:: max(1, len(points) // 50)]:
        dot = coal.Transform3s(np.eye(3), point)
        gap = coal.distance(coal.Sphere(0.01), dot, geometry, there, request, coal.DistanceResult())
        assert gap == pytest.approx(-0.01, abs=1e-6)
    for direction in np.concatenate([np.eye(3), -np.eye(3)]):
        far = pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), -direction).matrix(), 9.0 * direction)
        plane, wall = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), coal.Transform3s(far.rotation, far.translation)
        gap = coal.distance(geometry, there, plane, wall, request, coal.DistanceResult())
        assert 9.0 - (points @ direction).max() == pytest.approx(gap, abs=2e-3)
