"""Distances of bodies along their common normal, and the rows of their derivatives.

Let two bodies be nearest to each other at points on a line of direction n (from a to b) through p. Moving the
nearest points along the bodies changes the distance d to second order only (envelope theorem), so

    dd/dt = n . (velocity of b at p - velocity of a at p) = (n, p x n) . (twist of b - twist of a)

with twists (linear; angular) at the origin of the world. Joints that both bodies hang on drop out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import WORLD, Kinematics


@dataclass(frozen=True, eq=False)
class Gap:
    """A signed distance of two bodies as expressions of poses and inputs.

    Attributes:
        a, b: frames that carry the bodies; ``"world"`` for a body that no joint moves.
        distance: scalar [m].
        normal: unit vector from a to b, world axes, 3.
        point: any point of the line through both nearest points, in the world [m], 3.
        offset: the constant place of ``point`` in frame a, where it has one [m]. Rows of one point against the
            world then share its Jacobian.
        level: many gaps have this very normal, and share what is computed from it.
    """

    a: str
    b: str
    distance: ca.SX
    normal: ca.SX
    point: ca.SX
    offset: tuple[float, float, float] | None = None
    level: bool = False


def gap_jacobian(kinematics: Kinematics, gaps: Sequence[Gap]) -> ca.SX:
    """Rows of the derivatives of the distances along v, rows x nv."""
    points: dict[tuple[str, tuple[float, float, float]], ca.SX] = {}
    screws: dict[int, tuple[ca.SX, ca.SX]] = {}
    rows = [ca.SX(0, kinematics.nv)]
    for gap in gaps:
        joint = kinematics.frame(gap.a)[0]
        if gap.offset is not None and gap.b == WORLD:
            key = (gap.a, gap.offset)
            if key not in points:
                place = kinematics.pose(gap.a).point(rot.constant(gap.offset))
                points[key] = kinematics.point_jacobian(joint, place)[:3, :]
            rows.append(-gap.normal.T @ points[key])
            continue
        own = set(kinematics.support(joint))
        other = set(kinematics.support(kinematics.frame(gap.b)[0]))
        moment = ca.cross(gap.point, gap.normal).T
        blocks = []
        for j in sorted(own ^ other):
            if j not in screws:
                screws[j] = _screw(kinematics, j)
            linear, angular = screws[j]
            # The two are equal; which is smaller depends on what is shared with other rows
            turning = gap.point.T @ (rot.skew(gap.normal) @ angular) if gap.level else moment @ angular
            along = gap.normal.T @ linear + turning
            blocks.append((j, along if j in other else -along))
        rows.append(kinematics.columns(1, blocks))
    return ca.vertcat(*rows)


def _screw(kinematics: Kinematics, joint: int) -> tuple[ca.SX, ca.SX]:
    """Twist (linear at the origin of the world, angular) of a joint's own motion, 3 x nv_j each."""
    linear, angular = kinematics.joint_twist(joint)
    return linear + rot.skew(kinematics.joint_pose(joint).position) @ angular, angular
