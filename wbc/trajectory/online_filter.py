"""Targets that change at any time, followed in a control loop with bounded velocity, acceleration and jerk."""

from __future__ import annotations

from math import isfinite
from operator import le
from typing import Any, Literal

import numpy as np

from wbc import validation
from wbc.errors import BoundsError, RangeError
from wbc.trajectory.between_states import limits_of, sizes_of
from wbc.trajectory.braking import after, guarded, reach
from wbc.trajectory.course import Course, Point, stop
from wbc.trajectory.law import State
from wbc.trajectory.limits import Limits
from wbc.trajectory.state_to_state import Task, plan
from wbc.validation import Array

Status = Literal["moving", "reached", "guarded", "recovered"]

_FLOAT = np.dtype(np.float64)

#: Positions beyond their limits by less than this [rad or m] are rounding
ROOM = 1e-9

#: Walls that are farther away than this many seconds are no targets for a velocity: ruckig ends at 7e3 s
FAR = 1e3


def online(
    dof: int | Limits,
    dt: float,
    *,
    velocity: Any = None,
    acceleration: Any = None,
    jerk: Any = None,
    lower: Any = None,
    upper: Any = None,
    synchronisation: Literal["time", "phase", "none"] = "time",
) -> Online:
    """A filter that follows changing targets, one state every ``dt`` seconds:

        |dq| <= V, |d2q| <= A, |d3q| <= J, lower <= q <= upper at every tick, whatever the targets are

    Args:
        dof: number of joints; or limits, which the other arguments replace one by one.
        dt: duration of a tick [s].
        velocity, acceleration, jerk: n finite positive numbers, or one for all joints [per s, s^2, s^3].
        lower, upper: limits of positions, n, or one for all joints [rad or m].
        synchronisation: how the joints go to a position target, as of ``jerk_limited``.

    Raises:
        ShapeError, NotFiniteError, UnknownNameError, RangeError, BoundsError: of arguments.
    """
    dt = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
    validation.one_of("synchronisation", synchronisation, ("time", "phase", "none"))
    given = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk, "lower": lower, "upper": upper}
    if isinstance(dof, Limits):
        given = {k: getattr(dof, k) if v is None else v for k, v in given.items()}
        count = dof.dof or 0
    else:
        count = int(validation.scalar("dof", dof, low=1.0))
    return Online(limits_of(count, **given), dt, synchronisation)


class Online:
    """See :func:`online`. It stands at 0, or at the nearest position within the limits, until :meth:`reset`.

    Targets and limits are checked where they are set: what is refused changes nothing. ``step`` raises nothing.

    Attributes:
        status: what the last tick did: ``moving``; ``reached`` the target; ``guarded``: a joint brakes at a position
            limit instead of following; ``recovered``: ruckig refused, and a course of our own was taken.
        clipped: whether the target was outside the position limits, and the nearest position within them is meant.
    """

    def __init__(self, limits: Limits, dt: float, synchronisation: str) -> None:
        import ruckig

        self.dof = len(sizes_of(limits)[0])
        self.dt = dt
        self.status: Status = "reached"
        self.clipped = False
        self._refusal = ruckig.RuckigError
        self._done = ruckig.Result.Finished
        self._modes = ruckig.ControlInterface
        names = {"time": ruckig.Synchronization.Time, "phase": ruckig.Synchronization.Phase}
        self._together = names.get(synchronisation, ruckig.Synchronization.No)
        self._alone = ruckig.Synchronization.No
        self._ruckig: Any = ruckig.Ruckig(self.dof, dt)
        self._asked: Any = ruckig.InputParameter(self.dof)
        self._answer: Any = ruckig.OutputParameter(self.dof)
        self._fastest = np.zeros(self.dof)
        self._shape = (self.dof,)
        self._aims: tuple[list[float], Array, Array, Array] = ([], np.zeros(0), np.zeros(0), np.zeros(0))
        self._plain = False
        self._kind: Literal["position", "velocity"] = "position"
        self._take(limits)
        self.reset(np.clip(np.zeros(self.dof), self._low, self._high))

    @property
    def current_limits(self) -> Limits:
        """The limits in force."""
        return self._limits

    def reset(self, position: Any, velocity: Any = None, acceleration: Any = None) -> None:
        """Go on from a state, and stop there until there is a target.

        Raises:
            ShapeError, NotFiniteError: not n finite numbers. BoundsError: a position outside its limits. RangeError: a
            velocity or an acceleration beyond its limit.
        """
        rows = [validation.real_array("position", position, (self.dof,))]
        if ((rows[0] < self._low) | (rows[0] > self._high)).any():
            raise BoundsError("position", position, f"expected within {self._low.tolist()} and {self._high.tolist()}")
        sizes = sizes_of(self._limits)
        for name, value, limit in (("velocity", velocity, sizes[0]), ("acceleration", acceleration, sizes[1])):
            row = np.zeros(self.dof) if value is None else validation.real_array(name, value, (self.dof,))
            if (np.abs(row) > limit).any():
                raise RangeError(name, value, f"expected at most {limit.tolist()} in size")
            rows.append(row)
        self._put([row.tolist() for row in rows])
        self.stop()

    def target(self, position: Any, velocity: Any = None) -> None:
        """Go to a position, and arrive there with a velocity (0 by default), with which the joints then go on.

        Positions outside the limits are clipped, see :attr:`clipped`.

        Raises:
            ShapeError, NotFiniteError: not n finite numbers. RangeError: a velocity beyond its limit.
        """
        if velocity is None and self._plain and type(position) is np.ndarray and self._only_place(position):
            return
        place = validation.real_array("target.position", position, (self.dof,))
        speed = None if velocity is None else self._speed("target.velocity", velocity)
        self._kind, self._place, self._pace = "position", place, np.zeros(self.dof) if speed is None else speed
        self._aim()

    def target_velocity(self, velocity: Any) -> None:
        """Take a velocity, each joint as fast as it can, and keep it until the position limits.

        Raises:
            ShapeError, NotFiniteError: not n finite numbers. RangeError: beyond its limit.
        """
        self._pace = self._speed("target_velocity", velocity)
        self._kind = "velocity"
        self._aim()

    def stop(self) -> None:
        """Come to rest, each joint as soon as it can."""
        self._kind, self._pace = "velocity", np.zeros(self.dof)
        self._aim()

    def limits(
        self, *, velocity: Any = None, acceleration: Any = None, jerk: Any = None, lower: Any = None, upper: Any = None
    ) -> None:
        """Other limits from now on; those not given stay. What is beyond them comes back as soon as it can.

        Raises:
            ShapeError, NotFiniteError, RangeError, BoundsError: of arguments.
        """
        given = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk, "lower": lower, "upper": upper}
        self._take(limits_of(self.dof, **{k: getattr(self._limits, k) if v is None else v for k, v in given.items()}))
        self._aim()

    def step(self) -> State:
        """The state one tick later."""
        answer = self._answer
        try:
            done = self._ruckig.update(self._asked, answer) is self._done
            p, v, a = answer.new_position, answer.new_velocity, answer.new_acceleration
            self.status = "reached" if done else "moving"
        except self._refusal:
            rows = self._recovered()
            p, v, a = rows
            self._put(rows)
            self.status = "recovered"
        else:
            if self._walled and self._guard(p, v, a):
                self._put([p, v, a])
                self.status = "guarded"
            else:
                answer.pass_to_input(self._asked)
                self._now = (p, v, a)
        rows_now = np.array((p, v, a))
        return State(rows_now[0], rows_now[1], rows_now[2])

    def _only_place(self, position: Array) -> bool:
        """Take a target at rest after another one: all but the place stays. False for what has to be looked at.

        In lists, which ruckig takes in a tenth of the time of arrays.
        """
        if position.dtype is not _FLOAT or position.shape != self._shape:
            return False
        place: list[float] = position.tolist()
        if not isfinite(sum(place)):
            return False
        self._place = np.array(place)
        if self._walled:
            low, high = self._sizes[:2]
            self.clipped = not (all(map(le, low, place)) and all(map(le, place, high)))
            if self.clipped:
                place = np.clip(place, self._low, self._high).tolist()
        self._asked.target_position = place
        self._aims = (place, *self._aims[1:])
        return True

    def _speed(self, name: str, value: Any) -> Array:
        row = validation.real_array(name, value, (self.dof,))
        limit = sizes_of(self._limits)[0]
        if (np.abs(row) > limit).any():
            raise RangeError(name, value, f"expected at most {limit.tolist()} in size")
        return row

    def _put(self, rows: list[list[float]]) -> None:
        """Make a state the one that the next tick starts from."""
        self._now = (rows[0], rows[1], rows[2])
        self._asked.current_position, self._asked.current_velocity, self._asked.current_acceleration = rows

    def _take(self, limits: Limits) -> None:
        v, a, j = sizes_of(limits)
        self._limits = limits
        none = np.full(self.dof, np.inf)
        self._low = -none if limits.lower is None else limits.lower
        self._high = none if limits.upper is None else limits.upper
        self._walled = bool(np.isfinite([self._low, self._high]).any())
        self._asked.max_acceleration, self._asked.max_jerk = a, j
        # A joint that is farther from its walls than its longest stop need not be looked at
        self._fastest = np.maximum(self._fastest, v)
        far = [reach(*row)[1] for row in zip(self._fastest.tolist(), a.tolist(), a.tolist(), j.tolist(), strict=True)]
        self._near_low, self._near_high = (self._low + far).tolist(), (self._high - far).tolist()
        self._joints = range(self.dof)
        self._short = ((0.5 / a).tolist(), (0.5 * a / j).tolist(), (1.0 / j).tolist())
        self._sizes = (self._low.tolist(), self._high.tolist(), a.tolist(), j.tolist())

    def _aim(self) -> None:
        """Tell ruckig what is wanted, within the limits."""
        asked, limit = self._asked, sizes_of(self._limits)[0]
        self._plain = self._kind == "position" and not self._pace.any()
        pace = np.clip(self._pace, -limit, limit)
        asked.max_velocity, asked.min_velocity = limit, -limit
        if self._kind == "position":
            place = np.clip(self._place, self._low, self._high)
            self.clipped = bool((place != self._place).any())
            asked.control_interface, asked.synchronization = self._modes.Position, self._together
            asked.per_dof_control_interface = None
            asked.target_position, asked.target_velocity = place, pace
            self._aims = (place.tolist(), pace, limit, np.ones(self.dof, dtype=bool))
            return
        self.clipped = False
        # Towards a wall, a velocity is a way to the wall that is no faster: so the joint comes to rest there in time
        wall = np.where(pace > 0.0, self._high, self._low)
        here = np.array(self._now[0])
        to_wall = (pace != 0.0) & np.isfinite(wall)
        to_wall[to_wall] = np.abs(wall - here)[to_wall] < FAR * np.abs(pace)[to_wall]
        place, speed = np.where(to_wall, wall, here), np.where(to_wall, 0.0, pace)
        asked.max_velocity = np.where(to_wall & (pace > 0.0), pace, limit)
        asked.min_velocity = np.where(to_wall & (pace < 0.0), pace, -limit)
        asked.synchronization = self._alone
        asked.per_dof_control_interface = [self._modes.Position if w else self._modes.Velocity for w in to_wall]
        asked.target_position, asked.target_velocity = place, speed
        self._aims = (place.tolist(), speed, np.where(to_wall, np.abs(pace), limit), to_wall)

    def _guard(self, p: list[float], v: list[float], a: list[float]) -> bool:
        """Brake joints that could no longer stop within their limits; whether there were any."""
        low, high, acceleration, jerk = self._sizes
        slow, ramp, push = self._short
        changed = False
        for i, place in enumerate(p):
            if self._near_low[i] < place < self._near_high[i]:
                continue
            # From w = |v| + a^2/2j, the highest speed to come, a stop is no longer than w (w/2A + A/2j + |a|/j)
            speed, size = abs(v[i]), abs(a[i])
            speed += 0.5 * push[i] * size * size
            way = speed * (speed * slow[i] + ramp[i] + size * push[i]) - ROOM
            if low[i] + way <= place <= high[i] - way and size <= acceleration[i]:
                continue
            now = (self._now[0][i], self._now[1][i], self._now[2][i])
            wanted = (p[i], v[i], a[i])
            other = guarded(now, wanted, low[i], high[i], acceleration[i], jerk[i], self.dt, ROOM)
            if other is not None:
                p[i], v[i], a[i] = other
                changed = True
        return changed

    def _recovered(self) -> list[list[float]]:
        """The next state by courses of our own: to the aims, or where these are velocities, a stop about them."""
        _, acceleration_limit, jerk_limit = sizes_of(self._limits)
        place, pace, top, _ = self._aims
        now = np.array(self._now)
        if self._kind == "position":
            aim = np.stack([place, pace, np.zeros(self.dof)])
            courses = plan(Task(now, aim, top, acceleration_limit, jerk_limit), "time")
        else:
            courses = [self._alone_to(i, now) for i in self._joints]
        points: list[Point] = [after(c, self.dt) for c in courses]
        low, high, acceleration, jerk = self._sizes
        for i in self._joints:
            here = (float(now[0, i]), float(now[1, i]), float(now[2, i]))
            other = guarded(here, points[i], low[i], high[i], acceleration[i], jerk[i], self.dt, ROOM)
            points[i] = points[i] if other is None else other
        return [[point[k] for point in points] for k in range(3)]

    def _alone_to(self, i: int, now: Array) -> Course:
        _, a, j = sizes_of(self._limits)
        place, pace, top, by_place = self._aims
        if by_place[i]:
            aim = np.array([[place[i]], [pace[i]], [0.0]])
            return plan(Task(now[:, i : i + 1], aim, top[i : i + 1], a[i : i + 1], j[i : i + 1]), "none")[0]
        # In axes that move with the wanted velocity, taking it is a stop
        p, speed, push = (float(x) for x in now[:, i])
        relative = stop((0.0, speed - float(pace[i]), push), float(a[i]), float(j[i]))
        return Course((p, speed, push), (*relative.spans, self.dt), (*relative.jerks, 0.0))
