"""The checker of climbing notices each fault that is planted in a clean log, and names where it is."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

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
from wbc.log import Log
from wbc.shapes import Box, PlacedShape, Sphere

#: A tick in the first swing
ALOFT = 50


@functools.cache
def walked() -> tuple[ContactPlan, ClimbRun]:
    plan = gait(TRIPODS)
    return plan, ClimbLoop(plan).run()


#: Rule that a fault breaks -> columns, ticks, and what takes the place of their values
Fault = tuple[tuple[str, ...], slice, Callable[[np.ndarray], object]]
AT, FROM, ALL = slice(ALOFT, ALOFT + 1), slice(ALOFT, None), slice(None)
KNEE = "q.8"
IN_THE_AIR: Fault = (("contact.limb1",), AT, lambda foothold: 6)
PLANTED: dict[str, Fault] = {
    "step of time": (("t",), FROM, lambda t: t + 0.003),
    "joint beyond its limit": ((KNEE,), ALL, lambda q: 2.5),
    "joint's rate": (("q.7",), FROM, lambda q: q + 0.1),
    "joint's acceleration": (("q.7",), FROM, lambda q: q + 0.02),
    "closed contact slips": (("q.0",), ALL, lambda x: x + np.minimum(np.linspace(0.0, 0.006, len(x)), 0.0015)),
    "closed contact off its foothold": (("q.1",), ALL, lambda y: y + 0.0025),
    "contacts bear the robot at rest": (("contact.limb2", "contact.limb4", "contact.limb6"), AT, lambda foothold: -1),
    "foothold that is another's": (("contact.limb1",), AT, lambda _: walked()[1].log.columns["contact.limb2"][ALOFT]),
    "clearance of bodies": ((KNEE,), slice(ALOFT - 3, ALOFT + 3), lambda q: q + 0.4),
    "contact's point in a body": ((KNEE,), slice(ALOFT - 3, ALOFT + 3), lambda q: q + 0.4),
}


def _changed(fault: Fault) -> Log:
    log = walked()[1].log
    columns = {name: values.copy() for name, values in log.columns.items()}
    names, ticks, change = fault
    for name in names:
        columns[name][ticks] = change(columns[name][ticks])
    return dataclasses.replace(log, columns=columns)


def test_a_clean_climb_is_clean() -> None:
    plan, run = walked()
    report = check(run.log, plan.climber, plan.scene)
    assert report.clean, str(report)
    assert {finding.rule for finding in report.findings} >= set(PLANTED)
    looked = {finding.rule: finding.count for finding in report.findings}
    assert min(count for rule, count in looked.items() if rule != "closed contact turned") > 0


@pytest.mark.parametrize("rule", PLANTED)
def test_a_fault_is_noticed_by_its_rule(rule: str) -> None:
    plan, _ = walked()
    report = check(_changed(PLANTED[rule]), plan.climber, plan.scene)
    assert rule in {finding.rule for finding in report.violations}, str(report)


def test_a_contact_that_closes_in_the_air_is_off_its_foothold() -> None:
    plan, _ = walked()
    report = check(_changed(IN_THE_AIR), plan.climber, plan.scene)
    worst = {finding.rule: finding for finding in report.violations}["closed contact off its foothold"]
    assert worst.where == "limb1 on p6"
    assert worst.worst > 0.03


def _with(scene: ClimbScene, name: str, body: PlacedShape) -> ClimbScene:
    return dataclasses.replace(scene, bodies={**scene.bodies, name: body})


def test_what_is_passed_between_two_ticks_is_found() -> None:
    plan, run = walked()
    # Every fifth tick of the swing: between two of them a foot goes on by some millimetres, past a grain of dust
    log = dataclasses.replace(
        run.log,
        columns={k: v[::5] for k, v in run.log.columns.items()},
        meta={**run.log.meta, "period": 0.05},
    )
    machine, q, t = plan.climber, log.array("q"), len(log) // 4
    ends = [machine.contact_pose(q[k], 0).translation for k in (t, t + 1)]
    middle = pin.integrate(machine.robot.model, q[t], 0.5 * pin.difference(machine.robot.model, q[t], q[t + 1]))
    between = machine.contact_pose(middle, 0).translation
    assert np.linalg.norm(ends[1] - ends[0]) > 0.005
    grain = PlacedShape(Sphere(2e-4), pin.SE3(np.eye(3), between))
    report = check(log, machine, _with(plan.scene, "grain", grain))
    violated = {finding.rule: finding for finding in report.violations}
    assert violated["clearance of bodies"].where == "limb1_link3 and grain"


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
    log = _changed((tuple(f"contact.limb{limb}" for limb in (1, 3, 4, 5)), ALL, lambda foothold: -1))
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
