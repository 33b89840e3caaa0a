"""Sums of wrenches, wheels that carry, measured forces, and the divergent component of motion."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.models import frame_jacobian
from tests.torque.problems import DT, robot, stack
from wbc.api import Stack
from wbc.errors import CommandError
from wbc.tasks import (
    DivergentComponent,
    EndEffector,
    JointLimits,
    Posture,
    RollingContact,
    SlidingContact,
    TorqueLimits,
    WrenchSum,
)
from wbc.tasks.frames import frame_pose


def test_grips_add_up_to_what_is_asked_for_and_to_the_rate_of_momentum() -> None:
    """In zero gravity the sum about the centre of mass is the rate of the centroidal momentum."""
    bot, rng = robot("walker"), np.random.default_rng(0)
    made = stack("walker").add(WrenchSum(("grip 1", "grip 2")), name="sum")
    tick = made.compile(command="torque", backend="vm")
    q, v = bot.neutral.copy(), 0.02 * rng.normal(size=bot.nv)
    data = bot.model.createData()
    tick.reset(q)
    center = pin.centerOfMass(bot.model, data, q).copy()
    wrench = np.array([30.0, -20.0, 10.0, 4.0, 5.0, -6.0])
    tick["sum"].set(target=wrench, point=center)
    step = tick.step(q, v)
    assert step.status == "solved"
    total = np.zeros(6)
    for arm in (1, 2):
        pose, w = frame_pose(bot, f"arm{arm}_hand", q), step.forces[f"grip {arm}"]
        force, moment = pose.rotation @ w[:3], pose.rotation @ w[3:]
        total += np.r_[force, moment + np.cross(pose.translation - center, force)]
    assert total == pytest.approx(wrench, abs=1e-8)
    pin.computeCentroidalMomentumTimeVariation(bot.model, data, q, v, step.a)
    assert data.dhg.vector == pytest.approx(wrench, abs=1e-7)
    tick["grip 1"].enabled = False
    tick["sum"].target = np.array([500.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    step = tick.step(q, v)
    assert step.status == "relaxed"
    assert {"sum", "grip 2 wrench"} & {s.item for s in step.relaxed}
    assert {s.unit for s in step.relaxed if s.item == "sum"} <= {"N", "N m"}


def test_wheels_carry_a_robot_and_roll() -> None:
    """The forces at the rims are what Pinocchio's dynamics of the base need, within friction."""
    bot = wbc.robots.load("tiago", base="floating", lock=())
    made = Stack(bot, dt=DT).add(Posture(), weight=1e-2)
    for side in ("left", "right"):
        made.add(RollingContact(f"wheel_{side}_link", radius=0.0985, axis=(0, 0, 1), friction=0.8), name=side)
    tick = made.compile(command="torque", backend="vm")
    q = bot.neutral.copy()
    tick.reset(q)
    step = tick.step(q, np.zeros(bot.nv))
    assert step.status == "solved"
    data = bot.model.createData()
    total, weight = np.zeros(bot.nv), 9.81 * pin.computeTotalMass(bot.model)
    for side in ("left", "right"):
        frame = f"wheel_{side}_link"
        pose, force = frame_pose(bot, frame, q), step.forces[side]
        up, axis = np.array([0.0, 0.0, 1.0]), pose.rotation[:, 2]
        spoke = np.cross(axis, np.cross(up, axis))
        arm, along = -0.0985 * spoke / np.linalg.norm(spoke), np.cross(axis, spoke / np.linalg.norm(spoke))
        world = np.column_stack([along, np.cross(up, along), up]) @ force
        total += frame_jacobian(bot, frame, q).T @ np.r_[world, np.cross(arm, world)]
        assert force[2] > 0.05 * weight
        assert np.abs(force[:2]).max() <= 0.8 / np.sqrt(2) * force[2] + 1e-9
    needed = pin.rnea(bot.model, data, q, np.zeros(bot.nv), step.a) - total
    assert needed[:6] == pytest.approx(np.zeros(6), abs=1e-6)
    assert needed[6:] == pytest.approx(step.torque[6:], abs=1e-6)


def test_feedback_of_a_measured_force_lessens_what_the_model_misses() -> None:
    """A table that feels 3 N more than the model says: 3 N / (1 + k) remain."""
    bot, off = robot("panda"), 3.0
    made = Stack(bot, dt=DT).add(EndEffector("panda_hand_tcp", weights=(1, 1, 0, 1, 1, 1)), name="hand")
    made.add(SlidingContact("panda_hand_tcp", friction=0.0), name="wiper").add(Posture(), weight=1e-2)
    tick = made.add(JointLimits()).add(TorqueLimits()).compile(command="torque", backend="vm")
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    tick["wiper"].target = pin.SE3(np.eye(3), frame_pose(bot, "panda_hand_tcp", q).translation)
    tick["wiper force"].set(target=[10.0], feedback=4.0)
    tick["wiper force"].weight = 1e3
    felt = 10.0 + off
    for _ in range(150):
        tick["wiper force"].measured = [felt]
        # a sensor with a lag: feedback without one has an algebraic loop
        felt += 0.1 * (float(tick.step(q, v).forces["wiper"][0]) + off - felt)
    assert felt == pytest.approx(10.0 + off / 5.0, abs=1e-3)


def test_the_divergent_component_follows_its_target() -> None:
    bot = robot("walker")
    made = Stack(bot, dt=DT).add(DivergentComponent(omega=3.5, weights=None), name="dcm")
    tick = made.compile(command="acceleration", backend="vm")
    q, v = bot.neutral.copy(), np.random.default_rng(1).uniform(-0.1, 0.1, bot.nv)
    tick.reset(q)
    data = bot.model.createData()
    target = pin.centerOfMass(bot.model, data, q, v) + np.array([0.02, -0.01, 0.03])
    tick["dcm"].set(target=target, feedforward=np.array([0.1, 0.0, -0.2]), gain=2.0)
    step = tick.step(q, v)
    pin.centerOfMass(bot.model, data, q, v, step.a)
    xi, rate = data.com[0] + data.vcom[0] / 3.5, data.vcom[0] + data.acom[0] / 3.5
    assert rate == pytest.approx(np.array([0.1, 0.0, -0.2]) - 2.0 * (xi - target), abs=1e-6)
    with pytest.raises(CommandError, match="CenterOfMass"):
        made.compile()
