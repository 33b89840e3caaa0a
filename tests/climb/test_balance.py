"""Equilibrium of contacts, against scipy's program of the whole problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from tests.climb.bearing import slack_by_scipy
from tests.repeats import covering, repeats
from wbc.climb.balance import Equilibrium
from wbc.climb.climber import Climber
from wbc.climb.contacts import SuctionPad
from wbc.climb.machines import climber
from wbc.climb.scene import ClimbScene, Foothold
from wbc.errors import RangeError, ShapeError
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

ROBOTS = ("anymal_c", "octopod", "talos_hands", "hexapod_grips", "walker")


def around(
    robot: Climber, rng: np.random.Generator, gravity: Array | None = None, lean: float = 0.5, most: float = np.inf
) -> ClimbScene:
    """Footholds near the contacts at rest, tilted, with frictions of their own up to the largest."""
    holds = []
    for limb in range(len(robot.limbs)):
        pose = robot.contact_pose(robot.rest, limb)
        if robot.fixed(limb) == "position":
            pose = pin.SE3(np.eye(3), pose.translation)
        tilt = pin.SE3(pin.exp3(rng.uniform(-lean, lean, 3)), rng.uniform(-0.1, 0.1, 3))
        frictions = [friction for friction in (0.3, 0.7, np.inf) if friction <= most]
        holds.append(Foothold(str(limb), pose * tilt, friction=float(rng.choice(frictions))))
    return ClimbScene(holds, {}, np.array([0.0, 0.0, -9.81]) if gravity is None else gravity)


@pytest.mark.parametrize(("name", "seed"), covering(ROBOTS, range(repeats(2))))
def test_margins_are_those_of_the_whole_program(name: str, seed: int) -> None:
    robot, rng = climber(name), np.random.default_rng(seed)
    scene = around(robot, rng)
    balance = Equilibrium(robot, scene)
    finite = 0
    for _ in range(repeats(12)):
        contacts = [limb if rng.random() < 0.75 else -1 for limb in range(len(robot.limbs))]
        q = robot.robot.integrate(robot.rest, np.append(rng.normal(0.0, 0.1, 6), np.zeros(robot.robot.nv - 6)))
        wanted = slack_by_scipy(robot, scene, contacts, q)
        assert balance.margin(contacts, q) == pytest.approx(wanted, abs=1e-6)
        finite += bool(np.isfinite(wanted))
    assert finite >= 3


def test_without_weight_contacts_hold_or_do_not() -> None:
    robot = climber("walker")
    balance = Equilibrium(robot, around(robot, np.random.default_rng(0), np.zeros(3)))
    assert balance.margin([0, 1, -1], robot.rest) == np.inf
    assert balance.margin([0, -1, -1], robot.rest) == -np.inf  # a hand that rolls alone lets it turn
    legs = climber("anymal_c")
    scene = around(legs, np.random.default_rng(0), np.zeros(3))
    assert Equilibrium(legs, scene).margin([0, 1, 2, 3], legs.rest) == -np.inf  # feet on a floor press on nothing


def test_motors_that_are_too_weak_do_not_bear() -> None:
    robot = climber("anymal_c")
    scene = ClimbScene(
        [Foothold(str(k), pin.SE3(np.eye(3), robot.contact_pose(robot.rest, k).translation)) for k in range(4)]
    )
    free = Equilibrium(robot, scene).margin([0, 1, 2, 3], robot.rest)
    assert Equilibrium(robot, scene).margin([0, 1, 2, 3], robot.rest, motors=True) == pytest.approx(free, abs=1e-6)
    least = _least_torque(robot)
    for share, stands in ((1.01, True), (0.99, False)):
        effort = np.array(robot.robot.limits.effort)
        effort[6:] = share * least
        weak = Climber(robot.robot.with_limits(effort=effort), robot.limbs, robot.rest)
        margin = Equilibrium(weak, scene).margin([0, 1, 2, 3], robot.rest, motors=True)
        assert (margin > -np.inf and margin > -1.0) == stands
        effort[6:] = 2.0 * least
        strong = Climber(robot.robot.with_limits(effort=effort), robot.limbs, robot.rest)
        part = Equilibrium(strong, scene).margin([0, 1, 2, 3], robot.rest, motors=True, effort=0.5 * share)
        assert part == pytest.approx(margin, abs=1e-6)


def _least_torque(robot: Climber) -> float:
    """The least largest torque with which four feet bear the robot at rest, by a program of its own: any forces."""
    model, data = robot.robot.model, robot.robot.model.createData()
    pin.computeJointJacobians(model, data, robot.rest)
    own = pin.computeGeneralizedGravity(model, data, robot.rest)
    maps = []
    for limb in robot.limbs:
        frame = frame_index(model, limb.frame)
        pin.updateFramePlacement(model, data, frame)
        maps.append(pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:3].T)
    J = np.hstack(maps)
    ones = np.ones((len(own) - 6, 1))
    sides = np.vstack([np.hstack([-J[6:], -ones]), np.hstack([J[6:], -ones])])
    cost = np.append(np.zeros(J.shape[1]), 1.0)
    answer = linprog(
        cost, sides, np.concatenate([-own[6:], own[6:]]), np.hstack([J[:6], np.zeros((6, 1))]), own[:6],
        [(None, None)] * len(cost), method="highs",
    )  # fmt: skip
    return float(answer.x[-1])


def test_a_pad_bears_what_its_pull_allows() -> None:
    robot = climber("anymal_c")
    hung = Climber(robot.robot, [replace(limb, contact=SuctionPad(pull=1000.0)) for limb in robot.limbs], robot.rest)
    ceiling = [
        Foothold(str(k), pin.SE3(pin.utils.rotate("x", np.pi), robot.contact_pose(robot.rest, k).translation))
        for k in range(4)
    ]
    scene = ClimbScene(ceiling)
    margin = Equilibrium(hung, scene).margin([0, 1, 2, 3], robot.rest)
    assert margin == pytest.approx(slack_by_scipy(hung, scene, [0, 1, 2, 3], robot.rest), abs=1e-6)
    assert margin > 0.0 > Equilibrium(robot, scene).margin([0, 1, 2, 3], robot.rest)


def test_contacts_that_are_none_are_named() -> None:
    robot = climber("anymal_c")
    scene = ClimbScene([Foothold("a", pin.SE3.Identity(), limbs=("LF_FOOT",)), Foothold("b", pin.SE3.Identity())])
    balance = Equilibrium(robot, scene)
    with pytest.raises(ShapeError, match="one for each limb"):
        balance.margin([0, 1], robot.rest)
    with pytest.raises(RangeError, match="rows from 0 to 1"):
        balance.margin([0, 1, 2, -1], robot.rest)
    with pytest.raises(RangeError, match="foothold a is for LF_FOOT"):
        balance.margin([1, 0, -1, -1], robot.rest)
