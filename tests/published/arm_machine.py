"""For the tests of published task and constraint coordinates: Jacobians and places of arms by Pinocchio alone, and the
rates that a pair gives.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.coordinates import PairController
from wbc.robot import Robot

#: q* of the numbers of seven joints
STATE = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])


class Machine:
    """Jacobians, rows [v; omega] in world axes, and places."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.model, self.data = robot, robot.model, robot.model.createData()

    def rows(self, frame: str, q: np.ndarray, upto: int | None = None) -> np.ndarray:
        index = self.model.getFrameId(frame)
        J = pin.computeFrameJacobian(self.model, self.data, q, index, pin.LOCAL_WORLD_ALIGNED)
        return J if upto is None else J[:upto]

    def place(self, frame: str, q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(self.model, self.data, q)
        return np.array(self.data.oMf[self.model.getFrameId(frame)].translation)

    def turn(self, frame: str, q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(self.model, self.data, q)
        return np.array(self.data.oMf[self.model.getFrameId(frame)].rotation)

    def alpha(self, q: np.ndarray, pitch: int, wrist: str = "F5") -> np.ndarray:
        """Rate of the pitch plane about the common normal of shoulder pitch and wrist pitch; ``pitch``: axis of F3."""
        axis = self.turn("F3", q)[:, pitch]
        r = self.place(wrist, q) - self.place("F3", q)
        r = r - axis * (axis @ r)
        return r / np.linalg.norm(r) @ self.rows("F2", q)[3:]

    def in_plane(self, frame: str, body: str, q: np.ndarray, pitch: int) -> np.ndarray:
        """beta (F3, F2) and gamma (F5, F6): angular velocity of a body about the pitch axis."""
        return self.turn(frame, q)[:, pitch] @ self.rows(body, q)[3:]


def rank(J: np.ndarray) -> int:
    sigma = np.linalg.svd(J, compute_uv=False)
    return int((sigma > 1e-9 * sigma[0]).sum())


def rates(control: PairController, name: str, q: np.ndarray, command: object) -> np.ndarray:
    """Joint rates of a pair at a configuration, from rest; what is held is exact."""
    control.switch(name, 0.0)
    control.reset(q)
    control.command(command)
    v = control.step(q).v
    for one in control.pair.constraint:
        assert np.abs(control.rates(q)[one] @ v).max() < 1e-10
    return v
