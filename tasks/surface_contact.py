"""A flat rectangle that stands on a surface: a foot, a palm."""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca

from wbc import validation
from wbc.robot import Robot
from wbc.tasks._contact import Cone, Contact, Pressing, checked_positive, force_row
from wbc.tasks.base import Row, Values


@dataclass(frozen=True)
class SurfaceContact(Pressing, Contact):
    """A rectangle on a surface does not move, J v = -gain e as for ``Hold`` with ``kind="pose"``. Its half lengths are
    X and Y about the origin, z is the normal of the surface, towards the robot, and its wrench w = (f; m), in the
    axes of the frame, keeps

        least <= f_z <= most,   |f_x| <= mu f_z,   |f_y| <= mu f_z                               [N]
        |m_x| <= Y f_z,   |m_y| <= X f_z                the centre of pressure is within it      [N m]
        m_min <= m_z <= m_max                           the yaw torque that friction bears       [N m]

        m_min = -mu (X + Y) f_z + |Y f_x - mu m_x| + |X f_y - mu m_y|
        m_max = +mu (X + Y) f_z - |Y f_x + mu m_x| - |X f_y + mu m_y|,      mu = friction / sqrt(2)

    These are the wrenches of forces at the four corners within friction pyramids (Caron, Pham and Nakamura, ICRA 2015),
    which leave out at most 29 % of a tangential force. Compiled for velocities it is a ``Hold``; the wrench counts for
    torques (docs/torque.md).

    Attributes:
        frame: name of the frame; z is the normal, from the surface to the robot.
        half_lengths: X and Y, half of the rectangle's sides along x and y [m].
        friction: first value of the input.
        least: first value of the input.
        most: first value of the input; infinite for none.

    Inputs:
        target: pose in the world [m, rad]. Default: the pose at the first step.
        gain: how fast drift decays [1/s]. Default 10.
        friction: Coulomb's coefficient [1]; in the pyramids that are the rows, mu = friction / sqrt(2).
        least: least normal force [N].
        most: largest normal force [N].

    What it cannot do: roll over an edge or toes (``LineContact``). It does not know whether the ground is there, flat
    or soft.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("talos"), dt=0.002)
        >>> for side in ("left", "right"):
        ...     foot = wbc.tasks.SurfaceContact(f"{side}_sole_link", half_lengths=(0.1, 0.06), friction=0.6)
        ...     stack.add(foot, name=f"{side} foot")
        >>> stack.add(wbc.tasks.CenterOfMass())

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    half_lengths: tuple[float, float]
    friction: float = 0.5
    least: float = 0.0
    most: float = math.inf

    def __post_init__(self) -> None:
        lengths = validation.real_array("SurfaceContact.half_lengths", self.half_lengths, (2,))
        checked = tuple(checked_positive(f"SurfaceContact.half_lengths[{k}]", lengths[k], "m") for k in range(2))
        object.__setattr__(self, "half_lengths", checked)
        super().__post_init__()

    def cone_rows(self, robot: Robot) -> tuple[Row, ...]:
        plain = [force_row(robot, name) for name in ("normal", *[f"friction {s}" for s in ("+x", "-x", "+y", "-y")])]
        pressure = [force_row(robot, f"pressure {s}", "N m") for s in ("+y", "-y", "+x", "-x")]
        yaw = [force_row(robot, f"yaw {k}", "N m") for k in range(1, 9)]
        return (*plain, *pressure, *yaw)

    def cone(self, inputs: Values) -> Cone:
        mu, (X, Y) = inputs["friction"] / math.sqrt(2.0), self.half_lengths
        rows = [ca.horzcat(0, 0, 1, 0, 0, 0)]
        rows += [ca.horzcat(-s, 0, mu, 0, 0, 0) for s in (1, -1)]
        rows += [ca.horzcat(0, -s, mu, 0, 0, 0) for s in (1, -1)]
        rows += [ca.horzcat(0, 0, Y, -s, 0, 0) for s in (1, -1)]
        rows += [ca.horzcat(0, 0, X, 0, -s, 0) for s in (1, -1)]
        for sign in (1, -1):
            for a in (1, -1):
                for b in (1, -1):
                    # sign m_z <= mu (X + Y) f_z - a (Y f_x + sign mu m_x) - b (X f_y + sign mu m_y)
                    rows.append(ca.horzcat(-a * Y, -b * X, mu * (X + Y), -a * sign * mu, -b * sign * mu, -sign))
        matrix = ca.sparsify(ca.SX(ca.vertcat(*rows)))
        count = matrix.shape[0] - 1
        lower = ca.vertcat(inputs["least"], ca.SX.zeros(count))
        return Cone(matrix, lower, ca.vertcat(inputs["most"], ca.SX.inf(count)))
