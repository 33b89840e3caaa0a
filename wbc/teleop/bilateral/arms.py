"""A robot that follows one device of a bilateral teleoperator, in its joints or with its hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc import tasks, validation
from wbc.api import Stack
from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.simulation import Connection, Plant
from wbc.validation import Array

#: Weight of the posture beside the hand, which settles what the hand leaves free
POSTURE = 1e-4
#: Gain of the orientation [1/s]
GAIN = 5.0


class FollowingArm:
    """Displacements of a device, times ``scale``, are those of a robot's joints, or of the position of one frame.

    The frame keeps its orientation where the robot has the joints for it. Joint limits and rates are kept, and where
    they stop the arm the device is told so.

    Args:
        frame: None: the device has one coordinate for each joint; else three, along the world's axes [m].
        q: where it begins; default: neutral. dt: of the teleoperator [s].
        plant: what moves; default: a :class:`wbc.simulation.KinematicPlant`.
        scale: motion of the robot over motion of the device. Forces on the device are those on the robot times it.

    Raises:
        UnknownNameError: no such frame. ShapeError: joints that are no vector, or a plant of another robot.
    """

    def __init__(
        self, robot: Robot, frame: str | None = None, *, dt: float, q: Any = None, scale: float = 1.0,
        plant: Plant | None = None, backend: str = "auto",
    ) -> None:  # fmt: skip
        self.robot, self.dt = checked_robot(robot), validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
        self.scale = validation.scalar("scale", scale, low=0.0, open_low=True)
        q0 = robot.configuration("q", robot.neutral if q is None else q)
        if robot.nq != robot.nv:
            raise ShapeError("robot", robot.name, "expected joints whose positions are a vector")
        self._frame = None if frame is None else robot.model.getFrameId(robot.check_frame("frame", frame))
        self.n, self.q = robot.nv if frame is None else 3, q0
        self._data = robot.model.createData()
        self._pose = robot.nv >= 6 and frame is not None
        stack = Stack(robot, dt=self.dt).add(tasks.JointLimits())
        if frame is None:
            stack.add(tasks.Posture(gain=GAIN), name="goal")
        else:
            stack.add(tasks.EndEffector(frame, "pose" if self._pose else "position", gain=GAIN), name="goal")
            stack.add(tasks.Posture(), name="posture", weight=POSTURE)
        self._controller = stack.compile(backend=backend)
        self._connection = Connection(plant, robot, self.dt)
        self.q = self._connection.reset(q0).q
        self._home, self._rotation = self._place()
        self._controller["posture" if frame else "goal"].target = self.q

    def move(self, x: Array) -> Array:
        """Go to displacements x [n] of the device in one period; where it is then [n].

        Raises:
            PlantError: the plant has no valid reading.
        """
        # From where it is at the rate that leads there: a servo that lags is behind, and is not driven into oscillation
        place, _ = self._place()
        rate = (self._home + self.scale * x - place) / self.dt
        target = pin.SE3(self._rotation, place) if self._pose else place
        self._controller["goal"].set(target=target, feedforward=np.append(rate, np.zeros(3)) if self._pose else rate)
        self.q = self._connection.drive(self._controller.step(self.q).v).q
        return np.asarray((self._place()[0] - self._home) / self.scale)

    def _place(self) -> tuple[Array, Array]:
        """What follows the device [n], and the rotation of the frame."""
        if self._frame is None:
            return self.q, np.eye(3)
        pin.framesForwardKinematics(self.robot.model, self._data, self.q)
        place = self._data.oMf[self._frame]
        return place.translation.copy(), place.rotation.copy()
