"""A body that moves goes over into another twist, or comes to rest, while limbs in the air go where they go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from wbc.climb.balance import Equilibrium
from wbc.climb.clear import Clearances
from wbc.climb.climber import Climber
from wbc.climb.closure import CLOSED, Closure
from wbc.climb.motion import MotionOptions
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.multibody import pin
from wbc.robot.joint_values import beyond_limits, joint_values
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Time between knots [s]
KNOT = 0.04
#: How it is tried, one after the other: times in which a body goes over from one twist to another [s], how many times
#: slower limbs in the air become meanwhile [1], and the share of the twist
TRIED = ((0.25, 1.0, 1.0), (0.4, 1.4, 1.0), (0.6, 2.0, 1.0), (0.4, 1.4, 0.5), (0.6, 2.0, 0.2))
#: Share of the joints' accelerations that is used meanwhile [1]
MOST_PULL = 0.9

#: The motion that limbs in the air had, q ``(nq)`` by time [s]
Guide = Callable[[float], Array]


@dataclass(frozen=True, eq=False)
class BodyTurn:
    """Plans along which a body goes from the twist w_0 that it has evenly over into w_1, keeps that, and comes to rest,

        P' = P w(t),    w(t) = w_0 + (w_1 - w_0) t / T up to T, and w_1 (1 - (t - t_1) / T) from t_1 on,

    limbs that hold where they are, and the others along given ways.

    Args:
        climber, scene: what moves where. options: clearances and shares of the joints' limits that are kept.
    """

    climber: Climber
    scene: ClimbScene
    options: MotionOptions

    def planned(
        self, start: Stance, v: Array, twist: Array, guide: Guide, moves: Sequence[ContactMove] = (), lasts: float = 0.0
    ) -> ContactPlan | None:
        """From a stance on; None: no such plan was proven.

        Args:
            start: where it is. v: how fast it goes there ``(nv)`` [m/s, rad/s].
            twist: w_1 in the axes of the body ``(6)`` [m/s, rad/s]. guide: from the stance on; contacts of limbs in the
                air go through the same places. moves: of those that land, by its time. lasts: the others move so
                long [s].
        """
        for over, slower, share in TRIED:
            pace = _Slower(over, slower)
            slow = [replace(move, land=pace.when(move.land)) for move in moves]
            ends = max([2.0 * over, pace.when(lasts), *(move.land for move in slow)])
            plan = self._along(start, v, _twists(v[:6], share * twist, over, ends), guide, pace, slow)
            if plan is not None:
                return plan
        return None

    def _along(
        self, start: Stance, begins: Array, timed: tuple[Array, Array], guide: Guide, pace: _Slower,
        moves: list[ContactMove],
    ) -> ContactPlan | None:  # fmt: skip
        (times, twists), climber = timed, self.climber
        limbs, lands = range(len(climber.limbs)), {move.limb: move.land for move in moves}
        aloft = [limb for limb in limbs if start.contacts[limb] == FREE_LIMB]
        wanted = {limb: place(climber.contact_pose(start.q, limb))[None] for limb in limbs}
        q, pose = [np.array(start.q)], climber.body_pose(start.q)
        for k, time in enumerate(times[1:]):
            pose = pose * pin.exp6(pin.Motion(0.5 * (times[k + 1] - times[k]) * (twists[k] + twists[k + 1])))
            some = climber.with_body(q[-1], pose)
            for limb in aloft:
                at = guide(pace.of(min(float(time), lands.get(limb, np.inf))))
                wanted[limb] = place(climber.contact_pose(at, limb))[None]
                if float(times[k]) < lands.get(limb, np.inf):
                    # From the posture that it would have: of those of its place the one that goes on evenly
                    some = climber.with_limb(some, limb, climber.angles(at, limb))
            some = some[None]
            if self._closure.bring(some, wanted, body=0.0)[0] > 10.0 * CLOSED:
                return None
            q.append(some[0])
        steps, path = np.diff(times)[:, None], np.array(q)
        values, still = joint_values(climber.robot, path), np.zeros(climber.robot.nv - 6)
        curve = CubicSpline(times, values, bc_type=((1, begins[6:]), (1, still)))
        v = np.hstack([twists, curve(times, 1)])
        v[-1, 6:] = still
        if not (self._within(path, v, steps) and self._borne(start.contacts, path)):
            return None
        rows = [[row] for row in start.contacts]
        for limb in aloft:
            near = np.linalg.norm(self.scene.positions - climber.contact_pose(start.q, limb).translation, axis=1)
            rows[limb] += [int(near.argmin()), *(k for move in moves if move.limb == limb
                                                 for k in (move.leaves, move.lands))]  # fmt: skip
        if self._clear.moving(rows, times, path, v) is not None:
            return None
        return ContactPlan(climber, self.scene, start.contacts, list(moves), times, path, v)

    @cached_property
    def _closure(self) -> Closure:
        return Closure(self.climber)

    @cached_property
    def _clear(self) -> Clearances:
        return Clearances(self.climber, self.scene, self.options.clearance, self.options.apart)

    @cached_property
    def _balance(self) -> Equilibrium:
        return Equilibrium(self.climber, self.scene, self.options.friction)

    def _within(self, q: Array, v: Array, steps: Array) -> bool:
        """Whether the joints keep their limits, and their shares of rates and accelerations."""
        robot, speeds = self.climber.robot, self.options.speeds
        if beyond_limits(robot, q) is not None:
            return False
        rates, changes = np.abs(v[:, 6:]), np.abs(np.diff(v[:, 6:], axis=0) / steps)
        most = np.fmax(speeds.share * robot.limits.velocity[6:], rates[0])
        able = np.isfinite(robot.limits.acceleration[6:])
        pull = MOST_PULL * robot.limits.acceleration[6:][able]
        return bool((rates <= most).all() and (changes[:, able] <= pull).all())

    def _borne(self, contacts: tuple[int, ...], q: Array) -> bool:
        """Whether the limbs that hold bear the robot."""
        if not np.asarray(self.scene.gravity).any():
            return True
        return all(self._balance.margin(contacts, some) >= self.options.margin for some in q[:: max(1, len(q) // 8)])


@dataclass(frozen=True)
class _Slower:
    """The time s of a guide that goes over from its full rate to a lower one: s' = 1 / a + (1 - 1 / a) (1 - t / T)."""

    over: float
    slower: float

    def of(self, time: float) -> float:
        """s at a time [s]."""
        least, part = 1.0 / self.slower, min(time, self.over)
        return least * time + (1.0 - least) * part * (1.0 - 0.5 * part / self.over)

    def when(self, end: float) -> float:
        """The time at which s is there [s]."""
        least, half = 1.0 / self.slower, 0.5 * (1.0 - 1.0 / self.slower) * self.over
        if end >= self.of(self.over):
            return (end - half) / least
        # s = t - half (t / T)^2
        return (
            end if half == 0.0 else self.over**2 * (1.0 - np.sqrt(1.0 - 4.0 * half * end / self.over**2)) / (2.0 * half)
        )


def _twists(begin: Array, kept: Array, over: float, lasts: float) -> tuple[Array, Array]:
    """Times, and the twists there."""
    count = int(np.ceil(lasts / KNOT - 1e-9))
    times = np.linspace(0.0, lasts, count + 1)
    into, out = np.clip(times / over, 0.0, 1.0), np.clip((lasts - times) / over, 0.0, 1.0)
    return times, (1.0 - into)[:, None] * begin + (into * out)[:, None] * kept
