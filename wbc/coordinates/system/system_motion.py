"""The system Jacobian, whose rank never falls, and how many pairs of coordinates can be made of its rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, islice
from math import comb
from typing import Any

import numpy as np

from wbc.analysis.rows import BodyRows
from wbc.coordinates import expressions
from wbc.coordinates.arms.arm_parts import MissingPartError
from wbc.coordinates.rows import Coordinate, coordinates
from wbc.coordinates.samples import ROUNDING, ranks
from wbc.coordinates.scales import scales
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import WORLD, joint_of
from wbc.validation import Array

#: Sets of rows whose rank is looked at together
TOGETHER = 20_000
#: Sets of rows that are looked at, at most
MOST = 2_000_000


def system_coordinates(robot: Robot) -> tuple[BodyRows, ...]:
    """Position and orientation of the body behind every joint: x_S, six rows a body                  [m, rad]

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 2.1.

    Raises:
        MissingPartError: a joint whose body has no frame.
    """
    model, out = checked_robot(robot).model, []
    for j in range(1, model.njoints):
        names = [(f.type != pin.FrameType.BODY, str(f.name)) for f in model.frames if int(f.parentJoint) == j]
        own = [name for _, name in sorted(names, key=lambda item: item[0]) if joint_of(model, name) == j]
        if not own:
            raise MissingPartError.of("robot", robot.name, f"frame on the body behind joint {model.names[j]!r}")
        out.append(BodyRows(own[0], expressed=WORLD))
    return tuple(out)


@dataclass(frozen=True)
class PairCount:
    """How large the choice among pairs is.

    Attributes:
        coordinates: system coordinates, six a body. pairs: those with all six rows of a body as the task and as many
            single rows of the other bodies as constraints as there are joints to spare.
        regular: those of them whose rows have full rank at the configuration that was asked for.
    """

    coordinates: int
    pairs: int
    regular: int


def count_pairs(bodies: int, constraints: int) -> int:
    """Pairs of the six coordinates of one body, and ``constraints`` single ones of the other bodies:

        bodies * C(6 (bodies - 1), constraints)            7 bodies: 252 with one constraint, 4410 with two

    Source: E. Dupuis, PhD thesis, McGill University, 2001, chapter 3, pages 37 and 38.

    Raises:
        RangeError: no body, or a negative number of constraints.
    """
    for name, number, least in (("bodies", bodies, 1), ("constraints", constraints, 0)):
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < least:
            raise RangeError(name, number, f"expected a whole number of at least {least}")
    return int(bodies) * comb(6 * (int(bodies) - 1), int(constraints))


class SystemMotion:
    """Rates of all system coordinates by those of the joints:

        x_S' = J_S(q) q',    rank J_S = nv at every q, if the coordinates are poses of all bodies

    Args:
        rows: which coordinates; default: :func:`system_coordinates`.

    Attributes:
        robot: as given. coordinates: of the rows.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, eqs. 2.1 to 2.6.

    Raises:
        ShapeError, UnknownNameError, RangeError, MissingPartError: bad coordinates; a body without a frame.
    """

    def __init__(self, robot: Robot, rows: Coordinate | Sequence[Coordinate] | None = None) -> None:
        self.robot = checked_robot(robot)
        self.coordinates: tuple[Coordinate, ...] = (
            system_coordinates(robot) if rows is None else coordinates("rows", rows)
        )
        for one in self.coordinates:
            expressions.check(robot, "rows", one)
        self._whole = rows is None
        self._rates = SingleState(expressions.rate_function(robot, self.coordinates))
        self._rows, self._columns = scales(robot, self.coordinates)

    def jacobian(self, q: Any) -> Array:
        """J_S(q), in the coordinates' own units [rows, nv].

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        return self._rates(self.robot.configuration("q", q))[0]

    def scaled(self, q: Any) -> Array:
        """J_S(q) with metres over the length of the arm that they belong to: what ranks are looked at in."""
        return self._rows[:, None] * self.jacobian(q) * self._columns

    def rank(self, q: Any) -> int:
        """Rank of J_S(q), see :func:`wbc.coordinates.samples.ranks`."""
        return int(ranks(self.scaled(q)))

    def count(self, q: Any) -> PairCount:
        """The pairs that :func:`count_pairs` counts, and those of them that are regular at ``q``.

        A pair of a body's six rows J_T and single rows J_C is regular if J_T has rank 6 and J_C rank nv - 6 on the
        null space of J_T.

        Raises:
            RangeError: fewer than six joints, coordinates that are not poses of all bodies, or more than two million
                sets to look at.
        """
        bodies, spare = self.robot.model.njoints - 1, self.robot.nv - 6
        if not self._whole or spare < 0:
            raise RangeError("robot", self.robot.name, "pairs are counted of six joints or more, with all their bodies")
        if count_pairs(bodies, spare) > MOST:
            raise RangeError("robot", self.robot.name, f"{count_pairs(bodies, spare)} pairs are too many to look at")
        J, regular = self.scaled(q), 0
        for k in range(bodies):
            own = slice(6 * k, 6 * k + 6)
            _, sigma, right = np.linalg.svd(J[own])
            if sigma[-1] <= ROUNDING * sigma[0]:
                continue
            left = np.delete(J, own, axis=0) @ right[6:].T
            subsets = combinations(range(len(left)), spare)
            while some := list(islice(subsets, TOGETHER)):
                regular += int((ranks(left[np.array(some, dtype=int)]) == spare).sum()) if spare else len(some)
        return PairCount(len(J), count_pairs(bodies, spare), regular)
