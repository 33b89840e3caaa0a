"""How well a chain of joints can move a frame in every direction: its measure and the measure's gradient.

With J the Jacobian of a frame as seen from another, rows in metres divided by a length, and s_1 ... s_m its singular
values,

    w = sqrt(det(J J' + floor^2 I)) = prod sqrt(s_i^2 + floor^2)

which is Yoshikawa's measure (1985) with a floor under each singular value, so that it has a derivative everywhere.
Its gradient needs the derivatives of J. For a serial chain of screws, columns (l_j, w_j) = (velocity of the frame's
origin, angular velocity) in order from the base to the frame, they are the closed form

    d(l_j, w_j)/dq_k = (w_k x l_j, w_k x w_j)    for k before j or equal to it: joint k turns all that comes after it
                     = (w_j x l_k, 0)            for k after j: joint k moves the frame's origin

so that the contraction with G = (J J' + floor^2 I)^-1 J, columns (g_j, h_j), needs two running sums:

    d log w / dq_k = w_k . sum_{j >= k} (l_j x g_j + w_j x h_j) + l_k . sum_{j < k} (g_j x w_j)

No second derivative is formed, and the cost is linear in the number of joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import Kinematics

#: Bound on -(second derivative of w) / w in any direction of unit length at the maxima of w, in radians and lengths:
#: between 0.3 and 2.4 on Panda, UR5, Kinova and a Talos arm, for positions, orientations and poses.
BEND = 2.5

#: What every singular value of the Jacobian is raised by, s -> sqrt(s^2 + FLOOR^2); pure number.
FLOOR = 1e-4


@dataclass(frozen=True)
class _Group:
    """A joint of the chain with its columns, 3 x n each; ``turned``: it lies on the base's side of the chain."""

    joint: int
    turned: bool
    linear: ca.SX
    angular: ca.SX


def manipulability(
    kinematics: Kinematics, frame: str, base: str, rows: Sequence[int], length: float
) -> tuple[ca.SX, ca.SX]:
    """(w, dw/dq as a row of nv) of a frame as seen from a base frame.

    Args:
        rows: which of (x, y, z, rx, ry, rz) count, in the axes of the base.
        length: what rows in metres are divided by [m].

    Raises:
        UnknownNameError: no such frame.
    """
    place = kinematics.pose(frame).position
    groups = [_group(kinematics, joint, turned, place) for joint, turned in path(kinematics, frame, base)]
    blocks = [(g.joint, ca.vertcat(g.linear, g.angular)) for g in groups]
    select = _selection(kinematics, base, rows, length)
    matrix = ca.densify(select @ kinematics.columns(6, blocks))
    square = matrix @ matrix.T + FLOOR**2 * ca.SX.eye(len(rows))
    pivots, solved = _solve(square, matrix)
    measure = ca.SX(1)
    for pivot in pivots:
        measure = measure * ca.sqrt(pivot)
    back = select.T @ solved
    columns = [back[:, kinematics.joint_columns(g.joint)] for g in groups]
    slopes = _slopes(kinematics, groups, columns, place)
    row = kinematics.columns(1, [(g.joint, s) for g, s in zip(groups, slopes, strict=True)])
    return measure, measure * row


def manipulability_curvature(kinematics: Kinematics, frame: str, base: str, length: float) -> ca.SX:
    """An estimate of the second derivative of log w where w has a maximum, nv x nv: -:data:`BEND` on the diagonal.

    It has the right sign and is large enough in every direction, so that a Newton step on a target that is beyond the
    maximum does not overshoot. The exact derivative takes ten times as many instructions as the gradient.
    """
    diagonal = ca.SX(kinematics.nv, 1)
    for joint, _ in path(kinematics, frame, base):
        angular = kinematics.joint_subspace(joint)[1]
        for k, column in enumerate(range(kinematics.nv)[kinematics.joint_columns(joint)]):
            diagonal[column] = -BEND * (1.0 if angular[:, k].nnz() else 1.0 / length**2)
    return ca.diag(diagonal)


def path(kinematics: Kinematics, frame: str, base: str) -> list[tuple[int, bool]]:
    """(joint, turned) from the base frame to the frame; the joints between the base and the common root are turned."""
    up, down = (kinematics.support(kinematics.frame(name)[0]) for name in (base, frame))
    common = 0
    while common < min(len(up), len(down)) and up[common] == down[common]:
        common += 1
    return [(j, True) for j in reversed(up[common:])] + [(j, False) for j in down[common:]]


def _group(kinematics: Kinematics, joint: int, turned: bool, place: ca.SX) -> _Group:
    """A turned joint moves the frame against the base as much as it moves the base, the other way."""
    linear, angular = kinematics.joint_twist(joint)
    linear = linear - rot.skew(place - kinematics.joint_pose(joint).position) @ angular
    return _Group(joint, turned, -linear, -angular) if turned else _Group(joint, turned, linear, angular)


def _selection(kinematics: Kinematics, base: str, rows: Sequence[int], length: float) -> ca.SX:
    """rows x 6 matrix in front of the Jacobian in world axes: into the base's axes, chosen rows, in pure numbers."""
    scaled = ca.diagcat(ca.SX.eye(3) / length, ca.SX.eye(3))[list(rows), :]
    if list(rows) in ([0, 1, 2], [3, 4, 5], [0, 1, 2, 3, 4, 5]):
        return scaled  # w does not depend on the axes of whole vectors
    turn = kinematics.pose(base).rotation.T
    return ca.sparsify(scaled @ ca.diagcat(turn, turn))


def _slopes(kinematics: Kinematics, groups: list[_Group], columns: list[ca.SX], place: ca.SX) -> list[ca.SX]:
    """d log w / dq of each joint of the chain, 1 x n each; see the module."""
    turning, moving = [], []
    for g, c in zip(groups, columns, strict=True):
        zero = ca.SX(3, 1)
        n = range(c.shape[1])
        own = (ca.cross(g.linear[:, i], c[:3, i]) + ca.cross(g.angular[:, i], c[3:, i]) for i in n)
        turning.append(sum(own, zero))
        moving.append(sum((ca.cross(c[:3, i], g.angular[:, i]) for i in n), zero))
    after, sums = ca.SX(3, 1), []
    for k in reversed(range(len(groups))):
        # The columns of one joint all turn with its child; seen from the base, that is the body before a turned joint
        sums.append(after if groups[k].turned else after + turning[k])
        after = after + turning[k]
    before, out = ca.SX(3, 1), []
    for k, g in enumerate(groups):
        moved = before + moving[k] if g.turned else before
        slope = sums[-1 - k].T @ g.angular + moved.T @ g.linear
        out.append(slope + _inner(kinematics, g, columns[k], place))
        before = before + moving[k]
    return out


def _inner(kinematics: Kinematics, group: _Group, column: ca.SX, place: ca.SX) -> ca.SX:
    """What a joint adds whose motion is not constant in its child (a universal joint, a composite), 1 x n."""
    maps, q = kinematics.symbolic(group.joint), kinematics.joint_q(group.joint)
    own = ca.vec(ca.densify(maps.subspace(q)))
    change = ca.sparsify(ca.jacobian(own, q) @ maps.tangent(q))
    width = column.shape[1]
    if change.nnz() == 0:
        return ca.SX(1, width)
    pose, sign = kinematics.joint_pose(group.joint), -1 if group.turned else 1
    lever, out = place - pose.position, []
    for k in range(width):
        moved = ca.reshape(change[:, k], 6, width)
        angular = pose.rotation @ moved[3:, :]
        linear = pose.rotation @ moved[:3, :] - rot.skew(lever) @ angular
        out.append(sign * (ca.dot(linear, column[:3, :]) + ca.dot(angular, column[3:, :])))
    return ca.horzcat(*out)


def _solve(square: ca.SX, right: ca.SX) -> tuple[list[ca.SX], ca.SX]:
    """Pivots of square = L D L' and the solution X of square X = right.

    The pivots are at least FLOOR^2 but for rounding, which is kept from making them negative.
    """
    n = square.shape[0]
    lower = ca.SX.eye(n)
    pivots: list[ca.SX] = []
    for i in range(n):
        for j in range(i):
            inner = sum((lower[i, k] * lower[j, k] * pivots[k] for k in range(j)), ca.SX(0))
            lower[i, j] = (square[i, j] - inner) / pivots[j]
        left = square[i, i] - sum((lower[i, k] ** 2 * pivots[k] for k in range(i)), ca.SX(0))
        pivots.append(ca.fmax(left, FLOOR**2 / 2))
    rows = [right[i, :] for i in range(n)]
    for i in range(n):
        for k in range(i):
            rows[i] = rows[i] - lower[i, k] * rows[k]
    rows = [row / pivot for row, pivot in zip(rows, pivots, strict=True)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            rows[i] = rows[i] - lower[k, i] * rows[k]
    return pivots, ca.vertcat(*rows)
