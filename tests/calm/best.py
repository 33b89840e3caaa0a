"""The best that can be reached, by an optimisation with Pinocchio and scipy: no expression of the package."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

from tests.calm.scenes import POSTURE, TIPS, Array, tip_pose
from wbc.robot import Robot


def cost(
    robot: Robot, name: str, target: pin.SE3, q: Array, kind: str, data: pin.Data | None = None
) -> tuple[float, Array]:
    """Half the weighted squares of the hand's error and the posture's, with the gradient."""
    model = robot.model
    data = model.createData() if data is None else data
    frame = model.getFrameId(TIPS[name])
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
    here = data.oMf[frame]
    place = (here.translation - target.translation) / robot.characteristic_length**2
    rest = POSTURE * (q - robot.neutral)
    value = 0.5 * float(place @ (here.translation - target.translation) + rest @ (q - robot.neutral))
    slope = jacobian[:3].T @ place + rest
    if kind == "pose":
        turn = pin.log3(here.rotation @ target.rotation.T)
        value += 0.5 * float(turn @ turn)
        # d |log R|^2 / 2 = log R . w, because log R is along the axis of the turn
        slope = slope + jacobian[3:].T @ turn
    return value, slope


def best(robot: Robot, name: str, target: pin.SE3, kind: str, starts: list[Array]) -> tuple[float, float]:
    """(cost, distance of the hand to the target [m]) of the best optimum within the position limits."""
    low, high = robot.limits.position_lower, robot.limits.position_upper
    found = []
    data = robot.model.createData()
    for start in starts:
        answer = minimize(
            lambda q: cost(robot, name, target, q, kind, data),
            np.clip(start, low, high),
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(low, high, strict=True)),
            options={"maxiter": 2000, "ftol": 1e-15, "gtol": 1e-10},
        )
        found.append((float(answer.fun), answer.x))
    least, q = min(found, key=lambda pair: pair[0])
    return least, float(np.linalg.norm(tip_pose(robot, q, name).translation - target.translation))


def random_starts(robot: Robot, count: int, seed: int = 0) -> list[Array]:
    """Configurations anywhere within the position limits."""
    rng = np.random.default_rng(seed)
    low, high = np.maximum(robot.limits.position_lower, -3.1), np.minimum(robot.limits.position_upper, 3.1)
    return [rng.uniform(low, high) for _ in range(count)]
