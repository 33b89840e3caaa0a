"""Scenes: what is refused, footholds on surfaces by Coal, built-in grids and their places, families from seeds."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.distances import coal_distance
from wbc.clearance import CylinderInside
from wbc.climb.grids import (
    GRID_ENDS,
    GRIDS,
    INCH,
    cylinder_grid,
    grid_place,
    grid_pose,
    module,
    plane_grid,
    remove_columns,
    remove_fraction,
    remove_rows,
    truss_grid,
)
from wbc.climb.machines import climber
from wbc.climb.places import body_frames, body_over, surface_frames
from wbc.climb.scene import ClimbScene, Foothold, SceneBody, check_scale, reaches, size_of
from wbc.climb.scenes import draw, families, placed
from wbc.climb.surfaces import FootholdRules, footholds_on
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnknownNameError, WbcError
from wbc.geometry.kernel import segments_from
from wbc.shapes import Box, Convex, Cylinder, HalfSpace, HeightMap, Sphere

HERE = pin.SE3.Identity()
POSE = pin.SE3(pin.utils.rotate("x", 0.7) @ pin.utils.rotate("z", -1.1), np.array([0.3, -2.0, 5.0]))


def test_footholds_are_on_surfaces_and_their_normals_lead_out_of_them() -> None:
    rng = np.random.default_rng(0)
    hull = Convex(rng.normal(size=(14, 3)))
    shapes = [Box((1.0, 0.6, 0.4)), Cylinder(0.4, 1.2), hull, HalfSpace()]
    for shape in shapes:
        pose = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
        found = footholds_on("thing", shape, pose, FootholdRules(0.15, 0.02))
        assert len(found) > 20
        points = np.array([f.pose.translation for f in found])
        apart = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(len(points))
        assert apart.min() > 0.75 * 0.15 * (1 - 1e-6)
        for foothold in found:
            out = foothold.pose * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.011]))
            assert coal_distance(Sphere(0.001), out, shape, pose) == pytest.approx(0.01, abs=1e-3)


def test_edges_slopes_and_roughness_are_kept_off() -> None:
    box = Box((1.0, 0.6, 0.4))
    top = footholds_on("box", box, HERE, FootholdRules(0.1, 0.05, max_slope=0.1))
    points = np.array([f.pose.translation for f in top])
    np.testing.assert_allclose(points[:, 2], 0.2)
    assert (np.abs(points[:, :2]) <= np.array([0.45, 0.25]) + 1e-9).all()
    heights = np.zeros((31, 31))
    heights[:, 16:] = np.random.default_rng(0).uniform(-0.1, 0.1, (31, 15))
    rules = FootholdRules(0.15, 0.0, sole=0.08, max_roughness=0.01, max_slope=0.4)
    even = np.array(
        [f.pose.translation for f in footholds_on("field", HeightMap(heights, (3.0, 3.0), 0.5), HERE, rules)]
    )
    assert len(even) > 50
    assert (even[:, 0] < 0.11).mean() > 0.97
    inside = footholds_on("pipe", CylinderInside(0.7), HERE, FootholdRules(0.2, 0.0, extent=1.0))
    for foothold in inside:
        at, normal = foothold.pose.translation, foothold.pose.rotation[:, 2]
        assert np.linalg.norm(at[:2]) == pytest.approx(0.7)
        assert normal[:2] @ at[:2] == pytest.approx(-0.7)


def test_bad_scenes_are_refused_with_the_reason() -> None:
    one = Foothold("a", HERE)
    with pytest.raises(ShapeError, match="no foothold"):
        ClimbScene([])
    with pytest.raises(DuplicateNameError):
        ClimbScene([one, Foothold("a", HERE)])
    with pytest.raises(UnknownNameError, match="floor"):
        ClimbScene([Foothold("a", HERE, "flor")], {"floor": SceneBody(HalfSpace())})
    with pytest.raises(RangeError, match="friction"):
        Foothold("a", HERE, friction=0.0)
    robot = climber("hexapod")
    course = draw("stepping_stones", size_of(robot))
    check_scale(robot, course.scene)
    for factor, reason in ((1000.0, "no two limbs"), (0.001, "the robot spans")):
        other = [Foothold(f.id, pin.SE3(f.pose.rotation, factor * f.pose.translation)) for f in course.scene.footholds]
        with pytest.raises(RangeError, match=reason):
            check_scale(robot, ClimbScene(other))


@pytest.mark.parametrize("name", GRIDS)
def test_holds_of_grids_are_on_their_bodies_and_the_way_out_is_open(name: str) -> None:
    scene = GRIDS[name]().moved(POSE)
    assert scene.name == name
    assert not scene.gravity.any()
    assert {f.on for f in scene.footholds} <= set(scene.bodies)
    assert {foothold.id for foothold in scene.footholds} >= set(GRID_ENDS[name])
    lifted = scene.positions + 3 * INCH * scene.normals
    heights = {}
    for body, placed_shape in scene.bodies.items():
        shape, pose, turn = placed_shape.shape, placed_shape.placement.translation, placed_shape.placement.rotation
        on, out = (segments_from(shape, x, x) for x in ((scene.positions - pose) @ turn, (lifted - pose) @ turn))
        own = np.array([foothold.on == body for foothold in scene.footholds])
        np.testing.assert_allclose(on[own], 0.0, atol=1e-12)
        assert (on > -1e-12).all()
        heights[body] = out
    np.testing.assert_allclose(np.min([*heights.values()], axis=0), 3 * INCH, atol=1e-12)
    apart = np.linalg.norm(scene.positions[:, None] - scene.positions[None], axis=-1)
    assert apart[np.triu_indices(len(apart), 1)].min() > 0.1


def test_grids_have_their_sizes() -> None:
    small = plane_grid(3, 4, 0.5)
    assert [f.id for f in small.footholds][:5] == ["1,1", "1,2", "1,3", "1,4", "2,1"]
    np.testing.assert_allclose(small.positions[small.row("3,4")], [2.0, 1.5, 0.0])
    rails = GRIDS["module"]()
    assert np.hypot(*rails.positions[rails.row("15,0"), 1:]) == pytest.approx(2.17)
    assert len(module(length=4.0).footholds) < len(rails.footholds)
    short = truss_grid(bays=2)
    assert short.positions[short.row("L1,8"), 0] == pytest.approx(2 * 0.94)
    for call, field in ((lambda: module(length=1e9), "length"), (lambda: plane_grid(0, 3), "rows"),
                        (lambda: plane_grid(3, 10**9), "columns"),
                        (lambda: plane_grid(3, 3, -1.0), "pitch"), (lambda: truss_grid(2, radius=1.0), "radius"),
                        (lambda: truss_grid(True), "bays")):  # fmt: skip
        with pytest.raises(WbcError, match=field):
            call()


def test_rows_columns_and_shares_can_go() -> None:
    grid, ids = cylinder_grid(), lambda scene: [foothold.id for foothold in scene.footholds]
    less = remove_rows(grid, "12-14")
    assert (len(less.footholds), less.name, less.bodies) == (600 - 75, grid.name, grid.bodies)
    assert not {f"{t},{a}" for t in range(1, 26) for a in (12, 13, 14)} & set(ids(less))
    assert ids(remove_rows(grid, 12)) == ids(remove_rows(grid, "12"))
    assert len(remove_columns(grid, "1-2, 25").footholds) == 600 - 72
    assert "3,12" in ids(remove_columns(grid, "1-2,25"))
    thinned = remove_fraction(grid, 0.3, seed=4)
    assert len(thinned.footholds) == 420
    assert ids(thinned) == ids(remove_fraction(grid, 0.3, seed=4)) != ids(remove_fraction(grid, 0.3, seed=5))
    assert ids(remove_fraction(grid, 0.0)) == ids(grid)
    for bad in ("14-12", "a", "", "12-", "30", "1-999999999"):
        with pytest.raises(RangeError, match="rows"):
            remove_rows(grid, bad)
    with pytest.raises(RangeError, match="named by two whole numbers"):
        remove_rows(truss_grid(), "1")
    for call, field in ((lambda: remove_columns(grid, 1.5), "columns"), (lambda: remove_fraction(grid, 1.5), "share"),
                        (lambda: remove_fraction(grid, 1.0), "no foothold"), (lambda: remove_rows(None, 1), "scene"),
                        (lambda: remove_fraction(grid, 0.5, -1), "seed")):  # fmt: skip
        with pytest.raises(WbcError, match=field):
            call()


def test_places_by_text_are_frames_on_the_surface_and_poses_of_the_body() -> None:
    walker, grid = climber("walker"), remove_rows(cylinder_grid(), "7")
    # On the cylinder: T and A with fractions, the heading from +A towards +T, holds or not; the body as it is published
    for text, t, a, heading in (("13,6", 13.0, 6.0, 0.0), ("14.5,7,30", 14.5, 7.0, np.radians(30))):
        assert grid_place("place", text) == (t, a, pytest.approx(heading))
        (pose,) = body_frames(walker, grid, [text])
        np.testing.assert_allclose(pose.homogeneous, grid_pose(t, a, 152 * INCH, heading).homogeneous, atol=1e-12)
    # Elsewhere ids: x towards the next place, then by the smallest turn from normal to normal
    rails = module()
    first, second, last = surface_frames(rails, ["15,4", "12,8", "12,8,90"])
    for frame, name in ((first, "15,4"), (second, "12,8"), (last, "12,8")):
        np.testing.assert_allclose(frame.translation, rails.positions[rails.row(name)])
        np.testing.assert_allclose(frame.rotation[:, 2], rails.normals[rails.row(name)], atol=1e-12)
    ahead = second.translation - first.translation
    assert abs(first.rotation[:, 1] @ ahead) < 1e-12 < first.rotation[:, 0] @ ahead
    axis = pin.log3(second.rotation @ first.rotation.T)
    np.testing.assert_allclose(np.linalg.norm(axis), np.arccos(first.rotation[:, 2] @ second.rotation[:, 2]))
    np.testing.assert_allclose(last.rotation[:, 1], -rails.footholds[rails.row("12,8")].pose.rotation[:, 0], atol=1e-12)
    # A place alone has the foothold's own x
    (alone,) = surface_frames(rails, ["15,4"])
    np.testing.assert_allclose(alone.rotation, rails.footholds[rails.row("15,4")].pose.rotation, atol=1e-12)
    for places, error, said in ((["15,4,north"], ShapeError, "angle"), (["15,400"], UnknownNameError, "15,4"),
                                ([], ShapeError, "one place"), ("15,4", ShapeError, "places")):  # fmt: skip
        with pytest.raises(error, match=said):
            surface_frames(rails, places)
    with pytest.raises(RangeError, match=r"place 1\.T"):
        surface_frames(grid, ["26,1"])
    with pytest.raises(ShapeError, match="expected T,A"):
        surface_frames(grid, ["L2,6"])


@pytest.mark.parametrize("family", families())
def test_families_are_drawn_from_seeds_at_the_size_of_a_robot(family: str) -> None:
    robot = climber("hexapod")
    course, again, other = (draw(family, size_of(robot), seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(course.scene.positions, again.scene.positions)
    assert family in ("cylinder", "truss", "stairs", "rebar", "inside", "chimney", "passage", "gap") or (
        len(other.scene.positions) != len(course.scene.positions)
        or not np.allclose(other.scene.positions, course.scene.positions)
    )
    check_scale(robot, course.scene)
    assert {f.on for f in course.scene.footholds} <= set(course.scene.bodies)
    for end in (course.start, course.goal):
        body = robot.body_pose(placed(robot, end))
        up = (body.translation - end.translation) @ end.rotation[:, 2]
        assert 0.0 < up < reaches(robot).max()


def test_every_climber_stands_off_a_frame_at_rest() -> None:
    for name in ("walker", "truss_climber", "wall_climber", "octopod", "hexapod_grips"):
        robot = climber(name)
        q = placed(robot, HERE)
        assert body_over(robot, HERE).translation[2] == pytest.approx(robot.height or robot.body_pose(q).translation[2])
        heights = [robot.contact_pose(q, limb).translation[2] for limb in range(len(robot.limbs))]
        assert np.abs(np.mean(heights)) < 1e-9
        assert max(heights) - min(heights) < 0.05
        assert robot.mass > 1.0
