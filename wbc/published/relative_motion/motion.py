"""Resolved rate of the level hand, straight lines, and a hand that keeps its place on a table that moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import InfeasibleError, RangeError
from wbc.multibody import pin
from wbc.published.relative_motion.arms import ARM, SHOULDER, hand, levelled, manipulator
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.taylor import TaylorJacobian
from wbc.validation import Array

#: Least |det J| that is inverted, as a part of that at home, 40 * 40 * 18 in^3
LEAST = 1e-6
#: Steps of Newton's method that a place takes at most
STEPS = 20
#: Error at which they end [m, rad]
NEAR = 1e-10


class LevelHand:
    """Places of the level hand, four numbers (x, y, z, alpha) [m, rad], by the first four joints.

        J [dq1 .. dq4] = (dx, dy, dz, -P),   P(q; alpha) = sin alpha x4x + cos alpha x4y        (3.18, 3.19)

    P is the document's times cos alpha, so that alpha = 90 degrees is a yaw like others; ``published=True`` has it as
    printed, with S = tan alpha. The wrist is levelled exactly after each step, as published.

    Args:
        order: of the Jacobian about the latched configuration, None for exact; see :class:`TaylorJacobian`.
    """

    def __init__(self, order: int | None = None, published: bool = False) -> None:
        kinematics, turn = Kinematics(manipulator().model), ca.SX.sym("turn", 2)
        x4 = kinematics.pose("F4").rotation[:, 0]
        residual = turn[0] * x4[0] + turn[1] * x4[1]
        rows = ca.vertcat(kinematics.pose("tip").position, residual)
        self.taylor = TaylorJacobian(kinematics, rows, order, turn)
        self._published, self._turn = validation.flag("published", published), np.array([0.0, 1.0])
        self.latch(np.zeros(6))

    def latch(self, q: Array, yaw: float = 0.0) -> None:
        """Expand about a configuration for a reference of the yaw."""
        s, c = np.sin(yaw), np.cos(yaw)
        self._turn = np.array([np.tan(yaw), 1.0] if self._published else [s, c])
        self.taylor.latch(q, self._turn)

    def jacobian(self, q: Array) -> Array:
        """d(x, y, z, P) / d(q1 .. q4) [4, 4]."""
        return np.asarray(self.taylor.at(q)[:, :4])

    def residual(self, q: Array) -> float:
        """P; 0 where the levelled hand has the latched yaw, or that and half a turn."""
        return float(self.taylor.value(q, self._turn)[0][3, 0])

    def step(self, q: Array, increment: Array) -> Array:
        """The published solve: one step of Newton for an increment of the position and the whole error of the yaw.

        Raises:
            RangeError: the Jacobian has no inverse.
        """
        J = self.jacobian(q)
        if abs(np.linalg.det(J)) < LEAST * ARM**2 * SHOULDER:
            raise RangeError("q", q, "the Jacobian of the level hand has no inverse")
        out = np.array(q, dtype=float)
        out[:4] += np.linalg.solve(J, np.append(increment, -self.residual(q)))
        return levelled(out)

    def reach(self, q: Array, place: Array) -> Array:
        """The configuration at a place, near q, by as many exact steps as it takes.

        Raises:
            RangeError: as :meth:`step`. InfeasibleError: no such configuration is found.
        """
        place = validation.ordinary_array("place", place, (4,))
        self.latch(q, place[3])
        for _ in range(STEPS):
            q = self.step(q, place[:3] - hand(q)[0])
            off = np.append(hand(q)[0] - place[:3], self.residual(q))
            if np.abs(off).max() < NEAR:
                return q
        raise InfeasibleError("place", place, f"not reached in {STEPS} steps, off by {np.abs(off).max():.2g}")


def straight_line(
    level: LevelHand, q: Array, increment: Any, yaw: float | None = None, *, solves: int = 1, feedback: bool = False,
    divisions: int = 1, latched: Array | None = None,
) -> Array:  # fmt: skip
    """Configurations of the program MAIN from q to q and an increment [m].

    Args:
        yaw: of the hand at the end [rad], absolute as in the document: a hand that has another one is turned to it,
            by the first solve. Default: the hand is not turned.
        solves: of the Jacobian on the way; the document has one. feedback: each is repeated until the hand is at its
            point of the line. divisions: of joint space between solves; they set the speed.
        latched: where the Jacobian is expanded; default: q ("initial set"), and each point with feedback.

    Returns:
        Configurations [1 + solves * divisions, 6], q first.

    Raises:
        RangeError: no inverse on the way, or a hand that no wrist levels. InfeasibleError: with feedback, out of reach.
    """
    q, increment = validation.ordinary_array("q", q, (6,)), validation.ordinary_array("increment", increment, (3,))
    validation.integer("solves", solves, 1), validation.integer("divisions", divisions, 1)
    start, out = hand(q)[0], [q]
    yaw = hand(q)[1] if yaw is None else float(validation.scalar("yaw", yaw, unit="rad"))
    level.latch(q if latched is None else latched, yaw)
    for k in range(1, solves + 1):
        there = np.append(start + increment * k / solves, yaw)
        goal = level.reach(q, there) if feedback else level.step(q, increment / solves)
        out += [q + (goal - q) * j / divisions for j in range(1, divisions + 1)]
        q = goal
    return np.array(out)


def deviation(path: Array, increment: Array) -> tuple[Array, float]:
    """Error of the end [3], and the farthest that the hand is from the segment on the way [m]."""
    places = np.array([hand(q)[0] for q in path])
    off, length = places - places[0], float(np.linalg.norm(increment))
    along = np.clip(off @ increment / length**2, 0.0, 1.0)
    return off[-1] - increment, float(np.linalg.norm(off - along[:, None] * increment, axis=1).max())


@dataclass(frozen=True, eq=False)
class Held:
    """A hand on a table, tick by tick: the table and the hand (x, y, z, alpha) [ticks, 4], and joints [ticks, 6].

    ``relative``: the hand in the table's frame; ``commanded``: the operator's R [ticks, 4].
    """

    table: Array
    hand: Array
    q: Array
    relative: Array
    commanded: Array


def hold_on_table(
    q: Array, table: Callable[[float], tuple[Array, Array]], operator: Callable[[float], Array], seconds: float,
    period: float = 0.05, *, compensated: bool = True, feedforward: bool = False,
) -> Held:  # fmt: skip
    """A = T + R: the operator commands R in the table's frame, and what is measured of the table is added (2.1).

    In each cycle the hand goes to where R would be on the table as it was measured, and is there at the cycle's end;
    with feed-forward, on the table as it will be then by its twist. The first cycle starts at rest there.

    Args:
        table: time -> its place (x, y, z, alpha) and their rates, as the measuring arm has them.
        operator: time -> R (x, y, z, alpha). compensated: without, T stays what it was at first.

    Raises:
        RangeError, InfeasibleError: the hand cannot be there.
    """
    level, log = LevelHand(), []
    first = table(0.0)[0]
    q = level.reach(q, _placed(first, operator(0.0)))
    for k in range(round(seconds / period) + 1):
        now, rates = table(k * period)
        place, yaw = hand(q)
        log.append((now, np.append(place, yaw), q, _relative(now, np.append(place, yaw)), operator(k * period)))
        expected = now + period * rates if feedforward else now
        q = level.reach(q, _placed(expected if compensated else first, operator((k + 1) * period)))
    return Held(*(np.array(column) for column in zip(*log, strict=True)))


def _turned(alpha: float) -> Array:
    """Rotation of something with yaw alpha, which counts from +y towards +x."""
    return np.asarray(pin.utils.rotate("z", -alpha))


def _placed(table: Array, relative: Array) -> Array:
    return np.append(table[:3] + _turned(table[3]) @ relative[:3], table[3] + relative[3])


def _relative(table: Array, place: Array) -> Array:
    turn = place[3] - table[3]
    return np.append(_turned(table[3]).T @ (place[:3] - table[:3]), np.arctan2(np.sin(turn), np.cos(turn)))
