"""QPs recorded from closed loops on real robots, built with Pinocchio and numpy alone."""

from __future__ import annotations

import pathlib
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from tests.judges.quadprog_qp import referee
from wbc.qp import QP

DT = 0.005
ROBOTS = pathlib.Path(pin.__file__).parents[4] / "share/example-robot-data/robots"


def braking_bounds(q, lower, upper, speed, v_last, acceleration=10.0):
    """Velocity bounds that honour position, speed and acceleration limits in discrete time."""

    def fastest(distance):
        d = np.maximum(distance, 0.0)
        n = np.maximum(1.0, np.ceil((np.sqrt(1.0 + 8.0 * d / (acceleration * DT**2)) - 1.0) / 2.0))
        return d / (n * DT) + (n - 1.0) * acceleration * DT / 2.0

    low = np.maximum(-speed, -fastest(q - lower))
    high = np.minimum(speed, fastest(upper - q))
    reach = acceleration * DT
    low, high = np.maximum(low, v_last - reach), np.minimum(high, v_last + reach)
    return np.minimum(low, high), np.maximum(low, high)


def panda(weight: float, ticks: int) -> list[QP]:
    """A hand on a path that leaves the workspace: frame task, posture, damping, braking limits."""
    model = pin.buildModelFromUrdf(str(ROBOTS / "panda_description/urdf/panda.urdf"))
    model = pin.buildReducedModel(model, [8, 9], pin.neutral(model))
    data = model.createData()
    hand = model.getFrameId("panda_hand_tcp")
    home = np.array([0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.8])
    q, v = home.copy(), np.zeros(7)
    pin.framesForwardKinematics(model, data, q)
    start = data.oMf[hand].copy()
    out = []
    for tick in range(ticks):
        phase = 2.0 * np.pi * tick / ticks
        target = pin.SE3(pin.exp3(np.array([0.0, 0.0, 1.5 * np.sin(phase)])) @ start.rotation, start.translation)
        target.translation = start.translation + np.array([0.5 * np.sin(phase), 0.4 * np.cos(phase) - 0.4, 0.3])
        J = pin.computeFrameJacobian(model, data, q, hand, pin.LOCAL)
        wish = 10.0 * pin.log6(data.oMf[hand].actInv(target)).vector
        H = J.T @ J + (weight + 1e-8) * np.eye(7)
        g = -J.T @ wish - weight * 2.0 * (home - q)
        low, high = braking_bounds(q, model.lowerPositionLimit, model.upperPositionLimit, model.upperVelocityLimit, v)
        # the hand stays above a table
        A = pin.computeFrameJacobian(model, data, q, hand, pin.LOCAL_WORLD_ALIGNED)[2:3]
        floor = -20.0 * (data.oMf[hand].translation[2] - 0.3)
        qp = QP((H + H.T) / 2, g, np.append(low, floor), np.append(high, np.inf), A)
        out.append(qp)
        v = np.clip(referee(qp), low, high)
        for _ in range(10):  # ten ticks a sample, so that a short record sees the whole path
            q = np.clip(q + v * DT, model.lowerPositionLimit, model.upperPositionLimit)
        pin.framesForwardKinematics(model, data, q)
    return out


def talos(weight: float, ticks: int) -> list[QP]:
    """Both feet held (12 equalities), both hands and the centre of mass commanded, posture, braking limits."""
    model = pin.buildModelFromUrdf(str(ROBOTS / "talos_data/robots/talos_reduced.urdf"), pin.JointModelFreeFlyer())
    data = model.createData()
    n = model.nv
    feet = [model.getFrameId(name) for name in ("left_sole_link", "right_sole_link")]
    hands = [model.getFrameId(name) for name in ("gripper_left_base_link", "gripper_right_base_link")]
    rng = np.random.default_rng(5)
    home = pin.integrate(model, pin.neutral(model), np.concatenate((np.zeros(6), rng.uniform(-0.1, 0.1, n - 6))))
    home[7:] = np.clip(home[7:], model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
    q, v = home.copy(), np.zeros(n)
    pin.forwardKinematics(model, data, q)
    pin.updateFramePlacements(model, data)
    goals = [data.oMf[i].translation + np.array([0.4, s * 0.3, 0.3]) for i, s in zip(hands, (1, -1), strict=True)]
    com0 = pin.centerOfMass(model, data, q).copy()
    out = []
    for _ in range(ticks):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        H = (weight + 1e-8) * np.eye(n)
        g = -weight * 2.0 * pin.difference(model, q, home)
        for frame, goal in zip(hands, goals, strict=True):
            J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
            H += J.T @ J
            g -= J.T @ (5.0 * (goal - data.oMf[frame].translation))
        J = pin.jacobianCenterOfMass(model, data, q)
        H += J.T @ J
        g -= J.T @ (5.0 * (com0 + np.array([0.05, 0.05, -0.1]) - data.com[0]))
        A = np.vstack([pin.getFrameJacobian(model, data, frame, pin.LOCAL) for frame in feet])
        low, high = np.full(n, -1.0), np.full(n, 1.0)
        low[6:], high[6:] = braking_bounds(
            q[7:], model.lowerPositionLimit[7:], model.upperPositionLimit[7:], model.upperVelocityLimit[6:], v[6:]
        )
        qp = QP((H + H.T) / 2, g, np.concatenate((low, np.zeros(12))), np.concatenate((high, np.zeros(12))), A)
        out.append(qp)
        v = np.clip(referee(qp), low, high)
        q = pin.integrate(model, q, v * 10 * DT)
        q[7:] = np.clip(q[7:], model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
    return out


RECORDS: dict[str, Callable[[float, int], list[QP]]] = {"panda": panda, "talos": talos}
