"""PitchPlaneLimit: the angle of an arm's plane stays between two bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import casadi as ca

from wbc import validation
from wbc.errors import BoundsError, RangeError
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks._plane import PlaneItem
from wbc.tasks.base import Constraint, Row, Values


@dataclass(frozen=True)
class PitchPlaneLimit(PlaneItem, Constraint):
    """The plane of shoulder, elbow and wrist stays within lower <= psi <= upper on the circle:

        h = (c + f wrap(psi - m),  c - f wrap(psi - m)) >= 0                                           [rad]

    psi and the fading factor f are those of :class:`wbc.tasks.PitchPlane`; the axis form uses ``PlaneReference()`` if
    no ``reference`` is given. m = (lower + upper) / 2 and c = (upper - lower) / 2. Where f = 1 the margins are psi -
    lower and upper - psi. Towards a singular set they go smoothly to c, which switches the limit off. ``Limit`` of a
    ``PitchPlane`` does the same with bounds that can be set at run time.

    Attributes:
        lower, upper: bounds of psi [rad], lower < upper < lower + 2 pi; (3, 4) is a range that contains pi.
        others: as in :class:`wbc.tasks.PitchPlane`.

    What it cannot do: guard the plane inside the faded zones, count turns, or keep a gap 2 pi - (upper - lower) smaller
    than the plane's turn in one tick.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("panda")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> plane = wbc.tasks.PitchPlaneLimit("panda_link2", "panda_link3", "panda_link6", lower=-0.5, upper=1.0)
        >>> stack.add(plane, name="plane")
        >>> stack.add(wbc.tasks.JointLimits())

    Raises:
        BoundsError: lower >= upper.
        RangeError: a range of a full turn or more.
        UnknownNameError, ShapeError, NotFiniteError: a bad field.
    """

    lower: float = field(kw_only=True)
    upper: float = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        lower = validation.scalar("lower", self.lower, unit="rad")
        upper = validation.scalar("upper", self.upper, unit="rad")
        if lower >= upper:
            raise BoundsError("lower", lower, f"expected a value below upper = {upper:g} rad")
        if upper - lower >= 2 * math.pi:
            raise RangeError("upper", upper, f"expected less than a full turn above lower = {lower:g} rad")
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("lower", "rad"), Row("upper", "rad"))

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        half = (self.upper - self.lower) / 2
        off = self._fading(kin, with_reference=True) * self._turned(kin, ca.SX(self.lower + half))
        return ca.vertcat(half + off, half - off)

    def row_factor(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        factor = self._fading(kin, with_reference=True)
        return ca.vertcat(factor, factor)
