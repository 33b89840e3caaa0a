"""Moving two links together, or apart, within the joint range."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wbc.multibody import pin
from wbc.robot.pairs.distances import Links
from wbc.robot.sampling import configuration, joint_range
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot.robot import Robot

#: Steps of a descent at most
STEPS = 40
#: First step of a descent [rad], halved where it leads apart
FIRST_STEP = 0.3

#: ... until they are shorter than this [rad].
LAST_STEP = 1e-3


class Descent:
    """Follows the gradient of the signed distance of two links, projected onto the joint range,

        d distance / dq = n' (J_second - J_first),      n the normal, J at the witness points       [m/rad or 1]

    until they touch, that is, until the distance is at most ``clearance`` [m]; ``away``: against it, until the distance
    is more than that.
    """

    def __init__(self, robot: Robot, links: Links, clearance: float, *, away: bool = False) -> None:
        self._robot, self._links, self._sign = robot, links, -1.0 if away else 1.0
        self._clearance = self._sign * clearance
        self._data = robot.model.createData()
        self._lower, self._upper = joint_range(robot)
        self._scale = np.array([1.0 if unit == "rad" else robot.characteristic_length for unit in robot.dof_units])

    def run(self, first: str, second: str, start: Array) -> float:
        """The distance [m] that a descent reaches from ``start``, a step from the neutral configuration [nv].

        Cannot do: it ends in a local minimum, so a positive distance does not prove that the links cannot touch.
        """
        lower, upper, scale = self._lower, self._upper, self._scale
        here, size = start, FIRST_STEP
        distance, gradient = self._slope(first, second, here)
        for _ in range(STEPS):
            # at a limit, only the step back is open
            blocked = ((here <= lower) & (gradient > 0.0)) | ((here >= upper) & (gradient < 0.0))
            step = np.where(blocked, 0.0, gradient * scale**2)
            length = float(np.linalg.norm(step / scale))
            if not length > 0.0 or distance <= self._clearance or size < LAST_STEP:
                break
            there = np.clip(here - size / length * step, lower, upper)
            reached, slope = self._slope(first, second, there)
            if reached < distance:
                here, distance, gradient = there, reached, slope
            else:
                size /= 2
        return self._sign * distance

    def _slope(self, first: str, second: str, step: Array) -> tuple[float, Array]:
        """(signed distance [m], its gradient, followers of mimic joints counted with their leaders); both against the
        sign of the descent.
        """
        model, data, parts = self._robot.model, self._data, self._links.parts
        pin.computeJointJacobians(model, data, configuration(self._robot, step))
        joints = [parts[first][0].joint, parts[second][0].joint]
        distance, normal, *points = self._links.witness(first, second, {j: data.oMi[j] for j in joints})
        gradient = np.zeros(model.nv)
        for sign, joint, point in zip((-1.0, 1.0), joints, points, strict=True):
            if joint > 0:
                jacobian = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
                moment = pin.skew(point - data.oMi[joint].translation) @ normal
                gradient += sign * (normal @ jacobian[:3] + moment @ jacobian[3:])
        for coupling in self._robot.couplings:
            gradient[coupling.leader] += coupling.ratio * gradient[coupling.follower]
            gradient[coupling.follower] = 0.0
        gradient[: self._robot.base_nv] = 0.0
        return self._sign * distance, self._sign * gradient
