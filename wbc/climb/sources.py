"""Where the plans of a climb come from: a goal, rates of the body, targets of one limb; and what happens meanwhile."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import wbc.log
from wbc.climb import scenes
from wbc.climb.along import AlongOptions, BodyTrack, plan_along
from wbc.climb.climber import Climber
from wbc.climb.closure import Closure
from wbc.climb.drive import ClimbDrive, standing_plan
from wbc.climb.first import first_stance
from wbc.climb.goal import BodyPlace, LimbAt
from wbc.climb.limb_work import moved_by, plan_limb_work
from wbc.climb.loop import ClimbLoop
from wbc.climb.loop.loop import Onward, Replan
from wbc.climb.motion import MoveError
from wbc.climb.plan import ContactPlan
from wbc.climb.planning import ClimbOptions, plan_climb
from wbc.climb.request import ClimbRequest
from wbc.climb.resume import stance_in
from wbc.climb.scene import ClimbScene
from wbc.climb.search import NoStancesError
from wbc.climb.stance import Stance
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.validation import Array

#: "NUMBERS for SECONDS"
_RATES = re.compile(r"\s*([^\s]+)\s+for\s+(\S+)\s*")
#: "NAME at SECONDS"
_AT = re.compile(r"\s*(.+?)\s+at\s+(\S+)\s*")


@dataclass(frozen=True, eq=False)
class PlanSource:
    """What a loop carries out.

    Attributes:
        first: the plan that it begins with. replan: what it asks where the plan cannot go on. onward: what it asks once
            a plan is done; None: that is the end.
        before_tick: what is done before every tick.
        most: time after which it is ended [s].
    """

    first: ContactPlan
    replan: Replan
    onward: Onward | None
    before_tick: Callable[[ClimbLoop], None]
    most: float


def source_of(request: ClimbRequest, climber: Climber, scene: ClimbScene, start: pin.SE3, goal: pin.SE3) -> PlanSource:
    """The source that a request asks for.

    Args:
        start, goal: frames on the scene's surface, z outwards, x along the way.

    Raises:
        ShapeError, RangeError: texts that are none, or sources that do not go together. What planners raise.
    """
    chosen = [name for name, given in (("drive", request.drive), ("limb", request.limb)) if given]
    if len(chosen) > 1 or (chosen and request.resume is not None and request.goal is not None):
        raise ShapeError("drive", request.drive, "give rates, a limb, or a goal, and not two of them")
    if bool(request.limb) != bool(request.do):
        raise ShapeError("do", request.do, "give a limb and what it does together")
    events = _events(request)
    if request.resume is not None:
        stance = stance_in(wbc.log.load(request.resume), climber, scene, request.at)
    else:
        stance = None
    if request.drive:
        return _driven(request, climber, scene, stance or _stands(request, climber, scene, start), events)
    if request.limb:
        return _worked(request, climber, scene, stance or _stands(request, climber, scene, start), events)
    return _walked(request, climber, scene, start, goal, stance=stance, events=events)


def _stands(request: ClimbRequest, climber: Climber, scene: ClimbScene, start: pin.SE3) -> Stance:
    return first_stance(climber, scene, scenes.placed(climber, start), _options(request).stances)


def _options(request: ClimbRequest) -> ClimbOptions:
    """What plans for the request's plant keep, at the speeds that it asks for."""
    options = ClimbOptions.by_torques() if request.plant == "mujoco" else ClimbOptions()
    if request.speed <= 0.0:
        return options
    speeds = replace(options.motion.speeds, speed=request.speed, turn_rate=request.turn_rate)
    return replace(options, motion=replace(options.motion, speeds=speeds))


def _along(options: ClimbOptions) -> AlongOptions:
    return AlongOptions(options.motion, options.stances.margin)


def _walked(
    request: ClimbRequest, climber: Climber, scene: ClimbScene, start: pin.SE3, goal: pin.SE3, *, stance: Stance | None,
    events: Callable[[ClimbLoop], None],
) -> PlanSource:  # fmt: skip
    options = _options(request)

    def replan(now: ClimbScene, at: Stance) -> ContactPlan:
        goals = _goals(climber, now, goal)
        for k, sought in enumerate(goals):
            try:
                return plan_climb(climber, now, at, sought, options)
            except (NoStancesError, MoveError):
                if k == len(goals) - 1:
                    raise
        raise AssertionError

    first = None
    if stance is None and request.speed > 0.0:
        poses = [climber.body_pose(scenes.placed(climber, frame)) for frame in (start, goal)]
        try:
            first = plan_along(
                climber, scene, BodyTrack(poses, request.speed, request.turn_rate), None, _along(options)
            )
        except NoStancesError:
            first = None
    if first is None:
        first = replan(scene, stance or _stands(request, climber, scene, start))
    return PlanSource(first, replan, None, events, 2.0 * float(first.times[-1]) + 10.0)


def _goals(climber: Climber, scene: ClimbScene, goal: pin.SE3) -> list[BodyPlace | LimbAt]:
    """The body over a frame; where limbs with few joints take it along, so that it seldom can be at a place of its own,
    one of them at the foothold that is nearest to the frame.
    """
    if not Closure(climber).short:
        return [BodyPlace(climber.body_pose(scenes.placed(climber, goal)).translation)]
    nearest = int(np.argmin(np.linalg.norm(scene.positions - goal.translation, axis=1)))
    return [LimbAt(limb.name, scene.footholds[nearest].id) for limb in climber.limbs]


def _driven(
    request: ClimbRequest, climber: Climber, scene: ClimbScene, stance: Stance, events: Callable[[ClimbLoop], None]
) -> PlanSource:
    commands = [_rates("drive", text) for text in request.drive]
    ends = np.cumsum([seconds for _, seconds in commands])
    drive = ClimbDrive(climber, options=_along(_options(request)))

    def before_tick(loop: ClimbLoop) -> None:
        events(loop)
        leg = int(np.searchsorted(ends, loop.time, side="right"))
        if leg < len(commands):
            drive.steer(commands[leg][0], loop)
        else:
            drive.finish(loop)

    first = standing_plan(climber, scene, stance)
    return PlanSource(first, drive.following, drive.onward, before_tick, 2.0 * float(ends[-1]) + 30.0)


def _worked(
    request: ClimbRequest, climber: Climber, scene: ClimbScene, stance: Stance, events: Callable[[ClimbLoop], None]
) -> PlanSource:
    pose, targets = climber.contact_pose(stance.q, climber.row(request.limb)), list[Any]()
    for text in request.do:
        what, _, rest = text.strip().partition(" ")
        if what == "hold":
            targets.append(rest.strip())
            pose = scene.footholds[scene.row(targets[-1])].pose
        elif what == "rate":
            twist, seconds = _rates("do", rest)
            targets += moved_by(pose, twist, seconds)
            pose = targets[-1]
        else:
            raise ShapeError("do", text, "expected 'hold FOOTHOLD' or 'rate VX,VY,VZ,WX,WY,WZ for SECONDS'")

    motion = _options(request).motion

    def replan(now: ClimbScene, at: Stance) -> ContactPlan:
        return plan_limb_work(climber, now, at, request.limb, targets[-1:], motion)

    first = plan_limb_work(climber, scene, stance, request.limb, targets, motion)
    return PlanSource(first, replan, None, events, 2.0 * float(first.times[-1]) + 10.0)


def _events(request: ClimbRequest) -> Callable[[ClimbLoop], None]:
    """What happens at its time: footholds that vanish, limbs that fail."""
    waiting = sorted(
        [(*_when("vanish", text), "vanish") for text in request.vanish]
        + [(*_when("fail", text), "fail") for text in request.fail]
    )

    def happen(loop: ClimbLoop) -> None:
        while waiting and loop.time >= waiting[0][0]:
            _, name, what = waiting.pop(0)
            if what == "fail":
                loop.fail(name)
            else:
                loop.see(loop.scene.without(name))

    return happen


def _rates(field: str, text: str) -> tuple[Array, float]:
    """A twist and for how long [s]."""
    parts = _RATES.fullmatch(text)
    try:
        if parts is None:
            raise ValueError
        numbers, seconds = np.array([float(part) for part in parts[1].split(",")]), float(parts[2])
    except ValueError:
        raise ShapeError(field, text, "expected 'VX,VY,VZ,WX,WY,WZ for SECONDS'") from None
    if len(numbers) != 6 or not np.isfinite([*numbers, seconds]).all() or not seconds > 0.0:
        raise ShapeError(field, text, "expected six finite rates and a time above 0 s")
    return numbers, seconds


def _when(field: str, text: str) -> tuple[float, str]:
    parts = _AT.fullmatch(text)
    try:
        if parts is None:
            raise ValueError
        seconds = float(parts[2])
    except ValueError:
        raise ShapeError(field, text, "expected 'NAME at SECONDS'") from None
    if not seconds >= 0.0:
        raise RangeError(field, seconds, "expected a time of at least 0 s")
    return seconds, parts[1]
