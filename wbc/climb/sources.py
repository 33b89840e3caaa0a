"""Where the plans of a climb come from: a path, rates of the body, work of one limb; and what happens meanwhile."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from wbc.climb.along import AlongOptions, BodyTrack, plan_along
from wbc.climb.climber import Climber
from wbc.climb.closure import Closure
from wbc.climb.drive import ClimbDrive, standing_plan
from wbc.climb.faults import timed
from wbc.climb.first import first_stance
from wbc.climb.goal import BodyPlace, LimbAt, Route
from wbc.climb.let_go import joined
from wbc.climb.limb_work import moved_by, plan_limb_work
from wbc.climb.loop import ClimbLoop
from wbc.climb.loop.loop import Onward, Replan
from wbc.climb.motion import MoveError
from wbc.climb.plan import ContactPlan
from wbc.climb.plan_files import read_plan
from wbc.climb.planning import ClimbOptions, plan_climb
from wbc.climb.rates import TwistSource, TwistTable, read_twists, round_surface, twist_of, twists_of
from wbc.climb.request import ClimbRequest, DriveRequest, LimbRequest, PathRequest
from wbc.climb.scene import ClimbScene
from wbc.climb.search import NoStancesError
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.track.target_file import read_targets
from wbc.validation import Array

#: More moves than are looked at in any time
ALL_MOVES = 2**31 - 1
#: A body so near to the end of its way is there [m]
THERE = 1e-3


@dataclass(frozen=True, eq=False)
class PlanSource:
    """What a loop carries out.

    Attributes:
        plan: makes the plan that it begins with. replan: what it asks where the plan cannot go on. onward: what it asks
            once a plan is done; None: that is the end.
        before_tick: what is done before every tick.
        lasts: until which time it is driven [s]; None: as long as the plan takes.
        notes: what plans do otherwise than was asked.
    """

    plan: Callable[[], ContactPlan]
    replan: Replan
    onward: Onward | None
    before_tick: Callable[[ClimbLoop], None]
    lasts: float | None = None
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class ClimbSetup:
    """What a request means: a robot, a scene, and where on it.

    Attributes:
        request: what was asked. climber: the robot.
        scene: what it climbs, all of it.
        way: poses of the body over the places of the request, the first one where it begins.
        stance: where the robot stands, on footholds of ``scene``; None: a first stance is to be found.
        rest: how it comes to rest there first, where it moved; None: it stands.
        since: time that has passed for what happens meanwhile [s].
        told: is called with how far planning is.
    """

    request: ClimbRequest
    climber: Climber
    scene: ClimbScene
    way: tuple[pin.SE3, ...]
    stance: Stance | None = None
    rest: ContactPlan | None = None
    since: float = 0.0
    told: Callable[[str], None] | None = None

    @property
    def options(self) -> ClimbOptions:
        """What plans for the request's plant keep, at the speeds that it asks for."""
        options = ClimbOptions() if self.request.plant.plant == "kinematic" else ClimbOptions.by_torques()
        mode = self.request.mode
        if not isinstance(mode, PathRequest):
            return options
        # What is asked for is a limit of time
        stances = replace(options.stances, moves=ALL_MOVES)
        options = replace(options, stances=stances, seconds=mode.planning_time, told=self.told)
        if not mode.speed:
            return options
        speeds = replace(options.motion.speeds, speed=mode.speed, turn_rate=mode.turn_rate)
        return replace(options, motion=replace(options.motion, speeds=speeds))

    @property
    def along(self) -> AlongOptions:
        """The same for plans along a way."""
        options = self.options
        return AlongOptions(options.motion, options.stances.margin)

    def stands(self) -> Stance:
        """Where the robot stands at first.

        Raises:
            NoStancesError: nowhere.
        """
        if self.stance is not None:
            return self.stance
        begun = self.climber.with_body(self.climber.rest, self.way[0])
        return first_stance(self.climber, self.scene, begun, self.options.stances)


def source_of(setup: ClimbSetup, twists: TwistSource | None = None) -> PlanSource:
    """The source that a request asks for.

    Args:
        twists: what drives the body in place of the request's file, as a keyboard; of drives.

    Raises:
        ShapeError, RangeError: texts that are none, or rates of a body that has none of its own. What files and
            planners raise.
    """
    mode, rest = setup.request.mode, setup.rest
    if isinstance(mode, DriveRequest):
        given = twists or (read_twists(mode.commands) if mode.commands else twists_of(mode.rate))
        source = _driven(setup, given)
    else:
        source = _worked(setup, mode) if isinstance(mode, LimbRequest) else _walked(setup, mode)
    return source if rest is None else replace(source, plan=lambda: joined(rest, source.plan()))


def _walked(setup: ClimbSetup, mode: PathRequest) -> PlanSource:
    climber, notes = setup.climber, list[str]()
    given = read_plan(mode.plan, climber, setup.scene) if mode.plan else None

    def along(now: ClimbScene, at: Stance | None, poses: Sequence[pin.SE3]) -> ContactPlan | None:
        if mode.objective != "velocity" or not mode.speed or (at is not None and min(at.contacts) == FREE_LIMB):
            return None
        try:
            return plan_along(climber, now, BodyTrack(poses, mode.speed, mode.turn_rate), at, setup.along)
        except NoStancesError as error:
            notes.append(f"slower than asked, over other stances: {error}")
            return None

    def over_stances(now: ClimbScene, at: Stance, left: Sequence[pin.SE3]) -> ContactPlan:
        goals, options, begun = _goals(climber, now, left), setup.options, time.monotonic()
        for k, sought in enumerate(goals):
            try:
                still = options.seconds - (time.monotonic() - begun)
                return plan_climb(climber, now, at, sought, replace(options, seconds=still))
            except (NoStancesError, MoveError):
                if k == len(goals) - 1 or time.monotonic() - begun >= options.seconds:
                    raise
        raise AssertionError

    def replan(now: ClimbScene, at: Stance) -> ContactPlan:
        here = climber.body_pose(at.q)
        left = still_to_go(setup.way, here)
        near = np.linalg.norm(left[0].translation - here.translation) <= THERE
        if near and len(left) == 1 and min(at.contacts) != FREE_LIMB:
            return standing_plan(climber, now, at)
        plan = None if near else along(now, at, (here, *left))
        return plan or over_stances(now, at, left)

    def first() -> ContactPlan:
        if given is not None:
            return given
        if setup.stance is not None:
            return replan(setup.scene, setup.stance)
        return along(setup.scene, None, setup.way) or over_stances(setup.scene, setup.stands(), setup.way[1:])

    return PlanSource(first, replan, None, events_of(setup), notes=notes)


def still_to_go(way: Sequence[pin.SE3], here: pin.SE3) -> tuple[pin.SE3, ...]:
    """The places of a way that are left for a body: those after the leg that it is nearest to, of two the earlier."""
    points = np.array([pose.translation for pose in way])
    begins, legs = points[:-1], np.diff(points, axis=0)
    if not len(legs):
        return tuple(way)
    part = np.einsum("ij,ij->i", here.translation - begins, legs) / np.maximum(np.einsum("ij,ij->i", legs, legs), 1e-12)
    away = np.linalg.norm(begins + np.clip(part, 0.0, 1.0)[:, None] * legs - here.translation, axis=1)
    leg = int(np.argmin(away > away.min() + THERE))
    at_its_end = leg + 2 < len(way) and float(np.linalg.norm(points[leg + 1] - here.translation)) <= THERE
    return tuple(way[leg + 1 + int(at_its_end) :])


def _goals(climber: Climber, scene: ClimbScene, way: Sequence[pin.SE3]) -> list[Route]:
    """The body at one pose after the other; where limbs with few joints take it along, so that it seldom can be at a
    place of its own, one of them at the foothold that is nearest to the middle of the limbs there.
    """
    if not Closure(climber).short:
        return [Route([BodyPlace(pose.translation) for pose in way])]
    nearest = []
    for pose in way:
        q = climber.with_body(climber.rest, pose)
        tips = [climber.contact_pose(q, limb).translation for limb in range(len(climber.limbs))]
        away = np.linalg.norm(scene.positions - np.mean(tips, axis=0), axis=1)
        nearest.append(scene.footholds[int(np.argmin(away))].id)
    return [Route([LimbAt(limb.name, foothold) for foothold in nearest]) for limb in climber.limbs]


def _driven(setup: ClimbSetup, twists: TwistSource) -> PlanSource:
    climber = setup.climber
    if len(Closure(climber).short) == len(climber.limbs):
        reason = "its limbs have fewer joints than what they hold fixes, so that its body has no rates of its own"
        raise RangeError("robot", climber.name, reason)
    drive, events = ClimbDrive(climber, setup.along), events_of(setup)
    now: Array | None = np.zeros(6)

    def before_tick(loop: ClimbLoop) -> None:
        nonlocal now
        events(loop)
        if now is None:
            return
        asked = twists.at(loop.time)
        if asked is None:
            drive.finish(loop)
        elif not np.array_equal(asked, now):
            drive.steer(round_surface(loop.scene, climber.body_pose(loop.stance.q), asked), loop)
        now = asked

    def first() -> ContactPlan:
        return standing_plan(climber, setup.scene, setup.stands())

    lasts = float(twists.times[-1]) if isinstance(twists, TwistTable) else np.inf
    return PlanSource(first, drive.following, drive.onward, before_tick, lasts)


def _worked(setup: ClimbSetup, mode: LimbRequest) -> PlanSource:
    climber, scene = setup.climber, setup.scene
    limb = mode.limb or climber.limbs[0].name
    row, steps = climber.row(limb), [_step(scene, text) for text in mode.do]
    last = list[Any]()

    def first() -> ContactPlan:
        stance = setup.stands()
        pose, targets, leaving = climber.contact_pose(stance.q, row), list[Any](), 0
        for what, given in steps:
            if what == "hold":
                targets.append(given)
                pose = climber.limbs[row].contact.held_at(scene.footholds[scene.row(given)].pose)
                continue
            if what == "rate":
                leaving = leaving if targets else len(moved_by(pose, *given)) - 1
                targets += moved_by(pose, *given)
            else:
                targets += [t.pose if t.oriented else pin.SE3(pose.rotation, t.pose.translation) for t in given]
            pose = targets[-1]
        last[:] = targets[-1:]
        # On its way off a foothold a limb is at first too near to what it held to rest there
        for left_out in range(leaving):
            with contextlib.suppress(MoveError):
                return plan_limb_work(climber, scene, stance, limb, targets[left_out:], setup.options.motion)
        return plan_limb_work(climber, scene, stance, limb, targets[leaving:], setup.options.motion)

    def replan(now: ClimbScene, at: Stance) -> ContactPlan:
        return plan_limb_work(climber, now, at, limb, last, setup.options.motion)

    return PlanSource(first, replan, None, events_of(setup))


def _step(scene: ClimbScene, text: str) -> tuple[str, Any]:
    """What a limb is to do: to a foothold, through poses, or by a twist for a time."""
    what, _, rest = text.strip().partition(" ")
    rest = rest.strip()
    if what == "hold" and rest:
        return what, scene.footholds[scene.row(rest)].id
    if what == "poses" and rest:
        return what, read_targets(Path(rest))
    if what == "rate":
        return what, twist_of("do", rest)
    expected = "'hold FOOTHOLD', 'poses FILE' or 'rate VX,VY,VZ,WX,WY,WZ for SECONDS'"
    raise ShapeError("do", text, f"expected {expected}")


def events_of(setup: ClimbSetup) -> Callable[[ClimbLoop], None]:
    """What happens at its time: footholds that vanish, limbs that fail.

    Raises:
        ShapeError, RangeError, UnknownNameError: texts that are none, or no such foothold or limb.
    """
    plant, waiting = setup.request.plant, list[tuple[float, str, str]]()
    for what, texts, known in (("vanish", plant.vanish, setup.scene.row), ("fail", plant.fail, setup.climber.row)):
        for text in texts:
            name, seconds = timed(what, text)
            known(name)
            waiting.append((seconds, what, name))
    waiting.sort(key=lambda event: event[0])

    def happen(loop: ClimbLoop) -> None:
        while waiting and setup.since + loop.time >= waiting[0][0]:
            _, what, name = waiting.pop(0)
            if what == "fail":
                loop.fail(name)
            elif name in {foothold.id for foothold in loop.scene.footholds}:
                loop.see(loop.scene.without(name))

    return happen
