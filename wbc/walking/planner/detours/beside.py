"""A plan for a body that cannot follow its path: along one detour after the other, as far as the work allows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import inf

from wbc.robots import Walker
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.detours.route import BodyRoute, Routes, find_routes
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.slices import Allowance

#: Searches along detours are so many times as wide, as another detour leads on more often than another stance
NARROWER = 0.5
#: Slices of work that are spent on all detours, on the search along one of them, and on one that goes on where it ended
WORK, ROUTE, FURTHER = 3300.0, 600.0, 250.0
#: More arms than this, whose stances differ in more, may only have lost their way: the path itself is tried once more
USUAL_ARMS = 3
#: Where a plan ends behind this part of its path, a search that is so many times as wide goes on from so many re-grasps
#: before its end, and again where it leads on by more than GAIN [s]
NEARLY, BACK, WIDER, GAIN = 0.6, 4, 2.5, 0.2


@dataclass(frozen=True)
class Search:
    """A search for plans to a destination.

    Attributes:
        begin: (path, width, work) -> the plan from the beginning on, complete or not; raises :class:`NoPlanError` where
            it cannot begin.
        go_on: (plan, so many of its re-grasps, width, work) -> the plan along the same path that keeps these.
        width: stances stored for each number of re-grasps; None: all.
        deadline: of ``time.perf_counter``.
    """

    begin: Callable[[BodyPath, int | None, Allowance | None], Plan]
    go_on: Callable[[Plan, int, int | None, Allowance | None], Plan]
    width: int | None
    deadline: float | None

    def along(self, path: BodyPath, work: Allowance | None) -> Plan:
        """By a narrow search, and by wider ones from where it ends on."""
        plan = self._with(work, ROUTE, partial(self.begin, path, self._wide(NARROWER)))
        while not plan.complete and plan.reached > NEARLY * path.duration:
            further = self._further(plan, work)
            if further is None:
                break
            plan = further
        return plan

    def _further(self, plan: Plan, work: Allowance | None) -> Plan | None:
        """A plan that leads further than one with which it begins; None: none was found."""
        kept = len(plan.regrasps) - BACK
        if kept <= 0 or (work is not None and work.spent):
            return None
        found = self._with(work, FURTHER, partial(self.go_on, plan, kept, self._wide(WIDER)))
        return found if found.complete or found.reached > plan.reached + GAIN else None

    def _wide(self, times: float) -> int | None:
        return None if self.width is None else max(round(times * self.width), 1)

    @staticmethod
    def _with(work: Allowance | None, most: float, search: Callable[[Allowance | None], Plan]) -> Plan:
        """A search with at most so much of the work."""
        if work is None:
            return search(None)
        part = Allowance(min(most, work.left))
        before = part.left
        try:
            return search(part)
        finally:
            work.left -= before - part.left


def plan_beside(walker: Walker, structure: Structure, path: BodyPath, plan: Plan, search: Search) -> Plan:
    """A plan along a detour in place of one along a path that does not lead to its end; else that one."""
    work, best = None if search.width is None else Allowance(WORK), (inf, "")
    if len(walker.arms) > USUAL_ARMS and (found := search.along(path, work)).complete:
        return found
    routes, ended = find_routes(walker, structure, path, search.deadline, work), None
    while (route := _next(routes, ended)) is not None:
        ended = None
        if route.path is None:
            plan = replace(plan, reason=f"{plan.reason}; {route.text}", separating=route.separating)
            continue
        try:
            ended = search.along(route.path, work)
        except NoPlanError as error:
            best = min(best, (route.path.duration, f"on a detour {route.text} {error}"))
            continue
        if ended.complete:
            return ended
        best = min(best, (route.path.duration - ended.reached, f"on a detour {route.text} {ended.reason}"))
    reasons = [plan.reason, *([best[1]] if best[1] else [])]
    if work is not None and work.spent:
        reasons.append("what may be left was not looked at, as it would take too long")
    return replace(plan, reason="; ".join(reasons))


def _next(routes: Routes, plan: Plan | None) -> BodyRoute | None:
    """The next route after the one along which a plan does not lead to the end; None: no other."""
    try:
        return next(routes) if plan is None else routes.send(plan)
    except StopIteration:
        return None
