"""Scenes: what is refused, footholds on surfaces by Coal, structures' files, families drawn from seeds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from tests.distances import coal_distance
from wbc.clearance import CylinderInside
from wbc.climb.machines import climber
from wbc.climb.scene import ClimbScene, Foothold, SceneBody, check_scale, of_structure, reaches, read_scene
from wbc.climb.scenes import draw, families, placed, size_of
from wbc.climb.surfaces import FootholdRules, footholds_on
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnknownNameError
from wbc.shapes import Box, Convex, Cylinder, HalfSpace, HeightMap, Sphere
from wbc.walking.holds.built_in import cylinder
from wbc.walking.holds.files import save_structure

HERE = pin.SE3.Identity()


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


def test_structures_are_read_as_they_are(tmp_path: Path) -> None:
    made = cylinder()
    scene = read_scene(save_structure(made, tmp_path / "cylinder.csv"))
    assert len(scene.footholds) == len(made.holds)
    np.testing.assert_allclose(scene.normals, -made.axes, atol=1e-12)
    np.testing.assert_allclose(scene.positions, made.positions, atol=1e-12)
    assert {f.on for f in of_structure(made).footholds} <= {"", "surface"}


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
        heights = [robot.contact_pose(q, limb).translation[2] for limb in range(len(robot.limbs))]
        assert np.abs(np.mean(heights)) < 1e-9
        assert max(heights) - min(heights) < 0.05
        assert robot.mass > 1.0
