"""Symbols that stand for parts of the robot in an item's expression, and how expressions of them bend."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from wbc.symbolic.curvature import Pull
from wbc.symbolic.kinematics import Kinematics, Pose
from wbc.symbolic.rotations import rotation_rate


@dataclass
class Placeholder:
    """A ``symbol`` and the ``value`` it stands for; its rate is ``motion @ jacobian @ v``.

    The rate is kept as two factors because ``(partial @ motion) @ jacobian`` is much smaller than
    ``partial @ (motion @ jacobian)``. Kinematics are built when they are needed, so that an item can be traced
    (to count its rows, to make its cache key) without them. ``inner``: value and motion are in other placeholders.
    ``turns``: it is the rotation of a frame, by which other forces turn. ``pulls``: what a force along the rate, given
    as a 3-vector in the axes of ``jacobian``, does to the robot.
    """

    name: str
    symbol: ca.SX
    value: Callable[[], ca.SX]
    motion: ca.SX
    jacobian: Callable[[], ca.SX]
    inner: bool = False
    turns: bool = False
    pulls: Callable[[ca.SX], tuple[Pull, ...]] = lambda force: ()


def of_frame(kinematics: Kinematics, frame: str, pose: Pose) -> list[Placeholder]:
    """The two that stand for a named frame: its position, moved by the linear rows of its Jacobian, and its rotation,
    moved by the angular rows. ``pose``: their symbols.
    """
    position = Placeholder(
        f"position {frame}",
        pose.position,
        lambda: kinematics.pose(frame).position,
        ca.SX.eye(3),
        lambda: kinematics.jacobian(frame)[:3, :],
        pulls=lambda force: (Pull("force", frame, force),),
    )
    rotation = Placeholder(
        f"rotation {frame}",
        ca.vec(pose.rotation),
        lambda: ca.vec(kinematics.pose(frame).rotation),
        rotation_rate(pose.rotation),
        lambda: kinematics.jacobian(frame)[3:, :],
        turns=True,
        pulls=lambda torque: (Pull("torque", frame, torque),),
    )
    return [position, rotation]


def turning(
    works: Sequence[tuple[Placeholder, ca.SX]],
    placeholders: Sequence[Placeholder],
    expand: Callable[[ca.SX], ca.SX],
    nv: int,
) -> ca.SX:
    """What forces and torques add to the curvature because they turn with frames, nv x nv:

        symmetric part of  sum over k, l of  J_k' (dw_k/ds_l) J_l        w_k: force along the rate of placeholder k

    Pairs without a rotation are left out: those are errors that bend by themselves.

    Args:
        works: placeholders that an expression pulls at, each with its force. expand: puts the kinematics in.
    """
    total = ca.SX(nv, nv)
    for cause in placeholders:
        felt = ca.SX(nv, 3)
        for force, work in works:
            if not (force.turns or cause.turns) or not cause.motion.nnz():
                continue
            change = ca.sparsify(ca.jacobian(work, cause.symbol) @ cause.motion)
            if change.nnz():
                felt += ca.sparsify(force.jacobian().T @ expand(change))
        if felt.nnz():
            part = felt @ cause.jacobian()
            total += 0.5 * (part + part.T)
    return ca.sparsify(total)


def axis_bend(spin: ca.SX, axis: ca.SX, torque: ca.SX, turn: ca.SX) -> ca.SX:
    """What a torque m across an axis a adds to the curvature where the axis alone counts, nv x nv.

        J' (- (a t' + t a') / 2  +  m.n (cot theta - 1/theta) (a x n)(a x n)') J,        t = a x m

    The first part undoes what a turn about the axis would bend: with it, its row of the curvature is zero. The second
    is that of the angle to a direction, which the turn theta n takes to a; of its bracket no less than -3 counts, and
    below 1e-4 rad it is left out. Then J'J and the curvature for m = theta n are the second derivative of theta^2 / 2.

    Args:
        spin: J, 3 x nv, angular velocity of the axis. axis, torque, turn: a, m, theta n in its axes.
    """
    theta = ca.norm_2(turn)
    inside = theta > 1e-4
    safe = ca.if_else(inside, theta, 1.0)
    share = ca.fmax(ca.cos(safe) / ca.sin(safe) - 1.0 / safe, -3.0) / safe**3
    along, aside, sideways = spin.T @ axis, spin.T @ ca.cross(axis, torque), spin.T @ ca.cross(axis, turn)
    bent = -0.5 * (along @ aside.T + aside @ along.T)
    return bent + ca.if_else(inside, ca.dot(torque, turn) * share, 0.0) * sideways @ sideways.T
