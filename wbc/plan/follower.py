"""A planned law, carried out tick by tick: it brakes where an obstacle comes into its path, and plans anew."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import InfeasibleError
from wbc.plan.path import PlannedPath
from wbc.plan.planner import MotionPlanner, PlanningOptions
from wbc.trajectory import Law, PolynomialPath, time_optimal
from wbc.validation import Array

#: Shares of what is left of a path on which braking is tried, the shortest first
BRAKING = (0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0)


@dataclass(frozen=True, eq=False)
class FollowedState:
    """Where a follower is.

    Attributes:
        q: configuration [nq]. v: its velocity [nv].
        braking: it comes to rest, since an obstacle has moved into the path. arrived: at the goal, at rest.
    """

    q: Array
    v: Array
    braking: bool
    arrived: bool


class PathFollower:
    """Follows a law of a planned path.

        follower = PathFollower(planner, planner.plan(q, goal), goal)
        while not (state := follower.advance(dt)).arrived:
            posture.set(target=state.q, feedforward=state.v)
            q = robot.integrate(q, controller.step(q).v, dt)

    After run-time values of the planner have changed, as the pose of an obstacle, :meth:`check` proves what is left of
    the path again. Where it brakes, a thread plans from where it will rest; the planner is for nothing else meanwhile.

    Args:
        goal: of the path, for plans from elsewhere; options: of these.
        wait: at rest it waits for a plan that is not there yet; False: it stands until it is.

    Raises:
        as :meth:`PlannedPath.law`.
    """

    def __init__(
        self,
        planner: MotionPlanner,
        path: PlannedPath,
        goal: Any,
        options: PlanningOptions | None = None,
        *,
        wait: bool = True,
    ) -> None:
        self._planner, self._goal = validation.instance("planner", planner, MotionPlanner, "a MotionPlanner"), goal
        self._options, self._wait = options, validation.flag("wait", wait)
        self._threads = ThreadPoolExecutor(1, "planner")
        self._next: Future[tuple[PlannedPath, Law]] | None = None
        self._take(validation.instance("path", path, PlannedPath, "a PlannedPath"), path.law())

    def _take(self, path: PlannedPath, law: Law) -> None:
        self.path, self.law, self.time, self.braking = path, law, 0.0, False

    def _plan(self) -> Future[tuple[PlannedPath, Law]]:
        """A path from where it rests."""
        q, _ = self.path.configurations(self.law, self.law.duration)

        def planned() -> tuple[PlannedPath, Law]:
            path = self._planner.plan(q, self._goal, self._options)
            return path, path.law()

        return self._threads.submit(planned)

    def advance(self, dt: float) -> FollowedState:
        """The state ``dt`` later [s]. At rest after braking it takes the new path, if that is still clear.

        Raises:
            RangeError: dt is no positive number. InfeasibleError, NoPathError: there is no path from where it rests.
        """
        self.time += validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
        if self.braking and self.time >= self.law.duration:
            self._go_on()
        return self.state()

    def _go_on(self) -> None:
        while (planned := self._next or self._plan()).done() or self._wait:
            self._next = None
            path, law = planned.result()
            if self._planner.scene(path.coordinates).violation(path.smooth) is None:
                self._take(path, law)
                return
        self._next = planned

    def state(self) -> FollowedState:
        """The present one."""
        q, v = self.path.configurations(self.law, min(self.time, self.law.duration))
        return FollowedState(q, v, self.braking, not self.braking and self.time >= self.law.duration)

    def check(self) -> bool:
        """Whether what is left of the path is clear of the obstacles as they are now; else it brakes on its path.

        Raises:
            InfeasibleError: no braking ends before the obstacle; it brakes as hard as it may.
        """
        scene = self._planner.scene(self.path.coordinates)
        left = self._left(1.0)
        if self.braking or left is None or scene.violation(left) is None:
            return True
        fast, brisk = self.path.motion_limits()
        speed, hit = self._timing(1), None
        for share in BRAKING:
            part = self._left(share)
            assert part is not None
            try:
                law = time_optimal(part, fast, brisk, start_speed=speed)
            except InfeasibleError:
                continue
            self.law, self.time, self.braking = law, 0.0, True
            hit = scene.violation(part)
            break
        if self.braking:
            self._next = self._plan()
        if hit is not None:
            raise InfeasibleError("path", hit.distance, f"it cannot come to rest before {hit}")
        return False

    def _left(self, share: float) -> PolynomialPath | None:
        """The beginning of what is left of the path; None where nothing is."""
        path = self.law.path
        assert isinstance(path, PolynomialPath)
        first, end = float(path.knots[0]), float(path.knots[-1])
        here = max(self._timing(0), first)
        until = min(here + share * (end - here), end)
        return path.sliced(here, until) if until - here >= 1e-9 else None

    def _timing(self, order: int) -> float:
        """Place on the path, or its rate."""
        return float(self.law.timing.evaluate(np.array([min(self.time, self.law.duration)]), order)[0])
