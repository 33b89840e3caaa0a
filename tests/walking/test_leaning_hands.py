"""A hand that leans in a compliant hold becomes upright little by little: the body stays where it is commanded."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbc
from wbc.walking import cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.loop.stack import DT, RISING, UPRIGHT, WalkStack
from wbc.walking.planner.planner import plan_walk

#: Of the hands, less than the compliant holds allow [rad]; what they may still lean after twice RISING
LEAN, LEFT = 0.04, 0.004


def test_a_body_stands_still_while_its_hands_become_upright() -> None:
    machine, rigid, structure = wbc.robots.walker(), cylinder(rigid=True), cylinder()
    plan = plan_walk(machine, rigid, grid_path([(13, 6), (13, 8)], 0.1))
    assert plan.grips is not None
    q = np.array(machine.robot.neutral)
    pose = pin.SE3(plan.path.poses[0])
    q[:7] = pin.SE3ToXYZQUAT(pose)
    for arm, chain in zip(machine.arms, plan.chain, strict=True):
        q[arm.q] = plan.grips.posture_at(chain[0], 0)
    stack = WalkStack(machine, structure, backend="vm")
    stack.begin(q)
    model, robot = machine.robot.model, machine.robot
    data = model.createData()
    axes = list[np.ndarray]()
    for k, hold in enumerate(plan.start):
        stack.hold(k, structure.index(hold))
        # The hand is upright on the hold: what it is to turn to leans
        across = structure.frames[structure.index(hold)][:3, 0]
        axes.append(np.cos(LEAN) * structure.axes[structure.index(hold)] + np.sin(LEAN) * across)
        stack._axes[k].target = axes[-1]
        assert stack._axes[k].weight == UPRIGHT
    v, most = np.zeros(robot.nv), 0.0
    for _ in range(round(2.0 * RISING / DT)):
        stack.body(np.concatenate([pose.rotation.ravel(order="F"), pose.translation, np.zeros(6)]))
        before, v = v, stack.controller.step(q, v).v.copy()
        most = max(most, float(np.abs(v[:3] - before[:3]).max()))
        q = pin.integrate(model, q, v * DT)
    # 0.02 m/s is what the checker allows from tick to tick
    assert most < 0.002
    pin.framesForwardKinematics(model, data, q)
    for arm, axis in zip(machine.arms, axes, strict=True):
        hand = data.oMf[model.getFrameId(arm.hand)].rotation[:, 2]
        assert np.arccos(min(1.0, float(hand @ axis))) < LEFT


def test_what_a_hand_is_off_its_hold_is_taken_back_little_by_little() -> None:
    """All holds are a tenth of a millimetre from where the hands are: at once it would be 2 mm/s in the first tick."""
    machine, structure = wbc.robots.walker(), cylinder(rigid=True)
    plan = plan_walk(machine, structure, grid_path([(13, 6), (13, 8)], 0.1))
    assert plan.grips is not None
    pose, q = pin.SE3(plan.path.poses[0]), np.array(machine.robot.neutral)
    q[:7] = pin.SE3ToXYZQUAT(pose)
    for arm, chain in zip(machine.arms, plan.chain, strict=True):
        q[arm.q] = plan.grips.posture_at(chain[0], 0)
    off = np.array([1e-4, 0.0, 0.0])
    stack = WalkStack(machine, structure.moved(pin.SE3(np.eye(3), off)), collisions=False, backend="vm")
    stack.begin(q)
    for k, hold in enumerate(plan.start):
        stack.hold(k, structure.index(hold))
    model, v, places = machine.robot.model, np.zeros(machine.robot.nv), list[np.ndarray]()
    data = model.createData()
    for _ in range(round(2.0 * RISING / DT)):
        pin.framesForwardKinematics(model, data, q)
        places.append(np.array([data.oMf[model.getFrameId(arm.hand)].translation for arm in machine.arms]))
        stack.body(np.concatenate([pose.rotation.ravel(order="F"), pose.translation, np.zeros(6)]))
        v = stack.controller.step(q, v).v.copy()
        q = pin.integrate(model, q, v * DT)
    rates = np.diff(places, axis=0) / DT
    np.testing.assert_allclose(rates[0], np.tile(off * 20.0 * DT / RISING, (3, 1)), atol=1e-6)
    assert np.linalg.norm(rates, axis=2).max() < 1e-3
    np.testing.assert_allclose(
        places[-1], structure.positions[[structure.index(h) for h in plan.start]] + off, atol=1e-6
    )
