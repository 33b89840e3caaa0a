"""The checker of climbing notices each fault that is planted in a clean log, and names where it is."""

from __future__ import annotations

import dataclasses
import functools

import coal
import numpy as np
import pinocchio as pin
import pytest

from tests.climb.by_hand import TRIPODS, gait
from wbc.climb import ClimbScene, ContactPlan
from wbc.climb.checker import CheckRules, check
from wbc.climb.checker.clearances import coal_distance
from wbc.climb.drive import standing_plan
from wbc.climb.loop import ClimbLoop, ClimbRun
from wbc.climb.machines import climber
from wbc.climb.request import ClimberRequest, ClimbRequest, PathRequest, SceneRequest
from wbc.climb.scene import Foothold
from wbc.climb.session import climb
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.errors import RangeError, ShapeError
from wbc.shapes import Box, PlacedShape


@functools.cache
def walked() -> tuple[ContactPlan, ClimbRun]:
    plan = gait(TRIPODS)
    return plan, ClimbLoop(plan).run()


def _with(scene: ClimbScene, name: str, body: PlacedShape) -> ClimbScene:
    return dataclasses.replace(scene, bodies={**scene.bodies, name: body})


def test_a_point_that_ends_within_what_may_be_missed_is_not_said_to_be_deeper() -> None:
    plan, run = walked()
    columns = {name: values[::5] for name, values in run.log.columns.items()}
    log = dataclasses.replace(run.log, columns=columns, meta={**run.log.meta, "period": 0.05})
    machine, q = plan.climber, log.array("q")
    points = np.array([machine.contact_pose(at, 0).translation for at in q])
    low = int(np.diff(points[:, 2]).argmin()) + 1
    assert points[low - 1, 2] - points[low, 2] > 0.002
    # Wide ground in which the point ends 0.3 mm deep: the rule has 0.4 mm
    top = points[low] + [0.0, 0.0, 3e-4]
    ground = PlacedShape(Box((0.2, 0.2, 0.1)), pin.SE3(np.eye(3), top - [0.0, 0.0, 0.05]))
    few = dataclasses.replace(log, columns={name: values[low - 1 : low + 1] for name, values in columns.items()})
    report = check(few, machine, _with(plan.scene, "ground", ground), CheckRules(clearance=0.0))
    points_rule = {finding.rule: finding for finding in report.findings}["contact's point in a body"]
    assert points_rule.kept, str(report)


def test_a_body_beside_the_way_is_as_near_as_coal_says() -> None:
    plan, run = walked()
    beside = PlacedShape(Box((0.1, 0.1, 0.1)), pin.SE3(np.eye(3), np.array([0.05, 0.0, 0.26 + 0.05])))
    report = check(run.log, plan.climber, _with(plan.scene, "lid", beside))
    assert report.clean, str(report)
    nearest = {finding.rule: finding for finding in report.findings}["clearance of bodies"]
    for wanted in (0.02, 0.06):
        strict = check(run.log, plan.climber, _with(plan.scene, "lid", beside), CheckRules(clearance=wanted))
        lid = [f for f in strict.violations if f.rule == "clearance of bodies"]
        # Top of the body's box: its height over the feet and half of its thickness
        gap = 0.26 - (float(run.log["q.2"].max()) + 0.04)
        assert bool(lid) is (wanted > gap) or nearest.worst < wanted


def test_limbs_that_may_not_hold_a_foothold_do_not() -> None:
    plan, run = walked()
    footholds = list(plan.scene.footholds)
    footholds[7] = dataclasses.replace(footholds[7], limbs=("limb1",))
    report = check(run.log, plan.climber, dataclasses.replace(plan.scene, footholds=footholds))
    assert [finding.rule for finding in report.violations] == ["foothold that is another's"]


def test_on_a_slope_the_lower_friction_counts() -> None:
    plan, run = walked()
    for angle, friction, holds in ((0.2, 0.8, True), (0.45, 0.8, True), (0.2, 0.1, False), (0.7, 0.8, False)):
        # The ground stays level, gravity leans: friction 0.6 of the feet bears up to 0.54 rad
        gravity = 9.81 * np.array([0.0, np.sin(angle), -np.cos(angle)])
        footholds = [dataclasses.replace(one, friction=friction) for one in plan.scene.footholds]
        scene = dataclasses.replace(plan.scene, gravity=gravity, footholds=footholds)
        ends = [0, len(run.log) - 1]
        standing = dataclasses.replace(run.log, columns={k: v[ends] for k, v in run.log.columns.items()})
        violated = {f.rule for f in check(standing, plan.climber, scene).violations}
        assert ("contacts bear the robot at rest" not in violated) is holds, (angle, friction)


def test_without_weight_contacts_must_fix_the_body() -> None:
    plan, run = walked()
    scene = dataclasses.replace(plan.scene, gravity=np.zeros(3))
    assert check(run.log, plan.climber, scene).clean
    opened = {f"contact.limb{limb}": np.full(len(run.log), FREE_LIMB) for limb in (1, 3, 4, 5)}
    log = dataclasses.replace(run.log, columns={**run.log.columns, **opened})
    assert "contacts fix the body" in {f.rule for f in check(log, plan.climber, scene).violations}


def test_logs_of_others_are_refused() -> None:
    plan, run = walked()
    with pytest.raises(RangeError, match="another robot"):
        check(dataclasses.replace(run.log, meta={**run.log.meta, "robot_digest": "x"}), plan.climber, plan.scene)
    few = dataclasses.replace(plan.scene, footholds=plan.scene.footholds[:3])
    with pytest.raises(ShapeError, match="3 footholds"):
        check(run.log, plan.climber, few)


@pytest.mark.parametrize(
    ("rotation", "height"),
    [
        ([[0.95428, 0.29893, 0.0], [0.29893, -0.95427, 1e-5], [0.0, 0.0, -1.0]], 0.1262),
        # 2.4 m deep by Coal 3.0.3
        ([[0.6145672, -0.7888644, -2e-7], [-0.7888644, -0.6145672, -3e-7], [1e-7, 3e-7, -1.0]], 0.1262008),
    ],
)
def test_distances_are_known_where_coal_has_no_answer_or_a_wrong_one(
    rotation: list[list[float]], height: float
) -> None:
    capsule, box = coal.Capsule(0.0508, 0.1524), coal.Box(4.7, 0.24415, 0.1)
    at = pin.SE3(np.array(rotation), np.array([-8e-7, 4e-7, height]))
    assert coal_distance(capsule, at, box, pin.SE3.Identity()) == pytest.approx(-0.0508, abs=4e-5)


def test_a_round_foot_leaves_a_mesh_that_it_is_deep_in() -> None:
    done = climb(ClimbRequest(PathRequest(speed=0.0), ClimberRequest("anymal_c"), SceneRequest(scene="mesh")))
    assert done.report is not None
    assert done.report.clean, done.report


def test_a_sole_bears_as_it_is_turned_on_its_foothold() -> None:
    robot, slacks = climber("talos"), list[float]()
    for angle in (0.0, np.pi / 2):
        poses = [robot.contact_pose(robot.rest, limb) for limb in range(2)]
        turned = [pose * pin.SE3(pin.utils.rotate("z", angle), np.zeros(3)) for pose in poses]
        scene = ClimbScene(
            [Foothold(str(row), pose) for row, pose in enumerate(turned)], {}, np.array([0.0, 0.0, -9.81])
        )
        run = ClimbLoop(standing_plan(robot, scene, Stance((0, FREE_LIMB), robot.rest), 0.05), backend="vm").run()
        report = check(run.log, robot, scene)
        slacks.append(next(f.worst for f in report.findings if f.rule == "contacts bear the robot at rest"))
    assert np.isfinite(slacks[0])
    assert slacks[1] == pytest.approx(slacks[0], abs=1e-6)
