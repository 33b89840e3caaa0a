"""Wheels that roll on the ground without slip: plain, omni and mecanum."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import DuplicateNameError, RangeError, ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic.kinematics import Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Input, Row, Rows, SacrificeOrder, Values

#: Floor under the length of the ground's normal as seen in the plane of a wheel, which is 1 for one that stands upright
#: and 0 for one that lies flat.
FLAT = 1e-6

#: Rollers whose axes are closer to the wheel's axis than this [rad] couple nothing.
_ALONG_AXIS = 1e-2


@dataclass(frozen=True)
class Wheel:
    """A thin wheel on a joint.

    Attributes:
        joint: the joint that it turns with: revolute, its axis through the wheel's centre, its origin in the centre.
        radius: from the centre to the ground [m].
        roller: None for a plain wheel. For one with rollers the angle from the rolling direction to the axis of the
            roller that touches the ground, about the ground's normal [rad]: 0 for an omni wheel, +-pi/4 for mecanum.
            The rolling direction is where the wheel goes when its joint turns forwards.

    Raises:
        ShapeError, NotFiniteError, RangeError: radius <= 0; rollers along the wheel's axis, |roller| >= pi/2.
    """

    joint: str
    radius: float
    roller: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.joint, str):
            raise ShapeError("Wheel.joint", self.joint, "expected the name of a joint")
        validation.own_scalars(self, "radius", low=0.0, open_low=True, unit="m")
        if self.roller is not None:
            end = math.pi / 2 - _ALONG_AXIS
            validation.own_scalars(self, "roller", low=-end, high=end)


@dataclass(frozen=True)
class Rolling(Constraint):
    """The point of each wheel that touches the ground does not slip: equalities on its velocity u = J_c v, with

        plain wheel         t'u = 0,  s'u = 0                    rolling direction and sideways        [m/s]
        wheel with rollers  (cos(roller) t + sin(roller) s)'u = 0         along the roller's axis      [m/s]
        on a floating base  n'u = -gain n'(c - o)                the wheel stays on the ground         [m/s]

    n is the normal of the ground and o its origin; a the wheel's axis, p its centre; d is the direction in the plane
    of the wheel closest to n, and

        c = p - radius d   the point of contact,     t = a x d   where it rolls to,     s = n x t   sideways.

    Limits of the wheels' joints limit the base through these rows. Leave wheels and base out of ``Posture``, which
    would drive the robot back to where its wheels were.

    Attributes:
        wheels: one ``Wheel(joint, radius, roller)`` or several: a revolute joint with its origin in the wheel's centre,
            the distance from there to the ground [m], and None for a plain wheel, else the angle from t to the axis of
            the roller that touches the ground, about n [rad]: 0 for omni wheels, +-pi/4 for mecanum (minus front left
            and rear right where wheels turn forwards to go forwards).
        contact: rows that keep wheels on the ground; None: on a floating base only, as others cannot leave it.
        gain: of the rows of contact [1/s].

    Inputs:
        ground: pose of the ground, its z axis the normal. Default: the z axis of the world, the origin at the
            height of the first wheel's contact at the first step. Only the axis counts without rows of contact.
        gain: of the rows of contact, if there are any [1/s].

    What it cannot do: resolve rows that contradict each other: four plain wheels that are not steered only go straight.
    A robot that skids in turns is loaded with ``base="differential"`` and has rollers with ``roller=0``. Slip that has
    happened is not undone. It knows no friction, load or steep slope, and wheels are thin. For a wheel that lies flat
    the rows fade to zero.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("tiago_no_hand", lock=(), shapes="none")
        >>> stack = wbc.Stack(robot, dt=0.01)
        >>> stack.add(wbc.tasks.Rolling([wbc.tasks.Wheel(f"wheel_{side}_joint", 0.0985) for side in ("left", "right")]))
        >>> stack.add(wbc.tasks.EndEffector("base_link"), name="base")
        >>> stack.add(wbc.tasks.JointLimits())

    Raises:
        ShapeError, NotFiniteError: no wheels, bad numbers. DuplicateNameError: a joint twice.
        UnknownNameError: no such joint. RangeError: a joint that is not revolute, that nothing carries along the
            ground, or whose axis is along the normal, so that it steers; gain < 0.
    """

    order: ClassVar[SacrificeOrder] = SacrificeOrder.HOLD
    equality: ClassVar[bool] = True
    initial_only: ClassVar[tuple[str, ...]] = ("gain",)

    wheels: tuple[Wheel, ...]
    contact: bool | None = None
    gain: float = 10.0

    def __post_init__(self) -> None:
        given = (self.wheels,) if isinstance(self.wheels, Wheel) else self.wheels
        wheels = validation.items("Rolling.wheels", given, "Wheel")
        if not wheels or not all(isinstance(wheel, Wheel) for wheel in wheels):
            raise ShapeError("Rolling.wheels", self.wheels, "expected one Wheel or several")
        joints = [wheel.joint for wheel in wheels]
        for joint in joints:
            if joints.count(joint) > 1:
                raise DuplicateNameError("Rolling.wheels", joint, "two wheels on one joint")
        object.__setattr__(self, "wheels", wheels)
        if self.contact is not None:
            object.__setattr__(self, "contact", validation.flag("Rolling.contact", self.contact))
        validation.own_scalars(self, "gain", low=0.0, unit="1/s")

    def validate(self, robot: Robot) -> None:
        model = robot.model
        for wheel in self.wheels:
            validation.one_of("Rolling.wheels", wheel.joint, robot.joint_names)
            joint = int(model.getJointId(wheel.joint))
            if not model.joints[joint].shortname().startswith("JointModelR"):
                raise RangeError("Rolling.wheels", wheel.joint, "a wheel turns about a revolute joint")
            if int(model.parents[joint]) == 0:
                raise RangeError("Rolling.wheels", wheel.joint, "nothing carries this wheel along the ground")
            axis = _axis(robot, joint, robot.neutral)
            if robot.base != "floating" and np.linalg.norm(axis[:2]) < FLAT:
                raise RangeError("Rolling.wheels", wheel.joint, "its axis is vertical: it steers, but does not roll")

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        gain = (Input("gain", unit="1/s", default=self.gain, low=0.0),) if self._touches(robot) else ()
        return (Input("ground", "pose", unit="m, rad"), *gain)

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        wheel = self.wheels[0]
        joint = int(robot.model.getJointId(wheel.joint))
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, q)
        up = np.array([0.0, 0.0, 1.0])
        axis = _axis(robot, joint, q)
        down = up - axis * axis[2]
        contact = data.oMi[joint].translation - wheel.radius * down / np.sqrt(down @ down + FLAT**2)
        return {"ground": pin.SE3(np.eye(3), contact[2] * up)}

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        out = []
        for wheel in self.wheels:
            names = ["rolling", "sideways"] if wheel.roller is None else ["roller"]
            names += ["contact"] * self._touches(robot)
            out += [Row(f"{wheel.joint} {name}", "m/s") for name in names]
        return tuple(out)

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        ground: Pose = inputs["ground"]
        normal = ground.rotation[:, 2]
        matrix, right = [], []
        for wheel in self.wheels:
            point, jacobian, forwards = _contact(kin, wheel, normal)
            sideways = ca.cross(normal, forwards)
            if wheel.roller is None:
                held = [forwards, sideways]
            else:
                held = [math.cos(wheel.roller) * forwards + math.sin(wheel.roller) * sideways]
            wanted = [ca.SX(0)] * len(held)
            if self._touches(robot):
                held.append(normal)
                wanted.append(-inputs["gain"] * ca.dot(normal, point - ground.position))
            matrix += [direction.T @ jacobian for direction in held]
            right += wanted
        return Rows(ca.sparsify(ca.vertcat(*matrix)), ca.vertcat(*right), ca.vertcat(*right))

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        if not self._touches(robot):
            return None
        ground: Pose = inputs["ground"]
        out = []
        for wheel in self.wheels:
            point = _contact(kin, wheel, ground.rotation[:, 2])[0]
            out += [ca.SX(1 if wheel.roller is not None else 2, 1)]
            out += [ca.dot(ground.rotation[:, 2], point - ground.position)]
        return ca.vertcat(*out)

    def _touches(self, robot: Robot) -> bool:
        return robot.base == "floating" if self.contact is None else self.contact


def _contact(kin: Tracer, wheel: Wheel, normal: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """(point of contact, its Jacobian 3 x nv as a point of the wheel, rolling direction)."""
    joint = int(kin.kinematics.model.getJointId(wheel.joint))
    axis = kin.joint_axis(joint)
    upright = normal - axis * ca.dot(axis, normal)
    upright = upright / ca.sqrt(ca.dot(upright, upright) + FLAT**2)
    point = kin.joint_position(joint) - wheel.radius * upright
    return point, kin.point_jacobian(joint, point)[:3, :], ca.cross(axis, upright)


def _axis(robot: Robot, joint: int, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Axis of a revolute joint in the world at a configuration."""
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, q)
    column = int(robot.model.idx_vs[joint])
    jacobian = pin.getJointJacobian(robot.model, data, joint, pin.LOCAL_WORLD_ALIGNED)
    return np.array(jacobian[3:, column])
