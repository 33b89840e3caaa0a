"""Coordinates as items of a stack: followed in the least-squares sense, or held exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from wbc import validation
from wbc.analysis.rows import BodyRows
from wbc.coordinates import expressions
from wbc.coordinates.expressions import DRIFT, REFERENCE
from wbc.coordinates.pair import is_pose
from wbc.coordinates.rows import Coordinate, coordinates as checked_coordinates
from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Input, Row, Rows, SacrificeOrder, Task, Values
from wbc.validation import Array

#: Largest rate at which the drift of what is held is taken back [m/s, rad/s]
FASTEST_RETURN = 0.05


@dataclass(frozen=True)
class FollowRows(Task):
    """Coordinates follow a commanded rate as well as they can: A(q) v = speed                 [m/s, rad/s]

    Several of them are the rows of one task, so that a scaled one keeps the direction of the whole command. With
    ``metric`` d, for all six rows of a frame, three points at a distance d along the frame's axes follow their
    velocities instead, nine rows in m/s, so that the answer does not depend on the unit of length:

        v_i = v + omega x d_i,    sum_i |v_i|^2 = e'We,  W = [3 I, -d [1]x; d [1]x, 2 d^2 I]  in the frame's axes

    Inputs:
        speed: one number a row of the coordinates. offset: their present error, which is taken back at ``gain``.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, appendix B, eqs. B.25 to B.33.
    """

    #: Made by pairs, so it is not in the table of items
    abstract: ClassVar[bool] = True

    coordinates: tuple[Coordinate, ...]
    metric: float | None = None

    def __init__(
        self, coordinates: Coordinate | Sequence[Coordinate], metric: float | None = None, gain: float | None = None
    ) -> None:
        given = checked_coordinates("coordinates", coordinates)
        if metric is not None:
            metric = validation.scalar("metric", metric, low=0.0, open_low=True, unit="m")
            if not any(map(is_pose, given)):
                raise RangeError("metric", metric, "three points stand for all six rows of a frame only")
        for field, value in (("coordinates", given), ("metric", metric), ("gain", gain)):
            object.__setattr__(self, field, value)

    def validate(self, robot: Robot) -> None:
        for one in self.coordinates:
            expressions.check(robot, "task", one)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        given = [row for one in self.coordinates for row in expressions.labels(robot, one)]
        zero, unit = np.zeros(len(given)), ", ".join(dict.fromkeys(r.unit for r in given))
        rates = ", ".join(f"{u}/s" for u in unit.split(", "))
        return (
            Input("offset", unit=unit, size=len(given), default=zero, rate="speed"),
            Input("speed", unit=rates, size=len(given), default=zero),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        points = [Row(f"{point}{axis}", "m") for point in "xyz" for axis in "xyz"]
        given = [points if self._spreads(one) else expressions.labels(robot, one) for one in self.coordinates]
        if len(given) == 1:
            return tuple(given[0])
        named = zip(self.coordinates, given, strict=True)
        return tuple(Row(f"{one} {row.label}", row.unit) for one, rows in named for row in rows)

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return ca.SX(-self.spread(robot, kin) @ inputs["offset"])

    def jacobian(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        matrices = (expressions.matrix(robot, kin, one) for one in self.coordinates)
        return self.spread(robot, kin) @ ca.vertcat(*matrices)

    def spread(self, robot: Robot, kin: Tracer) -> ca.SX:
        """From the rows to those that are served: S of S A(q) v."""
        return ca.SX(ca.diagcat(*(self._spread(robot, kin, one) for one in self.coordinates)))

    def _spreads(self, one: Coordinate) -> bool:
        return self.metric is not None and is_pose(one)

    def _spread(self, robot: Robot, kin: Tracer, one: Coordinate) -> ca.SX:
        if not self._spreads(one):
            return ca.SX.eye(len(expressions.labels(robot, one)))
        assert isinstance(one, BodyRows)
        assert self.metric is not None
        # Where the frame's axes are as seen from those of the rows
        turn = kin.rotation(one.frame)
        if one.expressed is not None:
            turn = kin.rotation(one.expressed).T @ turn
        order = [*one.translation, *(3 + k for k in one.rotation)]
        whole = [ca.horzcat(ca.SX.eye(3), -ca.skew(self.metric * turn[:, k])) for k in range(3)]
        return ca.SX(ca.vertcat(*whole)[:, order])


@dataclass(frozen=True)
class KeepRows(Constraint):
    """Coordinates have a prescribed rate, exactly: A(q) v = speed - gain e                       [m/s, rad/s]

    e is the drift from ``reference`` where the coordinates have one (see :mod:`wbc.coordinates.expressions`), so that
    what is held does not wander, and ``drift`` in rows that are rates only. gain e counts up to
    ``fastest_return``: what is far off, after a push or beside a locus, comes back at that speed.

    Inputs:
        speed: one number a row, 0 by default. gain: how fast drift decays [1/s], at most 1/dt.
        reference: pose, coordinate or angle that is held. Default: the one at the first step. Not for pure rates.
        drift: e of rows that are rates only, one number a row (``RateIntegrals``).

    Attributes:
        coordinate: what is held. gain: first value of the input.
        fastest_return: largest rate at which drift is taken back [m/s, rad/s].
    """

    #: Made by pairs, so it is not in the table of items
    abstract: ClassVar[bool] = True
    order: ClassVar[SacrificeOrder] = SacrificeOrder.HOLD
    equality: ClassVar[bool] = True
    initial_only: ClassVar[tuple[str, ...]] = ("gain",)

    coordinate: Coordinate
    gain: float = 10.0
    fastest_return: float = FASTEST_RETURN

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", validation.scalar("gain", self.gain, low=0.0, unit="1/s"))
        fastest = validation.scalar("fastest_return", self.fastest_return, low=0.0, open_low=True, unit="m/s, rad/s")
        object.__setattr__(self, "fastest_return", fastest)

    def validate(self, robot: Robot) -> None:
        expressions.check(robot, "constraint", self.coordinate)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        given = expressions.labels(robot, self.coordinate)
        rates = ", ".join(f"{u}/s" for u in dict.fromkeys(r.unit for r in given))
        held = expressions.reference(robot, self.coordinate)
        own: tuple[Input, ...] = (
            Input("speed", unit=rates, size=len(given), default=np.zeros(len(given))),
            Input("gain", unit="1/s", default=self.gain, low=0.0),
        )
        if expressions.rate_only(robot, self.coordinate).any():
            units = ", ".join(dict.fromkeys(r.unit for r in given))
            own = (*own, Input(DRIFT, unit=units, size=len(given), default=np.zeros(len(given))))
        return own if held is None else (*own, held)

    def initial(self, robot: Robot, q: Array) -> dict[str, Any]:
        if expressions.reference(robot, self.coordinate) is None:
            return {}
        return {REFERENCE: expressions.here(robot, self.coordinate, q)}

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(r.label, f"{r.unit}/s") for r in expressions.labels(robot, self.coordinate))

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        off = expressions.drift(robot, kin, self.coordinate, inputs.get(REFERENCE))
        off = ca.SX(0) if off is None else off
        if DRIFT in inputs:
            off = off + inputs[DRIFT]
        wanted = inputs["speed"] - ca.fmax(-self.fastest_return, ca.fmin(self.fastest_return, inputs["gain"] * off))
        return Rows(expressions.matrix(robot, kin, self.coordinate), wanted, wanted)

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        return expressions.drift(robot, kin, self.coordinate, inputs.get(REFERENCE))
