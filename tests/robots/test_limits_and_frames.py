"""Overriding limits, neutral values and names; adding frames; the robot's own checks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.models import placement
from tests.refusals import assert_refused
from wbc import errors
from wbc.robot import Limits, Robot


@pytest.fixture(scope="module")
def panda() -> Robot:
    return wbc.robots.load("panda", shapes="none")


@pytest.fixture(scope="module")
def talos() -> Robot:
    return wbc.robots.load("talos", shapes="none")


@pytest.mark.parametrize("field", ["position_lower", "position_upper", "velocity", "acceleration", "effort"])
def test_every_limit_can_be_replaced(field: str, panda: Robot) -> None:
    value = -2.9 if field == "position_lower" else 3.9
    everywhere = wbc.robots.load("panda", shapes="none", **{field: value})
    np.testing.assert_array_equal(getattr(everywhere.limits, field), np.full(7, value))
    one = wbc.robots.load("panda", shapes="none", **{field: {"panda_joint2": value}})
    wanted = np.array(getattr(panda.limits, field))
    wanted[1] = value
    np.testing.assert_array_equal(getattr(one.limits, field), wanted)
    array = getattr(panda.limits, field) * 1.01
    all_given = wbc.robots.load("panda", shapes="none", **{field: array.astype(np.float64)})
    np.testing.assert_array_equal(getattr(all_given.limits, field), array)
    assert "given by the caller" in one.notes[field.split("_")[0]]
    assert one.fingerprint != panda.fingerprint


def test_one_number_leaves_the_base_unlimited(talos: Robot) -> None:
    robot = talos.with_limits(velocity=2, acceleration=3.0)
    assert np.isinf(robot.limits.velocity[:6]).all()
    assert (robot.limits.velocity[6:] == 2).all()
    based = talos.with_limits(velocity={"root_joint": [1, 1, 1, 2, 2, 2], "torso_1_joint": 0.5})
    np.testing.assert_array_equal(based.limits.velocity[:6], [1, 1, 1, 2, 2, 2])
    single = talos.with_limits(velocity={"root_joint.z": 0.25})
    assert single.limits.velocity[2] == 0.25
    assert np.isinf(single.limits.velocity[:2]).all()


def test_position_limits_skip_unbounded_joints() -> None:
    robot = wbc.robots.load("kinova", shapes="none", position_lower=0.9, position_upper=4.0)
    np.testing.assert_array_equal(robot.limits.position_lower, [-np.inf, 0.9, 0.9, -np.inf, 0.9, -np.inf])


def test_bad_limits(panda: Robot, talos: Robot) -> None:
    before = panda.fingerprint
    with pytest.raises(errors.UnknownNameError, match="did you mean 'panda_joint1'"):
        panda.with_limits(velocity={"panda_join1": 1})
    assert_refused(lambda: panda.with_limits(velocities=1), errors.UnknownNameError, "did you mean 'velocity'")
    assert_refused(lambda: panda.with_limits(velocity=[1, 2, 3]), errors.ShapeError, "")
    assert_refused(lambda: panda.with_limits(velocity={"panda_joint1": [1, 2]}), errors.ShapeError, "")
    assert_refused(lambda: panda.with_limits(effort=float("nan")), errors.NotFiniteError, "")
    assert_refused(lambda: panda.with_limits(acceleration=-1), errors.RangeError, "")
    assert_refused(lambda: panda.with_limits(position_lower={"panda_joint1": 5}), errors.BoundsError, "")
    with pytest.raises(errors.RangeError, match="no single coordinate"):
        talos.with_limits(position_lower={"root_joint.x": -1})
    assert_refused(lambda: replace(panda, locked_dofs=(7,)), errors.RangeError, "locked_dofs")
    assert panda.fingerprint == before


def test_limits_of_the_wrong_size(panda: Robot) -> None:
    five = np.full(5, np.inf)
    with pytest.raises(errors.ShapeError, match="expected 7 entries"):
        Robot("x", panda.model, Limits(-five, five, five, five, five))


def test_neutral_and_name() -> None:
    robot = wbc.robots.load("panda", shapes="none", name="left", neutral={"panda_joint1": 0.5, "panda_joint2": 99})
    assert robot.name == "left"
    assert robot.neutral[0] == 0.5
    assert robot.neutral[1] == robot.limits.position_upper[1]
    assert "panda_joint2" in robot.notes["neutral"]
    assert_refused(lambda: wbc.robots.load("panda", neutral={"panda_jiont1": 0.5}), errors.UnknownNameError, "")
    assert_refused(lambda: wbc.robots.load("panda", neutral={"panda_joint1": float("nan")}), errors.NotFiniteError, "")


def test_added_frame_is_fixed_to_its_parent(panda: Robot) -> None:
    place = pin.SE3(pin.utils.rotate("y", 0.4), np.array([0.1, -0.2, 0.3]))
    robot = panda.with_frame("camera", "panda_hand", place).with_frame("lens", "camera", [0, 0, 0.1, 0, 0, 0, 1])
    hand, lens = (placement(robot, n, robot.neutral) for n in ("panda_hand", "lens"))
    wanted = hand * place * pin.SE3(np.eye(3), np.array([0, 0, 0.1]))
    np.testing.assert_allclose(lens.homogeneous, wanted.homogeneous, atol=1e-12)
    assert "camera" not in panda.frame_names
    assert robot.fingerprint != panda.fingerprint
    floor = panda.with_frame("table", "world", np.eye(4))
    assert "table" in floor.frame_names


def test_bad_frames(panda: Robot) -> None:
    assert_refused(lambda: panda.with_frame("panda_hand", "panda_link7"), errors.DuplicateNameError, "")
    assert_refused(lambda: panda.with_frame("x", "pandalink7"), errors.UnknownNameError, "did you mean 'panda_link7'")
    assert_refused(lambda: panda.with_frame("x", "panda_link7", [0, 0, 0, 0, 0, 0, 2]), errors.RotationError, "")
