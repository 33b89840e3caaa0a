"""What declared coordinates are as expressions: the matrix of their rates, and how far they are from a reference.

Rates are linear in v: c' = A(q) v. Where c' is the derivative of something, drift from a reference can be corrected;
e is that drift, in the rows' own axes and units, and None where only a rate exists (pitch plane, a part of a rotation,
a part of a position along axes that turn).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows
from wbc.coordinates.rows import KINDS, AxisRows, Coordinate, PlaneAngleRows, PointRows
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import WORLD, Kinematics, joint_of
from wbc.symbolic.tracer import Tracer
from wbc.tasks._stereographic import unit
from wbc.tasks.base import Input, Row, require_motion
from wbc.tasks.frames import frame_pose
from wbc.validation import Array

REFERENCE = "reference"
DRIFT = "drift"


def check(robot: Robot, field: str, rows: Coordinate) -> None:
    """Frames and joints of a declaration exist, and something moves.

    Raises:
        UnknownNameError, RangeError: see the classes.
    """
    checked_robot(robot)
    validation.instance(field, rows, KINDS, f"one of {', '.join(kind.__name__ for kind in KINDS)}")
    if isinstance(rows, JointRows):
        robot.dofs(rows.joint, f"{field}.joint")
    elif isinstance(rows, PlaneAngleRows):
        rows.task.validate(robot)
    elif isinstance(rows, PitchPlaneRows):
        for name in ("shoulder", "wrist"):
            robot.check_frame(f"{field}.{name}", getattr(rows, name))
        require_motion(robot, f"{field}.wrist", rows.wrist, rows.shoulder)
    else:
        for name in ("frame", "base", "expressed", "attached"):
            if getattr(rows, name, None) is not None:
                robot.check_frame(f"{field}.{name}", getattr(rows, name))
        require_motion(robot, f"{field}.frame", rows.frame, rows.base)


def labels(robot: Robot, rows: Coordinate) -> tuple[Row, ...]:
    """Name and unit of each row."""
    if isinstance(rows, BodyRows):
        moved = [Row("xyz"[k], "m") for k in rows.translation]
        return (*moved, *(Row(f"r{'xyz'[k]}", "rad") for k in rows.rotation))
    if isinstance(rows, JointRows):
        dofs = robot.dofs(rows.joint)
        return tuple(Row(robot.dof_names[k], robot.dof_units[k]) for k in range(dofs.start, dofs.stop))
    if isinstance(rows, PointRows):
        return tuple(Row(f"f{k}", "m") for k in range(rows.on.count))
    return (Row({PitchPlaneRows: "alpha", AxisRows: "axis", PlaneAngleRows: "psi"}[type(rows)], "rad"),)


def matrix(robot: Robot, kin: Tracer, rows: Coordinate) -> ca.SX:
    """A(q), rows x nv: what the coordinates' rates are by v."""
    kinematics = kin.kinematics
    if isinstance(rows, JointRows):
        dofs = robot.dofs(rows.joint)
        return ca.SX(ca.DM.eye(robot.nv))[dofs.start : dofs.stop, :]
    if isinstance(rows, PlaneAngleRows):
        return kin.jacobian(rows.task.error(robot, kin, {"target": ca.SX(0)}))
    if isinstance(rows, PointRows):
        return kin.jacobian(rows.on.values(kin.pose(rows.base).inverse_point(kin.position(rows.frame))))
    if isinstance(rows, PitchPlaneRows):
        joint, _ = kinematics.frame(rows.shoulder)
        axis = ca.densify(kinematics.joint_twist(joint)[1])
        span = kin.position(rows.wrist) - kin.position(rows.shoulder)
        return unit(span - axis * ca.dot(axis, span)).T @ kinematics.jacobian(rows.shoulder)[3:, :]
    if isinstance(rows, AxisRows):
        axis = kin.rotation(rows.attached) @ ca.SX(ca.DM(list(rows.axis)))
        return axis.T @ (kinematics.jacobian(rows.frame)[3:, :] - kinematics.jacobian(rows.base)[3:, :])
    above = kinematics.jacobian(rows.frame)
    if rows.base != WORLD:
        below = kinematics.jacobian(rows.base)
        arm = kin.position(rows.frame) - kin.position(rows.base)
        above = above - ca.vertcat(below[:3, :] - ca.skew(arm) @ below[3:, :], below[3:, :])
    turn = kin.rotation(rows.expressed or WORLD).T
    return ca.vertcat((turn @ above[:3, :])[list(rows.translation), :], (turn @ above[3:, :])[list(rows.rotation), :])


def reference(robot: Robot, rows: Coordinate) -> Input | None:
    """The input that drift is measured from; None where only a rate exists, or where the set itself is fixed."""
    if isinstance(rows, BodyRows):
        return Input(REFERENCE, "pose", unit="m, rad") if any(_corrected(robot, rows)) else None
    if isinstance(rows, JointRows):
        dofs = robot.dofs(rows.joint)
        single = dofs.stop - dofs.start == 1
        return Input(REFERENCE, unit=robot.dof_units[dofs.start]) if single else None
    return Input(REFERENCE, unit="rad") if isinstance(rows, PlaneAngleRows) else None


def rate_only(robot: Robot, rows: Coordinate) -> NDArray[np.bool_]:
    """Which rows have no drift of their own: their integral depends on the path."""
    if isinstance(rows, BodyRows):
        moved, turned = _corrected(robot, rows)
        return np.array([not moved] * len(rows.translation) + [not turned] * len(rows.rotation))
    known = isinstance(rows, PointRows) or reference(robot, rows) is not None
    return np.full(len(labels(robot, rows)), not known)


def drift(robot: Robot, kin: Tracer, rows: Coordinate, value: Any) -> ca.SX | None:
    """e(q, reference), one entry a row; None where there is nothing to correct."""
    if isinstance(rows, PointRows):
        return rows.on.values(kin.pose(rows.base).inverse_point(kin.position(rows.frame)))
    if reference(robot, rows) is None:
        return None
    if isinstance(rows, JointRows):
        off = kin.joint(rows.joint) - value
        unbounded = robot.position_index[robot.dofs(rows.joint).start] < 0
        return ca.SX(ca.atan2(ca.sin(off), ca.cos(off)) if unbounded else off)
    if isinstance(rows, PlaneAngleRows):
        return ca.SX(rows.task.error(robot, kin, {"target": value}))
    assert isinstance(rows, BodyRows)
    base, frame = kin.pose(rows.base), kin.pose(rows.frame)
    turn = kin.rotation(rows.expressed or WORLD).T
    moved, turned = _corrected(robot, rows)
    position = turn @ (base.rotation @ (base.inverse_point(frame.position) - value.position))
    angle = turn @ (base.rotation @ rot.log3(base.rotation.T @ frame.rotation @ value.rotation.T))
    parts = [position[list(rows.translation)] if moved else ca.SX.zeros(len(rows.translation))]
    parts.append(angle[list(rows.rotation)] if turned else ca.SX.zeros(len(rows.rotation)))
    return ca.vertcat(*parts)


def here(robot: Robot, rows: Coordinate, q: Array) -> Any:
    """The reference that a configuration gives."""
    if isinstance(rows, BodyRows):
        return frame_pose(robot, rows.base, q).actInv(frame_pose(robot, rows.frame, q))
    if isinstance(rows, PlaneAngleRows):
        return rows.task.angle(robot, q)
    assert isinstance(rows, JointRows)
    start = int(robot.model.idx_qs[robot.model.getJointId(rows.joint)])
    bounded = robot.position_index[robot.dofs(rows.joint).start] >= 0
    return float(q[start] if bounded else np.arctan2(q[start + 1], q[start]))


def _corrected(robot: Robot, rows: BodyRows) -> tuple[bool, bool]:
    """Whether the position rows, and the rotation rows, are derivatives of something."""
    rigid = joint_of(robot.model, rows.expressed or WORLD) == joint_of(robot.model, rows.base)
    count = len(rows.translation)
    return count == 3 or (count > 0 and rigid), len(rows.rotation) == 3


def rate_function(robot: Robot, rows: tuple[Coordinate, ...]) -> ca.Function:
    """q -> the dense matrix of all rows, in their order."""
    kin = Tracer(Kinematics(robot.model))
    parts = [ca.densify(matrix(robot, kin, r)) for r in rows]
    return ca.Function("rates", [kin.q], [ca.cse(kin.expand(ca.vertcat(*parts)))], ["q"], ["A"])
