"""A walk that begins while everything moves: body and free hands come to rest before anything else is done."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.rotations import quaternion
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.body_command import BodyCommand
from wbc.walking.loop.closed_chain import ClosedChain
from wbc.walking.loop.foresight import Foresight
from wbc.walking.loop.rest import fallen, kept, quickest
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
#: What else is worth being nearer to the body [rad]
BETTER = 1e-3
#: Part of accelerations with which joints go as fast as they can, and how far at most [rad]
HARD, FAR = 0.94, 0.5
#: Of differences in time [s]
STEP = 1e-6
#: A posture computed anew from where its hand is differs by less than this [rad], or it is of another branch
SAME = 1e-6
#: Times in which the body may stop, each so many times the one before, down to where it brakes by this
#: [m/s^2, rad/s^2]: half of what a checker allows from tick to tick
SHORTER, HARDEST = 0.8, 1.0
#: A hand that stops over a hold comes no deeper into what that is on, or as much deeper than it is [m]
DEEPEST, DEEPER = 0.0047, 0.0002


class Coasting:
    """All velocities fall evenly to nothing: the body's in T, with its velocity v,

        M(t) = M exp(v f(t)),     f(t) = t - t^2 / (2 T) up to T,     T = brake

    or less, where an arm that holds would be pulled straight by then, or need more than its joints' accelerations.
    A free hand p comes to rest in the structure, with a T of its own, the least that its joints' accelerations a_i
    allow: with s = t / T and its velocity p', along

        p(t) = p + p' T s (1 - s)^2 + (e - p) s^2 (3 - 2 s)

    The end e is p + p' T / 2, straight on, or as much nearer to the body as its arm needs. Near a hold it is over that
    instead, and not under it: there a hand lifts off or comes down, and nowhere else may it be so near to what the hold
    is mounted on. Where its arm cannot follow that, or would come too deep, each joint goes to where such an end has it
    as fast as its acceleration allows; where that is no better, joints fall evenly in max |qd_i| / (PART a_i). Hands
    that hold stay on their holds.

    Args:
        structure: whose holds are there. state: with velocities. brake: T of the body [s]. dt: control period [s].
        sight: what proves stops clear; None: nothing does.

    Attributes:
        pulled: rows of the arms that hold and cannot while the body comes to rest: they would be pulled straight.
        free: rows of the arms that hold nothing. over: of those that stop over a hold, and of that. duration: of the
            longest [s]. end: where the body is then.
    """

    def __init__(
        self,
        walker: Walker,
        structure: Structure,
        state: State,
        brake: float,
        dt: float,
        sight: Foresight | None = None,
    ) -> None:
        assert state.v is not None
        self._structure, self._dt, self._time, self._sight = structure, dt, 0.0, sight
        here = pin.SE3(pin.Quaternion(state.q[3:7]).matrix(), state.q[:3].copy())
        self._held, self.pulled = dict[int, Array](), list[int]()
        self._brake = brake = self._stop_of_body(walker, state, here, brake)
        self.end = here * pin.exp6(pin.Motion(0.5 * brake * state.v[:6]))
        self._path = BodyPath(np.array([here.homogeneous, self.end.homogeneous]), 0.5 * brake)
        self._command = BodyCommand(dt)
        self.free = [arm for arm in range(len(walker.arms)) if arm not in state.held]
        self.over = dict[int, int]()
        self._joints = [arm.q for arm in walker.arms]
        self._postures = list[Array]()
        for arm in self.free:
            self._postures.append(self._stop(walker, state, arm))
        self.duration = max([brake, *((len(rows) - 1) * dt for rows in self._postures)])

    @classmethod
    def of(
        cls,
        walker: Walker,
        structure: Structure,
        state: State,
        brake: float,
        dt: float,
        sight: Foresight | None = None,
    ) -> Coasting | None:
        """None where nothing moves."""
        moves = state.v is not None and float(np.abs(state.v).max()) > REST
        return cls(walker, structure, state, brake, dt, sight) if moves else None

    @property
    def done(self) -> bool:
        """Everything is at rest."""
        return self._time >= self.duration - 1e-9

    @property
    def pose(self) -> Array:
        """Of the body as the tick ends: position [m] and quaternion x, y, z, w."""
        return self._command.pose

    def state(self, state: State) -> State:
        """As it is at rest, at the time [s] that it has then; holding arms whose motion is not known to first order."""
        assert state.v is not None
        q = state.q.copy()
        q[7:] += 0.5 * self._brake * state.v[6:]
        for arm, held in self._held.items():
            q[self._joints[arm]][:-1] = held[-1]
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

    def _stop_of_body(self, walker: Walker, state: State, here: pin.SE3, brake: float) -> float:
        """Time in which the body comes to rest [s], see the class; as given where no other is better."""
        assert state.v is not None
        chain, twist = ClosedChain(walker, self._structure), state.v[:6]
        chain.place(state.q)
        fast, stop = max(float(np.linalg.norm(twist[:3])), float(np.linalg.norm(twist[3:]))), brake
        tried = list[tuple[float, float, dict[int, Array]]]()
        while not tried or (tried[-1][0] > MOST and stop * HARDEST >= fast):
            times = self._dt * np.arange(np.ceil(stop / self._dt - 1e-9) + 1)
            bodies = [here * pin.exp6(pin.Motion(float(t) * twist)) for t in fallen(times, stop)]
            found, needs = dict[int, Array](), dict[int, float]()
            for arm in state.held:
                mine = walker.arms[arm]
                frames = np.array([(body * mine.base).homogeneous for body in bodies])
                rows = kept(limb_of(walker), frames, state.q[mine.q], chain.origins[arm], chain.axes[arm])
                needs[arm] = np.inf
                if rows is not None:
                    # The last joint turns the hand about itself
                    most = walker.robot.limits.acceleration[mine.v][:-1]
                    found[arm], needs[arm] = rows[:, :-1], self._needs(state.v[mine.v][:-1], rows[:, :-1], most)
            if not tried:
                self.pulled = [arm for arm, need in needs.items() if need > 1.0]
            tried.append((max(needs.values(), default=0.0), stop, found))
            stop *= SHORTER
        least, chosen, self._held = min(tried, key=lambda one: one[0])
        if least > 1.0:
            # None is better
            _, chosen, self._held = tried[0]
        else:
            self.pulled = []
        return chosen

    def _needs(self, rates: Array, rows: Array, most: Array) -> float:
        """The greatest acceleration of joints that have rates [rad/s] and then are at rows, tick by tick, in parts of
        the most.
        """
        rest = np.zeros((1, len(rates)))
        steps = np.diff(np.concatenate([rates[None], np.diff(rows, axis=0) / self._dt, rest]), axis=0)
        return float((np.abs(steps) / (self._dt * most)).max())

    def _stop(self, walker: Walker, state: State, arm: int) -> Array:
        """Postures of a free arm, tick by tick until it is at rest ``[ticks + 1, joints]`` [rad]: the first of its
        stops that is clear of everything; where none is proven to be, the first that is possible.
        """
        assert state.v is not None
        first: Array | None = None
        for rows in self._stops(walker, state, arm):
            if self._clear(walker, state, arm, rows):
                return rows
            first = rows if first is None else first
        assert first is not None
        return first

    def _stops(self, walker: Walker, state: State, arm: int) -> Iterator[Array]:
        """Postures in which a free arm comes to rest, the best first; the last ones may be beyond what it can."""
        assert state.v is not None
        mine, limits, dt = walker.arms[arm], walker.robot.limits, self._dt
        q, rates, most = state.q[mine.q], state.v[mine.v], limits.acceleration[mine.v]
        least = max(float((np.abs(rates) / (PART * most)).max()), dt)
        for k in range(TRIES):
            rows = self._straight(walker, state, arm, dt * float(np.ceil(least * LONGER**k / dt)))
            if rows is None:
                break
            if self._may(walker, arm, rows, rates):
                yield rows
        quick = list[tuple[float, Array]]()
        for nearer in NEARER:
            rows = self._quickly(walker, state, arm, nearer)
            if rows is not None and self._may(walker, arm, rows, rates):
                left = float(limb_of(walker).margins(rows[-1]).min())
                quick.append((round(min(left, walker.margins.held_angle) / BETTER), rows))
        yield from (rows for _, rows in sorted(quick, key=lambda one: -one[0]))
        times = dt * np.arange(np.ceil(least / dt) + 1)
        evenly = np.asarray(q + fallen(times, float(times[-1]))[:, None] * rates)
        hard = HARD * most
        shortest = quickest(q, rates, q + rates * np.abs(rates) / (2.0 * hard), hard, dt)
        last = [evenly, shortest]
        yield from (rows for rows in last if self._may(walker, arm, rows, rates))
        yield evenly

    def _clear(self, walker: Walker, state: State, arm: int, rows: Array) -> bool:
        """Whether a free arm that comes to rest so is proven clear, together with those before it."""
        if self._sight is None or state.v is None:
            return True
        postures = {**dict(zip(self.free, self._postures, strict=False)), arm: rows}
        count = max(round(self._brake / self._dt) + 1, *(len(one) for one in postures.values()))
        times = self._times(count)
        q = np.repeat(state.q[None], count, axis=0)
        q[:, 7:] += fallen(times, self._brake)[:, None] * state.v[6:]
        q[:, :7] = [pin.SE3ToXYZQUAT(body) for body in self._bodies(times)]
        for one, held in self._held.items():
            columns = range(self._joints[one].start, self._joints[one].stop - 1)
            q[:, columns] = held[np.minimum(np.arange(count), len(held) - 1)]
        for one, there in postures.items():
            q[:, self._joints[one]] = there[np.minimum(np.arange(count), len(there) - 1)]
        left, to = list[tuple[int, Array]](), list[tuple[int, Array]]()
        for one in self.free:
            left += self._sight.around(one, self._sight.hand(one, q[:1])[0])
            if one in self.over:
                to.append((one, self._structure.positions[self.over[one]]))
        return self._sight.nearest(times, q, left, to, state.held) is None

    def _bodies(self, times: Array) -> list[pin.SE3]:
        """Where the body is at times [s]."""
        return [self._path.at(float(t))[0] for t in fallen(times, self._brake)]

    def _times(self, count: int) -> Array:
        """Of ticks from the first on [s]."""
        return self._dt * np.arange(count, dtype=np.float64)

    def _may(self, walker: Walker, arm: int, rows: Array, rates: Array) -> bool:
        """Whether a free arm may come to rest so: within its limits, never straight, and its hand not too deep."""
        mine, limits, limb = walker.arms[arm], walker.robot.limits, limb_of(walker)
        within = (rows >= limits.position_lower[mine.v]) & (rows <= limits.position_upper[mine.v])
        if not within.all() or self._needs(rates, rows, limits.acceleration[mine.v]) > MOST:
            return False
        bend = limb.elbow_bend(rows)
        if bend[0] > 0.0 and bend.min() <= 0.0:
            return False
        if arm not in self.over:
            return True
        hands, bodies = np.asarray(limb.points(rows))[:, -1], self._bodies(self._times(len(rows)))
        places = [(body * mine.base).act(hand) for body, hand in zip(bodies, hands, strict=True)]
        hold = self.over[arm]
        heights = (self._structure.positions[hold] - np.array(places)) @ self._structure.axes[hold]
        return bool(heights.min() >= min(heights[0] - DEEPER, -DEEPEST))

    def _quickly(self, walker: Walker, state: State, arm: int, nearer: float) -> Array | None:
        """Postures in which each joint goes to where the hand is over its hold, or nearer to the body [m], as fast as
        it can; None where that is of another branch.
        """
        assert state.v is not None
        mine, limb, here = walker.arms[arm], limb_of(walker), self._path.at(0.0)[0]
        q, rates, most = state.q[mine.q], state.v[mine.v], HARD * walker.robot.limits.acceleration[mine.v]
        end = q + rates * np.abs(rates) / (2.0 * most)
        place = (here * mine.base).act(np.asarray(limb.points(q[None]))[0, -1])
        place = self._over_hold(walker, arm, place) - nearer * here.rotation[:, 2]
        frame = (self.end * mine.base).homogeneous
        found = limb.follow(frame[None, None], place[None, None], end[None, None, limb.guided :], walker.margins)[0][
            0, 0
        ]
        if np.abs(found - q).max() > FAR:
            return None
        return quickest(q, rates, found, most, self._dt, self._brake)

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
        frames = np.array([(body * base).homogeneous for body in self._bodies(times)])
        guide, rows = (q + done * rates)[:, limb.guided :], q[None]
        most = -np.inf
        for nearer in NEARER:
            end = straight - nearer * here.rotation[:, 2]
            places = place + stop * part * (1.0 - part) ** 2 * speed + part**2 * (3.0 - 2.0 * part) * (end - place)
            found = limb.follow(frames[None], places[None], guide[None], walker.margins)[0][0]
            left = min(float(limb.margins(found[-1]).min()), walker.margins.held_angle)
            # What another joint leaves is not more where the elbow is bent more
            if left > most + BETTER:
                rows, most = found, left
            if most >= walker.margins.held_angle:
                break
        return rows if np.abs(rows[0] - q).max() < SAME else None

    def _over_hold(self, walker: Walker, arm: int, point: Array) -> Array:
        """A point at which a hand is to stop, or that on the axis of the hold that it is near to."""
        offsets = point - self._structure.positions
        gaps = np.linalg.norm(offsets, axis=1)
        hold = int(gaps.argmin())
        if gaps[hold] > walker.arm_data.exempt_distance:
            return point
        axis = self._structure.axes[hold]
        height = float(-axis @ offsets[hold])
        if gaps[hold] ** 2 - height**2 > ASIDE**2:
            return point
        self.over[arm] = hold
        return np.asarray(self._structure.positions[hold] - max(height, 0.0) * axis)
