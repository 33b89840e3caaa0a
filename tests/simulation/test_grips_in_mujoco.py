"""Grips in MuJoCo, and MuJoCo beside Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.models import frame_jacobian
from tests.refusals import assert_refused
from tests.simulation.machines import HANDS, heavy, random_torque
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.simulation import Command, CommandKind, GripKind, GrippingMujocoPlant, Motors, MujocoPlant, PinocchioPlant

ROBOT = heavy().robot


@pytest.fixture(scope="module")
def plant() -> GrippingMujocoPlant:
    return GrippingMujocoPlant(ROBOT, HANDS)


@pytest.mark.parametrize("kind", [GripKind.POSE, GripKind.POSITION])
def test_grips_hold_and_bear_what_rigid_ones_do(plant: GrippingMujocoPlant, kind: GripKind) -> None:
    other, tau = PinocchioPlant(ROBOT), random_torque(ROBOT, 1.0, 5)
    for one in (plant, other):
        one.reset(ROBOT.neutral, 0.0)
        for hand in HANDS:
            one.grasp(hand, ROBOT.pose(ROBOT.neutral, hand), kind)
        one.apply(Command(CommandKind.TORQUE, tau))
        one.advance(0.2)
    gaps = [ROBOT.pose(plant.read().q, hand).translation - plant.grips[hand].pose.translation for hand in HANDS]
    assert np.abs(gaps).max() < 1e-5
    assert plant.given == pytest.approx(other.given, abs=0.02)
    for hand in HANDS:
        assert plant.wrenches[hand] == pytest.approx(other.wrenches[hand], abs=0.5)


def test_a_frame_that_closes_beside_its_hold_is_drawn_there_and_not_struck(plant: GrippingMujocoPlant) -> None:
    """exp(-rate t) of 0.1 mm, with 5 N; springs that took it up at once pushed with 270 N."""
    plant.reset(ROBOT.neutral, 0.0)
    there = ROBOT.pose(ROBOT.neutral, HANDS[0])
    off = np.array([1e-4, 0.0, 0.0])
    plant.grasp(HANDS[0], pin.SE3(there.rotation, there.translation + off), GripKind.AXIS)
    most = 0.0
    for k in range(1, 101):
        plant.advance(0.001)
        most = max(most, float(np.abs(plant.wrenches[HANDS[0]][:3]).max()))
        gap = plant.grips[HANDS[0]].pose.translation - ROBOT.pose(plant.read().q, HANDS[0]).translation
        assert gap == pytest.approx(np.exp(-0.02 * k) * off, abs=1e-5)
    assert most < 10.0


def test_wrenches_are_in_the_axes_of_a_frame_that_rolls_on_its_hold(plant: GrippingMujocoPlant) -> None:
    """M a + h = tau + J'w, by Pinocchio, long after the hand has rolled away from where it closed."""
    plant.reset(ROBOT.neutral, 0.0)
    hold = ROBOT.pose(ROBOT.neutral, HANDS[0])
    plant.grasp(HANDS[0], pin.SE3(hold.rotation @ pin.exp3(np.array([0.0, 0.0, 1.0])), hold.translation), GripKind.AXIS)
    tau = random_torque(ROBOT, 1.0, 5)
    plant.apply(Command(CommandKind.TORQUE, tau))
    plant.advance(0.1)
    model, before = ROBOT.model, plant.state
    q, v = before.q.copy(), before.v.copy()
    plant.advance(0.001)
    push = frame_jacobian(ROBOT, HANDS[0], q, pin.LOCAL).T @ plant.wrenches[HANDS[0]]
    a = pin.aba(model, model.createData(), q, v, tau + push)
    theirs = np.array(plant.data.qacc)
    theirs[:3] = pin.Quaternion(q[3:7]).matrix().T @ theirs[:3] - np.cross(v[3:6], v[:3])
    assert a == pytest.approx(theirs, abs=1e-6 * np.abs(theirs).max() + 1e-6)


def test_faults_and_delay() -> None:
    plant = GrippingMujocoPlant(ROBOT, HANDS, motors=Motors(delay=0.01))
    plant.reset(ROBOT.neutral, 0.0)
    for hand in HANDS[:2]:
        plant.grasp(hand, ROBOT.pose(ROBOT.neutral, hand), GripKind.AXIS)
    plant.apply(Command(CommandKind.TORQUE, random_torque(ROBOT, 3.0)))
    plant.advance(0.009)
    assert np.abs(plant.read().v).max() < 1e-9
    plant.advance(0.01)
    assert np.abs(plant.read().v).max() > 1e-3
    plant.slip(HANDS[0], (0.0, 0.01, 0.0), 0.01)
    before = plant.grips[HANDS[0]].pose.translation.copy()
    plant.advance(0.02)
    assert plant.grips[HANDS[0]].pose.translation - before == pytest.approx([0.0, 1e-4, 0.0])
    plant.lose(HANDS[1])
    assert plant.lost() == (HANDS[1],)
    assert list(plant.wrenches) == [HANDS[0]]
    plant.reset(ROBOT.neutral, 0.0)
    plant.limp("arm3_joint1")
    torque = np.zeros(ROBOT.nv)
    torque[ROBOT.dofs("arm3_joint1")] = 30.0
    plant.apply(Command(CommandKind.TORQUE, torque))
    plant.advance(0.05)
    assert not plant.read().v.any()


def test_rotors_of_motors_are_inertia() -> None:
    plant, other = (one(ROBOT, **more, motors=Motors(gear=10.0, rotor=0.01)) for one, more in
                    ((GrippingMujocoPlant, {"frames": HANDS}), (PinocchioPlant, {})))  # fmt: skip
    tau = random_torque(ROBOT, 3.0)
    for one in (plant, other):
        one.apply(Command(CommandKind.TORQUE, tau))
        one.advance(0.001)
    assert plant.read().v == pytest.approx(other.read().v, abs=1e-4 * np.abs(other.read().v).max())


def test_what_cannot_be_grasped_is_refused(plant: GrippingMujocoPlant) -> None:
    plant.reset(ROBOT.neutral, 0.0)
    far = pin.SE3(np.eye(3), np.ones(3))
    assert_refused(lambda: plant.grasp(HANDS[0], far), RangeError, "impossible contact")
    assert_refused(lambda: plant.grasp("body", far), UnknownNameError, "arm1_hand")
    assert_refused(lambda: plant.release(HANDS[0]), UnknownNameError, "frame")
    assert_refused(lambda: GrippingMujocoPlant(ROBOT, HANDS, time_constant=1e-3), RangeError, "time_constant")


def test_states_of_other_plants_are_refused() -> None:
    plant = GrippingMujocoPlant(ROBOT, HANDS)
    plant.grasp(HANDS[0], ROBOT.pose(ROBOT.neutral, HANDS[0]), GripKind.AXIS)
    assert_refused(lambda: plant.restore(MujocoPlant(plant._model, ROBOT).save()), ShapeError, "without grips")
    assert_refused(lambda: GrippingMujocoPlant(ROBOT, HANDS[1:]).restore(plant.save()), UnknownNameError, HANDS[0])
