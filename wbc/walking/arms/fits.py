"""Whether a walker's numbers are those of its robot: planner and loop go by the numbers, the plant by the robot."""

from __future__ import annotations

import weakref

import numpy as np

from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robots import Walker, WalkerData
from wbc.walking.arms.puma import ArmKinematics

#: What may be between the two [m, rad, rad/s, rad/s^2]
SAME = 1e-6

_FIT: weakref.WeakKeyDictionary[object, list[object]] = weakref.WeakKeyDictionary()


def check_fits(walker: Walker) -> None:
    """Refuse a walker whose :attr:`Walker.data` are not those of its robot.

    Arms with kinematics of their own (``Walker.limb``) are not looked at.

    Raises:
        RangeError: what differs first: limits, or where a hand is. ShapeError: another machine.
    """
    if walker.limb is not None:
        return
    data = walker.arm_data
    known = _FIT.setdefault(walker.robot, [])
    if any(one is data for one in known):
        return
    _check_limits(walker, data)
    _check_hands(walker, data)
    known.append(data)


def _check_limits(walker: Walker, data: WalkerData) -> None:
    limits = walker.robot.limits
    for arm in walker.arms:
        for name, given, found in (
            ("joint_rates", data.joint_rates, limits.velocity[arm.v]),
            ("joint_accelerations", data.joint_accelerations, limits.acceleration[arm.v]),
        ):
            joint = int(np.abs(np.array(given) - found).argmax())
            if abs(given[joint] - found[joint]) > SAME * max(1.0, given[joint]):
                reason = f"{arm.joints[joint]} of the robot has {found[joint]:.6g}"
                raise RangeError(f"walker.data.{name}[{joint}]", given[joint], reason)


def _check_hands(walker: Walker, data: WalkerData) -> None:
    """Forward kinematics of both, at a posture in which every length counts."""
    model, kinematics = walker.robot.model, ArmKinematics(data)
    memory, q = model.createData(), np.array(walker.robot.neutral)
    posture = np.array([0.3, 0.9, -1.2, 0.4, 0.7, 0.2])
    for arm in walker.arms:
        q[arm.q] = posture
    pin.framesForwardKinematics(model, memory, q)
    body = memory.oMf[model.getFrameId("body")]
    for arm in walker.arms:
        wanted = pin.SE3(arm.base.homogeneous @ kinematics.forward(posture))
        off = pin.log6(wanted.actInv(body.actInv(memory.oMf[model.getFrameId(arm.hand)])))
        if np.abs(off.vector).max() > SAME:
            far = f"{1e3 * float(np.linalg.norm(off.linear)):.3g} mm and {float(np.linalg.norm(off.angular)):.3g} rad"
            raise RangeError("walker.data", data.digest, f"{arm.hand} of the robot is {far} from where these have it")
