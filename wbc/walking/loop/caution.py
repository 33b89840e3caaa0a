"""Nothing is begun that is not proven clear: a swing before its hand is lifted, the body's way some tenths ahead."""

from __future__ import annotations

from collections.abc import Callable
from math import dist, inf
from typing import NamedTuple

import numpy as np

from wbc.clearance import Nearest
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.loop.body_command import wanted_pace
from wbc.walking.loop.foresight import STEP, Foresight, Timing
from wbc.walking.loop.hand_pace import ramp_of
from wbc.walking.loop.machine import Machine
from wbc.walking.loop.progress import PlanProgress
from wbc.walking.loop.state import Swinging
from wbc.walking.loop.stopping import Stops
from wbc.walking.planner.swings.swings import SETTLE

#: A swing is proven again where the body or a point of the arm is farther than this from where it was foreseen [m],
#: which is looked at every so many ticks; a turn of the body counts as if it were about a point this far away [m]
STRAY, EVERY, ARM = 0.002, 10, 1.3
#: Path time that the body's way is proven ahead, and what is left of it when it is looked at again [s]
AHEAD, LEFT = 1.0, 0.4
#: Part of their rates that joints get of a hand that has to go slower, and the least part of its pace; what an arm is
#: off its way does not count any more after [s]
RATE, SLOWEST, SETTLED = 0.96, 0.3, 0.3


class Course(NamedTuple):
    """How body and swinging hand are about to go on.

    Attributes:
        pace: of the body now. end: path time that it does not pass before the hand holds [s]. holds: at which the grips
            of the other hands end, and last: at which the path does, or what may be gone of it [s].
        due: path time at which the hand is to be on its hold [s]. stands: the body comes to rest.
        most: pace that the path allows at a path time [s].
        lifts: path time at which the hand is lifted [s], or where the body comes to rest before; until then it holds.
    """

    pace: float
    end: float
    holds: float
    last: float
    due: float
    stands: bool
    most: Callable[[float], float]
    lifts: float = -inf


class Caution:
    """What of a walk is proven.

    Attributes:
        until: path time up to which the body may go with the hands that hold now [s].
    """

    def __init__(self, sight: Foresight, machine: Machine, progress: PlanProgress, stops: Stops) -> None:
        self.sight, self._machine, self._progress, self._stops = sight, machine, progress, stops
        self.until = 0.0
        self._known: tuple[object, ...] = ()
        # When the swing was proven, times since then, and where the body and the points of the arm are then
        self._foreseen: tuple[float, Array, Array] | None = None
        self._clock: Array = np.zeros(0)

    def forget(self) -> None:
        """Nothing is proven any more."""
        self._known, self.until = (), self._progress.path_time

    def new(self, swinging: Swinging | None, stands: bool, end: float = inf) -> bool:
        """Whether what body and hand do has changed since it was proven.

        Args:
            end: path time that the body does not pass before the swinging hand holds [s].
        """
        return self._known != (self._progress.plan.path, swinging, stands, end)

    def ahead(self, end: float, lift: float | None = None) -> Nearest | None:
        """Prove the body's way on, all hands as they hold, if little of it is left; what is too near on it.

        Args:
            end: path time to which they can hold [s]. lift: where the next hand is lifted, whose swing is proven then;
                None: none is.
        """
        progress = self._progress
        path, u = progress.plan.path, progress.path_time
        if self.new(None, False) or (lift is None and self.until == inf):
            self._known, self.until = (path, None, False, inf), u
        if self.until - u > LEFT or self.until >= end - 1e-9:
            return None
        end = min(u + AHEAD, end)
        lifts = lift is not None and lift <= end
        end = end if lift is None else max(min(end, lift), u)
        times = np.linspace(0.0, max(end - u, STEP), max(int((end - u) / STEP), 1) + 1)
        when = Timing(times, np.minimum(u + times, end), times)
        found = self._near(None, when)
        if found is None:
            self.until = inf if lifts else end
        return found

    def here(self) -> Nearest | None:
        """What is too near where everything is now."""
        times = np.array([0.0, STEP])
        return self._near(None, Timing(times, np.full(2, self._progress.path_time), times))

    def swing(self, swinging: Swinging, course: Course) -> Nearest | None:
        """What is too near while a hand goes on to its hold and the body as its pace has it; None: proven clear."""
        found, when = self._looked(swinging, course)
        if found is None:
            self._known = self._progress.plan.path, swinging, course.stands, course.end
            self.until = self._progress.path_time
            self._clock = when.clock
            self._foreseen = self._machine.time, when.times, self._places(swinging.arm, self._rows)
        return found

    def looked(self, swinging: Swinging, course: Course) -> Nearest | None:
        """As :meth:`swing`, of a hand that is lifted later; what is proven stays as it is."""
        return self._looked(swinging, course)[0]

    def _looked(self, swinging: Swinging, course: Course) -> tuple[Nearest | None, Timing]:
        """What is too near, and the motion that was foreseen.

        A hand goes slower from now on whose joints would need higher rates than they have: it would lag, and swing
        beyond its way when it catches up. So does one whose joints would need higher accelerations, where the body
        stands, or goes elsewhere, that was to go with it, and where its arm has no room to lag.
        """
        when = self.timing(swinging, course)
        found = self._near(swinging, when)
        rate, root = self._needs(swinging, when.times)
        path, led, *_ = self._known or (None, None)
        changed = course.stands or (led is swinging and path is not self._progress.plan.path)
        fastest = max(rate, root)
        rushed = rate > 1.0 or (root > 1.0 and (changed or self._near_by(swinging, when)))
        if rushed and swinging.part > SLOWEST:
            swinging.part = max(swinging.part * RATE / fastest, SLOWEST)
            when = self.timing(swinging, course)
            found = self._near(swinging, when)
        return found, when

    def _near_by(self, swinging: Swinging, when: Timing) -> bool:
        """Whether an arm that lags in what was foreseen last may touch something."""
        return self.sight.close(when.times, self._rows, swinging.arm)

    def _needs(self, swinging: Swinging, times: Array) -> tuple[float, float]:
        """How many times too fast the swinging arm is in what was foreseen last, once it is back on its way: the
        greatest of its joints' rates, and of the roots of the accelerations of those that lead the hand's place, in
        parts of their limits.
        """
        walker = self._machine.walker
        arm, limits, leading = walker.arms[swinging.arm], walker.robot.limits, limb_of(walker).guided
        since = min(int(np.searchsorted(times, SETTLED)), len(times) - 2)
        steps = np.diff(times[since:])[:, None]
        rates = np.diff(self._rows[since:, arm.q], axis=0) / steps
        changes = np.diff(rates, axis=0) / (0.5 * (steps[1:] + steps[:-1]))
        fastest, hardest = np.abs(rates) / limits.velocity[arm.v], np.abs(changes) / limits.acceleration[arm.v]
        return float(fastest.max()), float(np.sqrt(hardest[:, :leading].max(initial=0.0)))

    def strays(self, swinging: Swinging) -> bool:
        """Whether body and arm are elsewhere than they were foreseen, as far as that is looked at now.

        Near the axis of joint 1 a hand hardly moves with that joint, the elbow does: all points of the arm count.
        """
        if self._foreseen is None:
            return False
        machine, (begin, times, places) = self._machine, self._foreseen
        since = machine.time - begin
        if round(since / machine.dt) % EVERY:
            return False
        if swinging.state == "open":
            # A hand that waits is where it was to be a little ago, and the body with it
            since = float(np.interp(swinging.clock, self._clock, times))
        row = min(int(np.searchsorted(times, since, side="right")) - 1, len(times) - 2)
        part = min((since - times[row]) / (times[row + 1] - times[row]), 1.0)
        there = places[row] + part * (places[row + 1] - places[row])
        here = self._places(swinging.arm, machine.q[None])[0]
        # The sine of half the angle between two unit quaternions
        turned = min(dist(here[3:7], there[3:7]), dist(here[3:7], -there[3:7]))
        arm = np.linalg.norm((here[7:] - there[7:]).reshape(-1, 3), axis=1).max()
        return dist(here[:3], there[:3]) + 2.0 * ARM * turned + float(arm) > STRAY

    def _places(self, arm: int, q: Array) -> Array:
        """The body's pose and the points of an arm in its frame, in configurations ``[k, nq]``, as rows of numbers."""
        points = limb_of(self._machine.walker).points(q[:, self._machine.walker.arms[arm].q])
        return np.concatenate([q[:, :7], points.reshape(len(q), -1)], axis=1)

    def timing(self, swinging: Swinging, course: Course) -> Timing:
        """Body and hand with the paces of the loop, until the hand holds."""
        law, latch = swinging.law, swinging.latch if swinging.state == "opening" else 0.0
        end = max(course.end, self._progress.path_time)
        u, clock, pace, hand, t = self._progress.path_time, swinging.clock, course.pace, swinging.pace, 0.0
        closing = self._machine.walker.arm_data.latch_time + SETTLE
        rows, most, ramp = [(0.0, u, clock)], swinging.most, ramp_of(swinging)
        while clock < law.duration - 1e-9 or latch > 1e-9 or (course.stands and pace > 0.0):
            left = law.duration - clock
            needed, until = latch + left / most + closing, end - u
            left_on = max(course.holds - u, 0.0), max(course.last - u, 0.0), (until, needed)
            wanted = 0.0 if course.stands else wanted_pace(self._stops, *left_on, course.most(u))
            pace = max(pace + min(max(wanted - pace, -STEP / self._stops.brake), STEP / self._stops.ramp), 0.0)
            wait = course.due - u - wanted * left / most
            aim = min(1.0 / (1.0 + 4.0 * wait) if wait > 0.0 else 1.0, most)
            holds = u < course.lifts - 1e-9 and pace > 0.0
            u, t = min(u + pace * STEP, end), t + STEP
            if not holds and latch > 1e-9:
                latch -= STEP
            elif not holds:
                hand += min(max(aim - hand, -STEP / ramp), STEP / ramp)
                clock = min(clock + hand * STEP, law.duration)
            rows.append((t, u, clock))
            if len(rows) > 4 * (law.duration + 2.0) / STEP:
                break
        rows.append((t + closing, u if course.stands else min(u + pace * closing, end), clock))
        return Timing(*np.array(rows).T)

    def _near(self, swinging: Swinging | None, when: Timing) -> Nearest | None:
        machine, progress = self._machine, self._progress
        rows = self._rows = self.sight.rows(machine, progress, swinging, when)
        held = dict(machine.held)
        left, to = list[tuple[int, Array]](), list[tuple[int, Array]]()
        for arm in set(range(len(machine.walker.arms))) - set(machine.held):
            left += self.sight.around(arm, machine.hand(arm)[0])
        if swinging is not None:
            # It is on the hold that it is about to leave
            left += self.sight.holds({swinging.arm: held.pop(swinging.arm, -1)})
            to = self.sight.holds({swinging.arm: swinging.hold})
        return self.sight.nearest(when.times, rows, left, to, held)
