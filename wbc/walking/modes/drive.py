"""Velocity mode: the body moves as commanded, and hands are planned over the seconds ahead, again and again."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import numpy as np

from wbc import validation
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import SPACING, TURN_RADIUS, BodyPath, standing_path
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.state import Swinging, Tick
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.courses import Course, bent, course, course_slices, time_left
from wbc.walking.modes.steering import PARTS, Steering, displaced, displacement, towards, undisplaced
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.planner import plan_walk

#: Path time over which hands are planned, which is left when it is planned on, and after which another command takes
#: hold; a course that the present swing does not allow waits for it [s]
HORIZON, LEFT, LEAD, AHEAD = 8.0, 6.0, 0.1, 1.0
#: Slices of planning between two ticks
SLICES = 2
#: What is tried in turn where hands cannot be planned over the horizon: parts of the commanded rates, and how much
#: the body is lower and aside, in its data's ``body_shift``, and tilted about its direction and across it, in its
#: ``body_tilt``
ALTERNATIVES = (
    *((part, (0.0, 0.0, 0.0, 0.0)) for part in (1.0, 0.7, 0.45)),
    *((0.7, (low, side, 0.0, 0.0)) for low, side in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))),
    *((0.7, (0.0, 0.0, roll, pitch)) for roll, pitch in ((0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0))),
    *((0.25, (low, 0.0, 0.0, 0.0)) for low in (0.0, 1.0)),
)
#: A body that waits for a hand goes on so much later [s]
SURE = 0.15
#: Rates below these are none [m/s, m/s, rad/s]
STILL = np.array([1e-4, 1e-4, 1e-4])
#: A body that begins to be driven could go so far in every direction without moving a hand [m]
ROUNDABOUT = 0.12


class Drive:
    """A walk by commanded rates: of the body's origin round and along the structure, and of turning about its normal.

    Every command is answered by planning :data:`HORIZON` seconds ahead, in slices between ticks, while the body goes
    on: what is planned keeps a swing that is under way. A plan that fails is made anew with the body slower, then lower
    or higher by 2 in, aside by 2 in, or tilted by 3 degrees. Zero rates stop the body and every lift; a hand in the air
    comes down.

    Args:
        walk: whose body stands, as of :func:`standing_plan`.

    Attributes:
        command: rates that were asked for ``[3]`` [m/s, m/s, rad/s].
        reason: why the body cannot follow the command as it is; "" if it can.
    """

    def __init__(self, walk: Walk) -> None:
        self.walk, self.reason = walk, ""
        pose = walk.plan.path.at(walk.path_time)[0]
        self.steering = Steering.on(walk.structure, pose)
        self.command = np.zeros(3)
        self._asked = np.zeros(3)
        self._order, self._settled, self._stuck, self._waited = list(range(len(ALTERNATIVES))), True, False, False
        self._work: tuple[Course, Generator[Plan | None, None, Plan]] | None = None
        # Displacements of the paths that were planned last, sample by sample, and the last one that the body had
        self._displaced: list[tuple[BodyPath, Array]] = []
        self._on = walk.plan.path
        self._last = np.zeros(PARTS)
        walk.halted = True

    def steer(self, across: float, along: float, spin: float) -> None:
        """Ask for rates: of the body's origin round and along the structure [m/s], and spin about its normal [rad/s].

        Raises:
            ShapeError, NotFiniteError: no such numbers; the last command stays.
        """
        rates = validation.real_array("command", [across, along, spin], (3,))
        self.command = np.where(np.abs(rates) < STILL, 0.0, rates)

    @property
    def standing(self) -> bool:
        """The body stands as commanded, no hand is swinging, and the joints can be at rest in the next tick."""
        walk = self.walk
        if self.command.any() or walk.pace > 0.0 or walk.swinging is not None:
            return False
        return bool((np.abs(walk.v[6:]) <= walk.walker.robot.limits.acceleration[6:] * walk.dt).all())

    def tick(self) -> Tick:
        """One control period.

        Raises:
            HoldLost: too few hands hold. NoPlanError: a hand in the air that can be put nowhere.
        """
        walk = self.walk
        if not self.command.any() or self._stuck:
            self._halt()
            self._stuck = self._stuck and not (walk.pace == 0.0 and walk.swinging is None and not walk.busy)
        elif not walk.busy:
            self._plan()
        try:
            return walk.tick()
        except NoPlanError:
            if len(walk.held) == len(walk.walker.arms):
                raise
            walk.set_down()
            return walk.tick()

    def _halt(self) -> None:
        """The body stops, and a hand in the air comes down, where it was to go if that is in reach."""
        walk = self.walk
        self._drop()
        walk.halted, self._asked = True, np.zeros(3)
        swinging = walk.swinging
        if walk.pace > 0.0 or swinging is None or walk.busy:
            return
        if walk.progress.grips.first[swinging.grip] * walk.plan.path.spacing > walk.path_time:
            walk.set_down()

    def _plan(self) -> None:
        """Some slices of planning, begun anew where the command has changed or the horizon comes near."""
        walk = self.walk
        if self._work is not None and walk.plan.path is not self._on:
            # The walk has planned by itself meanwhile: what was begun leads on from another path
            self._drop()
            self._settled = False
        if (self.command != self._asked).any():
            self._order = list(range(len(ALTERNATIVES)))
            self._begin(LEAD, quick=True)
        elif self._work is None and not self._settled:
            self._begin(LEAD, quick=False)
        elif self._work is None and walk.plan.path.duration - walk.path_time < LEFT and not self.reason:
            # The least deviation first, then the one that has led on
            self._order = list(dict.fromkeys([0, self._order[0], *range(len(ALTERNATIVES))]))
            self._begin(AHEAD, quick=False)
        for _ in range(SLICES):
            if self._work is None:
                return
            begun, slices = self._work
            try:
                plan = next(slices)
            except StopIteration as end:
                self._drop()
                self._take(begun, end.value)
            except NoPlanError as error:
                self._drop()
                self.reason, swinging = str(error), walk.swinging
                if swinging is not None and not self._waited:
                    # The body may have to wait for the hand, where it can land
                    there = self._lands(swinging) - walk.path_time
                    self._begin(max(there, 0.0) + LEAD, quick=True, wait=time_left(swinging, walk.hands.data) + SURE)
                elif walk.pace == 0.0 and swinging is None and len(self._order) > 1:
                    # Its hands cannot hold as fast as that where it stands
                    del self._order[0]
                    self._settled = False
                else:
                    self._stuck = True
            else:
                if plan is not None:
                    walk.go_over(plan, begun.begins, begun.since)
                    self._on = walk.plan.path
                    walk.halted = False
                    self._work = Course(0.0, 0.0, 0, (), (), (), (), -1), slices
                    walk.limit = None

    def _begin(self, lead: float, quick: bool, wait: float = 0.0) -> None:
        """Begin to plan along the command, behind what the body goes on with for ``lead`` [s].

        Args:
            wait: for so long the body stops on its path [s].
        """
        walk, steering = self.walk, self.steering
        path = walk.plan.path
        begun, spacing = course(walk, lead, not quick), path.spacing
        times = np.arange(begun.begins, begun.splice + spacing / 2, spacing)
        waits = wait > 0.0
        if walk.pace:
            tail = list(path.poses[np.rint(times / spacing).astype(int)])
            off = [self._displacement(path, u) for u in times]
        else:
            # It stands between samples of its path, and begins from there
            tail = [path.at(walk.path_time)[0].homogeneous] * len(times)
            off, wait = [self._displacement(path, walk.path_time)] * len(times), max(wait, spacing)
        bare = [undisplaced(*pair) for pair in zip(tail, off, strict=True)]
        rates = steering.rates(bare[-2], bare[-1], spacing) if walk.pace and len(bare) > 1 else np.zeros(4)
        part, much = ALTERNATIVES[self._order[0]]
        rest = steering.ramp(rates, np.zeros(3), round(wait / spacing), spacing)
        ahead = steering.ramp(rest[-1] if len(rest) else rates, part * self.command, round(HORIZON / spacing), spacing)
        led = steering.ahead(bare[-1], np.concatenate([rest, ahead]), spacing)
        direction = (bare[-1][:3, :3].T @ (led[-1] - led[len(rest)])[:3, 3])[:2]
        shift, tilt = walk.hands.data.body_shift, walk.hands.data.body_tilt
        wanted = displacement(direction, *(m * most for m, most in zip(much, (shift, shift, tilt, tilt), strict=True)))
        shifting = (off[-1] - off[-2]) / spacing if len(off) > 1 else np.zeros(PARTS)
        aims = np.repeat([off[-1], wanted], [len(rest), len(ahead)], axis=0)
        more = towards(off[-1], shifting, aims, spacing)
        poses = [displaced(*pair) for pair in zip(led, more, strict=True)]
        other = BodyPath(np.concatenate([tail, poses]), spacing)
        kept = [pair for pair in self._displaced if pair[0] is path]
        self._displaced = [*kept, (other, np.concatenate([off, more]))]
        self._work = begun, course_slices(walk.walker, walk.structure, walk.plan, begun, other, quick)
        self._asked, self._waited, self._on = self.command.copy(), waits, path
        walk.limit = max(begun.splice - 0.5 * spacing, walk.path_time), begun.since + len(begun.kept)

    def _lands(self, swinging: Swinging) -> float:
        """Path time from which on a swinging hand can land on the present path [s]."""
        walk, grips = self.walk, self.walk.progress.grips
        first, last = int(grips.first[swinging.grip]), int(grips.last[swinging.grip])
        now = max(first, int(walk.progress.sample))
        found = next((k for k in range(now, last + 1) if bent(walk.walker, grips, swinging.grip, k)), first)
        return found * walk.plan.path.spacing

    def _displacement(self, path: BodyPath, u: float) -> Array:
        """Of the body at a path time, from where its command has it; on a path of another origin it stays."""
        for known, rows in self._displaced:
            if known is path:
                self._last = rows[min(round(u / path.spacing), len(rows) - 1)]
        return self._last

    def _take(self, begun: Course, plan: Plan) -> None:
        """Go over to a plan that leads farther; where it does not lead over the horizon, something else is tried."""
        walk = self.walk
        old = _far(walk.plan, walk.path_time)
        if plan.complete or _far(plan, walk.path_time - begun.begins) > old:
            walk.go_over(plan, begun.begins, begun.since)
            walk.halted = False
        self.reason, self._settled = plan.reason, plan.complete or len(self._order) == 1
        if not self._settled:
            del self._order[0]

    def _drop(self) -> None:
        self._work, self.walk.limit = None, None


def _far(plan: Plan, here: float) -> float:
    """How far a plan leads from a path time on [m], turns counted as on the path's own scale."""
    path = plan.path
    first, last = (round(u / path.spacing) for u in (here, path.duration if plan.complete else plan.reached))
    poses = path.poses[first : last + 1]
    shifts = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    turns = np.linalg.norm(np.diff(poses[:, :3, :2], axis=0), axis=(1, 2)) / np.sqrt(2.0)
    return float((shifts + TURN_RADIUS * turns).sum())


def standing_plan(walker: Walker, structure: Structure, pose: Any) -> Plan:
    """A plan for a body that stands, on holds that it could keep while it goes a little in every direction.

    Raises:
        ShapeError, RotationError: no pose. NoPlanError: no stance is possible there.
    """
    here = validation.pose("pose", pose)
    steering = Steering.on(structure, here)
    legs = [(1, 0), (-2, 0), (1, 1), (0, -2), (0, 1)]
    rates = np.concatenate([np.repeat([[*leg, 0, 0]], 10, axis=0) for leg in legs]) * ROUNDABOUT / (10 * SPACING)
    round_about = BodyPath(np.concatenate([here.homogeneous[None], steering.ahead(here.homogeneous, rates, SPACING)]))
    asked = plan_walk(walker, structure, round_about, objective="destination", partial=True)
    start = dict(zip([arm.name for arm in walker.arms], asked.start, strict=True))
    return plan_walk(walker, structure, standing_path(here), start=start)
