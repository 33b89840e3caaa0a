"""The two-ended arm on request: planned, carried out and recorded as a walk of any machine."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace

from wbc.errors import ShapeError
from wbc.robots import TwoEndedData, Walker
from wbc.walking.body_path import standing_path
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.run.carrying_out import Progress
from wbc.walking.run.perform import WalkRun, walked
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.run.request import WalkRequest
from wbc.walking.two_ended import TwoEndedStack, TwoEndedWalk, plan_two_ended


def two_ended_goal(request: WalkRequest, structure: Structure) -> tuple[dict[str, str], str | list[float]]:
    """(arm -> hold at the beginning, the hold or the place [m] to go to) of what a user types.

    Raises:
        ShapeError: no two holds, or several goals. UnknownNameError: no such hold.
    """
    first, *goals = request.places()
    start = first.split()
    if len(start) != 2 or len(goals) != 1:
        raise ShapeError("from, to", (first, *goals), "expected two holds, 'ID1 ID2', and one hold or place x,y,z")
    for name in start:
        structure.index(name)
    hands, goal = dict(zip(("arm1", "arm2"), start, strict=True)), goals[0]
    if goal not in structure:
        try:
            place = [float(part) for part in goal.split(",")]
        except ValueError:
            place = []
        if len(place) == 3:
            return hands, place
    structure.index(goal)
    return hands, goal


def perform_two_ended(
    request: WalkRequest,
    walker: Walker,
    *,
    stack: TwoEndedStack | None = None,
    backend: str = "auto",
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
) -> WalkRun:
    """Plans end over end to the request's goal, and goes there.

    Args:
        as of :func:`wbc.walking.run.perform_walk`.

    Raises:
        What the request's methods, :func:`two_ended_goal` and ``plan_two_ended`` raise for bad input. ShapeError:
        another machine.
    """
    report = progress or (lambda what, part: None)
    if not isinstance(walker.data, TwoEndedData):
        raise ShapeError("walker", walker.robot.name, "expected the two-ended arm")
    structure = request.build()
    start, goal = two_ended_goal(request, structure)
    report("planning", None)
    begin = time.perf_counter()
    try:
        plan = plan_two_ended(walker, structure, start, goal, gait=request.gait)
    except NoPlanError as error:
        standing = standing_path(structure.holds[structure.index(start["arm1"])].pose)
        return WalkRun(request, walker, structure, standing, None, "refused", str(error))
    planned, begin = time.perf_counter() - begin, time.perf_counter()
    report("compiling", None)
    stack = stack or TwoEndedStack(walker, structure, collisions=False, backend=backend)
    compiled, begin = time.perf_counter() - begin, time.perf_counter()
    walk = TwoEndedWalk(walker, structure, plan, stack=stack)
    recorder = WalkRecorder(walk, request.seed, {"request": asdict(request), "start": list(plan.start)})
    outcome, reason, more = walked(walk, recorder, report, stop, None)
    run = WalkRun(
        request, walker, structure, plan.path, plan, outcome, reason, None, None, planned, compiled, more=more
    )
    if not len(recorder):
        return run
    log, ticks = recorder.log()
    return replace(run, log=log, ticks=ticks, walk_time=time.perf_counter() - begin)
