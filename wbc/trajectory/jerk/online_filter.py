"""Targets that change at any time, followed in a control loop with bounded velocity, acceleration and jerk."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from wbc import extras, validation
from wbc.errors import BoundsError, RangeError
from wbc.trajectory.jerk.between_states import limits_of, sizes_of
from wbc.trajectory.jerk.braking import after
from wbc.trajectory.jerk.course import Course, Point, stop
from wbc.trajectory.jerk.state_to_state import StateTask, plan
from wbc.trajectory.jerk.walls import Walls
from wbc.trajectory.laws.law import State
from wbc.trajectory.laws.limits import MotionLimits
from wbc.validation import Array

Status = Literal["moving", "reached", "guarded", "recovered"]

_FLOAT = np.dtype(np.float64)
_state_of = tuple.__new__

#: Walls that are farther away than this many seconds are no targets for a velocity: ruckig ends at 7e3 s
FAR = 1e3


def online(
    dof: int | MotionLimits,
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
    before = dof if isinstance(dof, MotionLimits) else MotionLimits()
    count = dof.dof or 0 if isinstance(dof, MotionLimits) else int(validation.scalar("dof", dof, low=1.0))
    limits = _replaced(before, count, (velocity, acceleration, jerk, lower, upper))
    return Online(limits, dt, synchronisation)


def _replaced(before: MotionLimits, dof: int, given: tuple[Any, ...]) -> MotionLimits:
    """Limits with what is given of velocity, acceleration, jerk, lower and upper in place of what was."""
    names = ("velocity", "acceleration", "jerk", "lower", "upper")
    return limits_of(
        dof, *(getattr(before, name) if value is None else value for name, value in zip(names, given, strict=True))
    )


class Online:
    """See :func:`online`. It stands at 0, or at the nearest position within the limits, until :meth:`reset`.

    Targets and limits are checked where they are set: what is refused changes nothing. ``step`` raises nothing.

    Attributes:
        status: what the last tick did: ``moving``; ``reached`` the target; ``guarded``: a joint brakes at a position
            limit instead of following; ``recovered``: ruckig refused, and a course of our own was taken.
        clipped: whether the target was outside the position limits, and the nearest position within them is meant.
    """

    def __init__(self, limits: MotionLimits, dt: float, synchronisation: str) -> None:
        extras.require("laws", "a jerk-limited law", "ruckig")
        import ruckig

        self.dof = len(sizes_of(limits)[0])
        self.dt = dt
        self.status: Status = "reached"
        self.clipped = False
        # A ValueError: its binding does not know the code of the refusal of motions that take longer than 7e3 s
        self._refusals = (ruckig.RuckigError, ValueError)
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
        self._place: list[float] = []
        self._goal: list[float] = []
        self._clear = 0
        self._cuts = slice(0, self.dof), slice(self.dof, 2 * self.dof), slice(2 * self.dof, None)
        self._aims: tuple[Array, Array, Array] = (np.zeros(0), np.zeros(0), np.zeros(0))
        self._plain = False
        self._kind: Literal["position", "velocity"] = "position"
        self._take(limits)
        self.reset(np.clip(np.zeros(self.dof), self._walls.lower, self._walls.upper))

    @property
    def current_limits(self) -> MotionLimits:
        """The limits in force."""
        return self._limits

    def reset(self, position: Any, velocity: Any = None, acceleration: Any = None) -> None:
        """Go on from a state, and stop there until there is a target.

        Raises:
            ShapeError, NotFiniteError: not n finite numbers. BoundsError: a position outside its limits. RangeError: a
                velocity or an acceleration beyond its limit.
        """
        rows = [validation.ordinary_array("position", position, (self.dof,))]
        low, high = self._walls.lower, self._walls.upper
        if ((rows[0] < low) | (rows[0] > high)).any():
            raise BoundsError("position", position, f"expected within {low.tolist()} and {high.tolist()}")
        sizes = sizes_of(self._limits)
        for name, value, limit in (("velocity", velocity, sizes[0]), ("acceleration", acceleration, sizes[1])):
            row = np.zeros(self.dof) if value is None else validation.ordinary_array(name, value, (self.dof,))
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
        place = validation.ordinary_array("target.position", position, (self.dof,))
        speed = None if velocity is None else self._speed("target.velocity", velocity)
        self._kind, self._place, self._pace = "position", place.tolist(), np.zeros(self.dof) if speed is None else speed
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
        sizes = (velocity, acceleration, jerk, lower, upper)
        self._take(_replaced(self._limits, self.dof, sizes))
        self._aim()

    def step(self) -> State:
        """The state one tick later."""
        answer, walls = self._answer, self._walls
        try:
            done = self._ruckig.update(self._asked, answer) is self._done
        except self._refusals:
            p, v, a = self._recovered()
            self.status = "recovered"
            self._put([p, v, a])
            walls.put(p, v, a)
            return self._state()
        p, v, a = answer.new_position, answer.new_velocity, answer.new_acceleration
        walls.put(p, v, a)
        self._clear = self._clear - 1 if self._clear > 1 else walls.clear()
        if not self._clear and walls.guard(self._now(), p, v, a):
            self.status = "guarded"
            self._put([p, v, a])
            walls.put(p, v, a)
            return self._state()
        self.status = "reached" if done else "moving"
        answer.pass_to_input(self._asked)
        return self._state()

    def _state(self) -> State:
        """What was put between the walls; in parts of one new array, the least that arrays can cost."""
        rows = self._walls.state.copy()
        p, v, a = self._cuts
        return _state_of(State, (rows[p], rows[v], rows[a]))

    def _only_place(self, position: Array) -> bool:
        """Take a target at rest after another one: all but the place stays. False for what has to be looked at.

        In lists, which ruckig takes in a tenth of the time of arrays.
        """
        if position.dtype is not _FLOAT or position.shape != self._shape:
            return False
        place: list[float] = position.tolist()
        if not self._walls.contain(place):
            return False
        self.clipped = False
        self._asked.target_position = self._goal = self._place = place
        return True

    def _speed(self, name: str, value: Any) -> Array:
        row = validation.ordinary_array(name, value, (self.dof,))
        limit = sizes_of(self._limits)[0]
        if (np.abs(row) > limit).any():
            raise RangeError(name, value, f"expected at most {limit.tolist()} in size")
        return row

    def _put(self, rows: list[list[float]]) -> None:
        """Make a state the one that the next tick starts from."""
        self._clear = 0
        self._asked.current_position, self._asked.current_velocity, self._asked.current_acceleration = rows

    def _now(self) -> tuple[list[float], list[float], list[float]]:
        """The state that the next tick starts from."""
        asked = self._asked
        return asked.current_position, asked.current_velocity, asked.current_acceleration

    def _take(self, limits: MotionLimits) -> None:
        v, a, j = sizes_of(limits)
        self._limits = limits
        self._asked.max_acceleration, self._asked.max_jerk = a, j
        self._fastest = np.maximum(self._fastest, v)
        self._clear = 0
        self._walls = Walls(limits.lower, limits.upper, self._fastest, a, j, self.dt)

    def _aim(self) -> None:
        """Tell ruckig what is wanted, within the limits."""
        asked, limit = self._asked, sizes_of(self._limits)[0]
        self._plain = self._kind == "position" and not self._pace.any()
        pace = np.clip(self._pace, -limit, limit)
        asked.max_velocity, asked.min_velocity = limit, -limit
        if self._kind == "position":
            goal = self._walls.nearest(self._place)
            self.clipped = goal != self._place
            asked.control_interface, asked.synchronization = self._modes.Position, self._together
            asked.per_dof_control_interface = None
            asked.target_position, asked.target_velocity = goal, pace
            self._goal, self._aims = goal, (pace, limit, np.ones(self.dof, dtype=bool))
            return
        self.clipped = False
        # Towards a wall, a velocity becomes a course to it that is no faster: so the joint comes to rest there in time
        wall = np.where(pace > 0.0, self._walls.upper, self._walls.lower)
        here = np.array(self._asked.current_position)
        to_wall = (pace != 0.0) & np.isfinite(wall)
        to_wall[to_wall] = np.abs(wall - here)[to_wall] < FAR * np.abs(pace)[to_wall]
        place, speed = np.where(to_wall, wall, here), np.where(to_wall, 0.0, pace)
        asked.max_velocity = np.where(to_wall & (pace > 0.0), pace, limit)
        asked.min_velocity = np.where(to_wall & (pace < 0.0), pace, -limit)
        asked.synchronization = self._alone
        asked.per_dof_control_interface = [self._modes.Position if w else self._modes.Velocity for w in to_wall]
        asked.target_position, asked.target_velocity = place, speed
        self._goal, self._aims = place.tolist(), (speed, np.where(to_wall, np.abs(pace), limit), to_wall)

    def _recovered(self) -> list[list[float]]:
        """The next state by courses of our own: to the aims, or where these are velocities, a stop about them."""
        _, acceleration_limit, jerk_limit = sizes_of(self._limits)
        pace, top, _ = self._aims
        now = np.array(self._now())
        if self._kind == "position":
            aim = np.stack([self._goal, pace, np.zeros(self.dof)])
            courses = plan(StateTask(now, aim, top, acceleration_limit, jerk_limit), "time")
        else:
            courses = [self._alone_to(i, now) for i in range(self.dof)]
        points: list[Point] = [after(c, self.dt) for c in courses]
        for i in range(self.dof):
            here = (float(now[0, i]), float(now[1, i]), float(now[2, i]))
            other = self._walls.held_back(i, here, points[i])
            points[i] = points[i] if other is None else other
        return [[point[k] for point in points] for k in range(3)]

    def _alone_to(self, i: int, now: Array) -> Course:
        _, a, j = sizes_of(self._limits)
        place = self._goal
        pace, top, by_place = self._aims
        if by_place[i]:
            aim = np.array([[place[i]], [pace[i]], [0.0]])
            return plan(StateTask(now[:, i : i + 1], aim, top[i : i + 1], a[i : i + 1], j[i : i + 1]), "none")[0]
        # In axes that move with the wanted velocity, taking it is a stop
        p, speed, push = (float(x) for x in now[:, i])
        relative = stop((0.0, speed - float(pace[i]), push), float(a[i]), float(j[i]))
        return Course((p, speed, push), (*relative.spans, self.dt), (*relative.jerks, 0.0))
