"""Small arms built joint by joint, so that tests need no robot files, and where frames of any robot are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.robot import Limits, Robot

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
MINUS_Z = (0.0, 0.0, -1.0)

#: (axis in the joint's frame, translation to the next frame after the joint has turned)
Link = tuple[Sequence[float], Sequence[float]]

#: Offsets of the Space Station arm [m]: Nguyen and Hughes (1994), boom, z of shoulder and wrist, lateral y, tool x.
SSRMS_OFFSETS = {"boom": 7.11, "z6": -0.7026, "y3": -1.0442, "y5": -0.5692, "x7": 1.3589}


def add_chain(
    model: pin.Model, links: Sequence[Link], prefix: str = "", parent: int = 0, placement: pin.SE3 | None = None
) -> int:
    """Append revolute joints ``<prefix>joint1`` ..., frames ``<prefix>F1`` ... and ``<prefix>tip``; the last joint."""
    here = placement if placement is not None else pin.SE3.Identity()
    for k, (axis, offset) in enumerate(links, start=1):
        joint = pin.JointModelRevoluteUnaligned(np.array(axis, dtype=float))
        parent = model.addJoint(parent, joint, here, f"{prefix}joint{k}")
        model.addFrame(pin.Frame(f"{prefix}F{k}", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
        here = pin.SE3(np.eye(3), np.array(offset, dtype=float))
    model.addFrame(pin.Frame(f"{prefix}tip", parent, 0, here, pin.FrameType.OP_FRAME))
    return parent


def placement(robot: Robot, frame: str, q: np.ndarray) -> pin.SE3:
    """Pose of a frame in the world, by Pinocchio."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return pin.SE3.Identity() if frame == "world" else data.oMf[robot.model.getFrameId(frame)].copy()


def frame_jacobian(
    robot: Robot, frame: str, q: np.ndarray, axes: pin.ReferenceFrame = pin.LOCAL_WORLD_ALIGNED
) -> np.ndarray:
    """Jacobian of a frame at its origin, by Pinocchio [6, nv]."""
    data, number = robot.model.createData(), robot.model.getFrameId(frame)
    return np.array(pin.computeFrameJacobian(robot.model, data, q, number, axes))


def free_direction(robot: Robot, frame: str, q: np.ndarray) -> np.ndarray:
    """The unit velocity of an arm of seven joints that keeps a frame's pose."""
    return np.asarray(np.linalg.svd(frame_jacobian(robot, frame, q))[2][-1])


def robot(name: str, model: pin.Model) -> Robot:
    """A robot without limits."""
    none = np.full(model.nv, np.inf)
    return Robot(name, model, Limits(-none, none, none, none, none), neutral=pin.neutral(model))


def arm(name: str, links: Sequence[Link]) -> Robot:
    """A fixed-base robot of one chain."""
    model = pin.Model()
    add_chain(model, links)
    return robot(name, model)


def four_links(upper: float = 1.0, fore: float = 0.8) -> list[Link]:
    """Roll, yaw, pitch shoulder without offsets, elbow pitch."""
    return [(X, (0, 0, 0)), (MINUS_Z, (0, 0, 0)), (Y, (upper, 0, 0)), (Y, (fore, 0, 0))]


def ssrms_links(boom: float, z6: float, y3: float, y5: float, x7: float) -> list[Link]:
    """Space Station arm: roll, yaw, pitch, elbow pitch, pitch, yaw, roll with lateral offsets."""
    return [
        (X, (0, 0, 0)),
        (MINUS_Z, (0, 0, -z6)),
        (Y, (boom, y3, 0)),
        (Y, (boom, 0, 0)),
        (Y, (0, y5, 0)),
        (MINUS_Z, (0, 0, z6)),
        (X, (x7, 0, 0)),
    ]


def spdm_links(
    boom: float = 1.0, d2: float = 0.2, z12: float = 0.15, z15: float = -0.15, z16: float = -0.15, x17: float = 0.3
) -> list[Link]:
    """One arm of the dexterous manipulator: pitch about z, wrist offset ``d2`` along x."""
    return [
        (X, (0, 0, 0)),
        (Y, (0, 0, z12)),
        (Z, (boom, 0, 0)),
        (Z, (boom, 0, 0)),
        (Z, (d2, 0, z15)),
        (Y, (0, 0, z16)),
        (X, (x17, 0, 0)),
    ]


def four_joint_arm(upper: float = 1.0, fore: float = 0.8) -> Robot:
    """Spherical shoulder and elbow; shoulder F3, elbow F4, wrist tip."""
    return arm("four", four_links(upper, fore))


def ssrms() -> Robot:
    """Arm with lateral offsets; shoulder F3, elbow F4, wrist F5."""
    return arm("ssrms", ssrms_links(**SSRMS_OFFSETS))


def spdm_arm() -> Robot:
    """Compact arm with offsets; shoulder F3, elbow F4, wrist F5."""
    return arm("spdm", spdm_links())


def spherical_seven(upper: float = 0.42, fore: float = 0.4) -> Robot:
    """Spherical shoulder z y z, elbow y, spherical wrist z y z, no offsets; shoulder F1, elbow F4, wrist F5."""
    return arm(
        "spherical",
        [
            (Z, (0, 0, 0)),
            (Y, (0, 0, 0)),
            (Z, (0, 0, upper)),
            (Y, (0, 0, fore)),
            (Z, (0, 0, 0)),
            (Y, (0, 0, 0)),
            (Z, (0, 0, 0.126)),
        ],
    )
