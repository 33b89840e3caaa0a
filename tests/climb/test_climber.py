"""Climbers: chains of limbs, accessors against Pinocchio, and refusals by name."""

from __future__ import annotations

import pickle

import numpy as np
import pinocchio as pin
import pytest

from wbc.climb.climber import Climber, ClimbLimb
from wbc.climb.contacts import PointFoot
from wbc.climb.machines import climber
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnknownNameError
from wbc.robots.catalogue import load


def test_accessors_are_those_of_the_configuration() -> None:
    robot, rng = climber("walker"), np.random.default_rng(0)
    q = robot.robot.random(0)
    pose = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    moved = robot.with_body(q, pose)
    assert np.allclose(robot.body_pose(moved).homogeneous, pose.homogeneous, atol=1e-12)
    assert np.array_equal(moved[7:], q[7:])
    for limb, one in enumerate(robot.limbs):
        angles = rng.uniform(-1.0, 1.0, len(robot.joints(limb)))
        bent = robot.with_limb(q, limb, angles)
        assert np.allclose(robot.angles(bent, limb), angles)
        assert np.array_equal(bent[robot.robot.position_index[robot.joints(limb)]], angles)
        wanted = robot.robot.pose(bent, one.frame) * one.placement
        assert np.allclose(robot.contact_pose(bent, limb).homogeneous, wanted.homogeneous, atol=1e-12)
        assert robot.row(one.name) == limb
    assert robot.mass == pytest.approx(pin.computeTotalMass(robot.robot.model))
    assert np.allclose(
        pickle.loads(pickle.dumps(robot)).contact_pose(q, 1).translation, robot.contact_pose(q, 1).translation
    )


def test_joints_that_limbs_share_belong_to_none() -> None:
    robot = climber("talos_hands")
    names = [[str(robot.robot.model.names[j]) for j in chain] for chain in robot.chains]
    assert not any("torso" in name for chain in names for name in chain)
    assert [len(chain) for chain in names] == [6, 6, 7, 7]


def test_what_is_no_climber_is_refused_by_name() -> None:
    legs = climber("anymal_c")
    robot, feet = legs.robot, [limb.frame for limb in legs.limbs]
    with pytest.raises(ShapeError, match="floating base"):
        Climber(load("panda"), [ClimbLimb("panda_hand_tcp"), ClimbLimb("panda_hand")])
    with pytest.raises(ShapeError, match="two limbs or more"):
        Climber(robot, [ClimbLimb(feet[0])])
    with pytest.raises(UnknownNameError, match=r"x\.frame"):
        Climber(robot, [ClimbLimb("x"), ClimbLimb(feet[0])])
    with pytest.raises(DuplicateNameError, match=feet[0]):
        Climber(robot, [ClimbLimb(feet[0]), ClimbLimb(feet[0])])
    with pytest.raises(ShapeError, match="no chain"):
        Climber(robot, [ClimbLimb(feet[0]), ClimbLimb(feet[0], name="again")])
    with pytest.raises(ShapeError, match="no chain"):
        Climber(robot, [ClimbLimb(feet[0]), ClimbLimb("base")])
    with pytest.raises(ShapeError, match="way to hold"):
        ClimbLimb(feet[0], "foot")  # type: ignore[arg-type]
    beyond = legs.with_limb(legs.rest, 0, np.array([3.0, 0.0, 0.0]))
    with pytest.raises(RangeError, match="LF_HAA"):
        Climber(robot, [ClimbLimb(foot, PointFoot()) for foot in feet], beyond)
