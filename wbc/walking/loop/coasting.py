"""A walk that begins while everything moves: body and free hands come to rest before anything else is done."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.robots import Walker
from wbc.rotations import quaternion
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.loop.body_command import BodyCommand
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.state import State

#: Part of the joints' accelerations with which free arms come to rest
PART = 0.8
#: Slower than this is at rest [m/s, rad/s]
REST = 1e-9


class Coasting:
    """All velocities fall evenly to nothing in a time T: with the velocities v of the state,

        v(t) = v (1 - t / T),     q(t) = q (+) v (t - t^2 / (2 T)),     T = max(brake, |qd_i| / (PART a_i))

    of the body, and of the joints i of free arms, whose accelerations are a_i. Hands that hold stay on their holds; a
    hand that opens stays where it is.

    Args:
        state: with velocities. brake: least T [s]. dt: control period [s].

    Attributes:
        free: rows of the arms in the air. duration: T [s]. end: where the body is then.
    """

    def __init__(self, walker: Walker, state: State, brake: float, dt: float) -> None:
        assert state.v is not None
        opening = -1 if state.opening is None else state.opening[0]
        self._dt, self._time = dt, 0.0
        self.free = [arm for arm in range(len(walker.arms)) if arm not in state.held and arm != opening]
        joints = [walker.arms[arm] for arm in self.free]
        self._begin, self._rates = [state.q[arm.q] for arm in joints], [state.v[arm.v] for arm in joints]
        most = [np.abs(state.v[arm.v]) / (PART * walker.robot.limits.acceleration[arm.v]) for arm in joints]
        self.duration = max([brake, *(float(times.max()) for times in most)])
        here = pin.SE3(pin.Quaternion(state.q[3:7]).matrix(), state.q[:3].copy())
        twist = pin.Motion(0.5 * self.duration * state.v[:6])
        self.end = here * pin.exp6(twist)
        self._path = BodyPath(np.array([here.homogeneous, self.end.homogeneous]), 0.5 * self.duration)
        self._command = BodyCommand(dt)

    @classmethod
    def of(cls, walker: Walker, state: State, brake: float, dt: float) -> Coasting | None:
        """None where nothing moves."""
        moves = state.v is not None and float(np.abs(state.v).max()) > REST
        return cls(walker, state, brake, dt) if moves else None

    @property
    def over(self) -> bool:
        """Everything is at rest."""
        return self._time >= self.duration - 1e-9

    @property
    def pose(self) -> Array:
        """Of the body as the tick ends: position [m] and quaternion x, y, z, w."""
        return self._command.pose

    def state(self, state: State) -> State:
        """As it is at rest, to first order in the motion of the holding arms, at the time [s] that it has then."""
        assert state.v is not None
        q = state.q.copy()
        q[7:] += 0.5 * self.duration * state.v[6:]
        q[:3], q[3:7] = self.end.translation, quaternion(self.end.rotation)
        return State(q, state.held, state.time + self.duration, None)

    def go(self, stack: WalkStack) -> None:
        """What the stack follows in the next tick."""
        now, self._time = self._time, min(self._time + self._dt, self.duration)
        done, then = (t - t * t / (2.0 * self.duration) for t in (now, self._time))
        stack.body(self._command.go(self._path, done, then))
        for arm, begin, rates in zip(self.free, self._begin, self._rates, strict=True):
            stack.joints(arm, begin + done * rates, (then - done) / self._dt * rates)
