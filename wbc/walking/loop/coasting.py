"""A walk that begins while everything moves: body and free hands come to rest before anything else is done."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.robots import Walker
from wbc.rotations import quaternion
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.body_command import BodyCommand
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.state import State

#: Part of the joints' accelerations with which arms come to rest: where their joints fall evenly, and at most
PART, MOST = 0.8, 0.95
#: Slower than this is at rest [m/s, rad/s]
REST = 1e-9
#: Times of a stop that are tried, each so many times the one before
LONGER, TRIES = 1.3, 15
#: A hand that would stop at the end of its reach stops so much nearer to the body instead [m]
NEARER = (0.0, 0.01, 0.02, 0.05, 0.1)
#: A hand that is so far aside of a hold's axis is not about to lift off or to come down there [m]
ASIDE = 0.03
#: Of differences in time [s]
STEP = 1e-6
#: A posture computed anew from where its hand is differs by less than this [rad], or it is of another branch
SAME = 1e-6


class Coasting:
    """All velocities fall evenly to nothing: the body's in T, with its velocity v,

        M(t) = M exp(v f(t)),     f(t) = t - t^2 / (2 T) up to T,     T = brake

    A free hand p comes to rest in the structure, with a T of its own, the least that its joints' accelerations a_i
    allow: with s = t / T and its velocity p', along

        p(t) = p + p' T s (1 - s)^2 + (e - p) s^2 (3 - 2 s)

    The end e is p + p' T / 2, straight on, or as much nearer to the body as its arm needs. Near a hold it is over that
    instead, and not under it: there a hand lifts off or comes down, and nowhere else may it be so near to what the hold
    is mounted on. Where its arm cannot follow that, its joints fall evenly in max |qd_i| / (PART a_i). Hands that hold
    stay on their holds.

    Args:
        structure: whose holds are there. state: with velocities. brake: T of the body [s]. dt: control period [s].

    Attributes:
        free: rows of the arms that hold nothing. over: of those that stop over a hold, and of that. duration: of the
            longest [s]. end: where the body is then.
    """

    def __init__(self, walker: Walker, structure: Structure, state: State, brake: float, dt: float) -> None:
        assert state.v is not None
        self._structure, self._dt, self._time, self._brake = structure, dt, 0.0, brake
        here = pin.SE3(pin.Quaternion(state.q[3:7]).matrix(), state.q[:3].copy())
        self.end = here * pin.exp6(pin.Motion(0.5 * brake * state.v[:6]))
        self._path = BodyPath(np.array([here.homogeneous, self.end.homogeneous]), 0.5 * brake)
        self._command = BodyCommand(dt)
        self.free = [arm for arm in range(len(walker.arms)) if arm not in state.held]
        self.over = dict[int, int]()
        self._joints = [arm.q for arm in walker.arms]
        self._postures = [self._stop(walker, state, arm) for arm in self.free]
        self.duration = max([brake, *((len(rows) - 1) * dt for rows in self._postures)])

    @classmethod
    def of(cls, walker: Walker, structure: Structure, state: State, brake: float, dt: float) -> Coasting | None:
        """None where nothing moves."""
        moves = state.v is not None and float(np.abs(state.v).max()) > REST
        return cls(walker, structure, state, brake, dt) if moves else None

    @property
    def done(self) -> bool:
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
        q[7:] += 0.5 * self._brake * state.v[6:]
        for arm, rows in zip(self.free, self._postures, strict=True):
            q[self._joints[arm]] = rows[-1]
        q[:3], q[3:7] = self.end.translation, quaternion(self.end.rotation)
        return State(q, state.held, state.time + self.duration, None)

    def go(self, stack: WalkStack) -> None:
        """What the stack follows in the next tick."""
        now, self._time = self._time, min(self._time + self._dt, self.duration)
        before, after = fallen(np.array([now, self._time]), self._brake)
        stack.body(self._command.go(self._path, float(before), float(after)))
        row = round(now / self._dt)
        for arm, rows in zip(self.free, self._postures, strict=True):
            here, then = (rows[min(k, len(rows) - 1)] for k in (row, row + 1))
            stack.joints(arm, here, (then - here) / self._dt)

    def _stop(self, walker: Walker, state: State, arm: int) -> Array:
        """Postures of a free arm, tick by tick until it is at rest ``[ticks + 1, joints]`` [rad]."""
        assert state.v is not None
        mine, limits, dt = walker.arms[arm], walker.robot.limits, self._dt
        q, rates, most = state.q[mine.q], state.v[mine.v], limits.acceleration[mine.v]
        least = max(float((np.abs(rates) / (PART * most)).max()), dt)
        for k in range(TRIES):
            stop = dt * float(np.ceil(least * LONGER**k / dt))
            rows = self._straight(walker, state, arm, stop)
            if rows is None:
                break
            changes = np.diff(np.concatenate([rates[None], np.diff(rows, axis=0) / dt, np.zeros((1, len(q)))]), axis=0)
            within = (rows >= limits.position_lower[mine.v]) & (rows <= limits.position_upper[mine.v])
            if within.all() and (np.abs(changes) <= MOST * dt * most).all():
                return rows
        times = dt * np.arange(np.ceil(least / dt) + 1)
        return np.asarray(q + fallen(times, float(times[-1]))[:, None] * rates)

    def _straight(self, walker: Walker, state: State, arm: int, stop: float) -> Array | None:
        """Postures, tick by tick until body and arm are at rest, of an arm whose hand stops in the structure within a
        time [s] and whose wrist falls evenly; None: it is of a branch in which no hand swings.
        """
        assert state.v is not None
        mine, limb = walker.arms[arm], limb_of(walker)
        times = self._dt * np.arange(np.ceil(max(stop, self._brake) / self._dt - 1e-9) + 1)
        q, rates, twist = state.q[mine.q], state.v[mine.v], state.v[:6]
        base, here = mine.base, self._path.at(0.0)[0]
        small = np.array([0.0, -STEP, STEP])[:, None] * rates
        hand, before, after = np.asarray(limb.points(q + small))[:, -1] @ base.rotation.T + base.translation
        speed = here.rotation @ (twist[:3] + np.cross(twist[3:], hand) + (after - before) / (2.0 * STEP))
        done, place, part = fallen(times, stop)[:, None], here.act(hand), np.minimum(times / stop, 1.0)[:, None]
        straight = self._over_hold(walker, arm, place + 0.5 * stop * speed)
        bodies = [self._path.at(float(t))[0] for t in fallen(times, self._brake)]
        frames = np.array([(body * base).homogeneous for body in bodies])
        guide, rows = (q + done * rates)[:, limb.guided :], q[None]
        for nearer in NEARER:
            end = straight - nearer * here.rotation[:, 2]
            places = place + stop * part * (1.0 - part) ** 2 * speed + part**2 * (3.0 - 2.0 * part) * (end - place)
            rows = limb.follow(frames[None], places[None], guide[None], walker.margins)[0][0]
            if float(limb.margins(rows[-1]).min()) >= walker.margins.held_angle:
                break
        return rows if np.abs(rows[0] - q).max() < SAME else None

    def _over_hold(self, walker: Walker, arm: int, point: Array) -> Array:
        """A point at which a hand is to stop, or that on the axis of the hold that it is near to."""
        offsets = point - self._structure.positions
        gaps = np.linalg.norm(offsets, axis=1)
        hold = int(gaps.argmin())
        if gaps[hold] > walker.tolerances.exempt_distance:
            return point
        axis = self._structure.axes[hold]
        height = float(-axis @ offsets[hold])
        if gaps[hold] ** 2 - height**2 > ASIDE**2:
            return point
        self.over[arm] = hold
        return np.asarray(self._structure.positions[hold] - max(height, 0.0) * axis)


def fallen(times: Array, stop: float) -> Array:
    """f at times, of what is at rest at ``stop`` [s]."""
    t = np.minimum(times, stop)
    return np.asarray(t - t * t / (2.0 * stop))
