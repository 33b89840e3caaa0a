"""One climb from request to check: robot and scene by name or file, plan, loop, checker, and its folder."""

from __future__ import annotations

import contextlib
import pathlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

import wbc.log
from wbc import robots, validation
from wbc.api import Controller
from wbc.climb import machines, scenes
from wbc.climb.at_rest import standing
from wbc.climb.checker import CheckRules, ClimbReport, check
from wbc.climb.climber import Climber, ClimbLimb
from wbc.climb.contacts import GripHand, SuctionPad
from wbc.climb.faults import PlantFault
from wbc.climb.folder import PART, begin_folder, read_folder
from wbc.climb.grids import GRID_ENDS, GRIDS, remove_columns, remove_fraction, remove_rows
from wbc.climb.loop import ClimbLoop, ClimbRun
from wbc.climb.places import body_frames, body_over, facing, surface_frames
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.plan_files import PLAN, save_plan
from wbc.climb.plants import ClimbPlant, PlantErrors, RigidClimbPlant, climb_plant
from wbc.climb.rates import TwistSource, read_twists, round_surface, twists_of
from wbc.climb.request import (
    KINEMATIC,
    ClimberRequest,
    ClimbRequest,
    DriveRequest,
    PathRequest,
    RemovedFootholds,
    SceneRequest,
)
from wbc.climb.resume import coming_to_rest, stance_in
from wbc.climb.scene import ClimbScene, check_scale, size_of
from wbc.climb.scene_files import read_scene
from wbc.climb.sources import ClimbSetup, source_of
from wbc.errors import RangeError, ShapeError
from wbc.log import save
from wbc.multibody import pin
from wbc.robots.walker_data import WalkerData, data_changes, spaced_radius

#: The robot whose data may be changed
WALKER = "walker"
#: Fewest and most arms of the published walker
ARMS = (2, 6)
#: Time between two reports of how far it is [s]
TOLD = 0.25
#: How long an ended run may take to come to rest [s]
RESTING = 5.0
#: Beyond twice the time of its plan, or of its rates, a run is ended [s]
MOST_AFTER = 30.0

#: Largest jumps of the body's velocity between ticks [m/s]: moves of least time of quick joints have half of it
BODY_JUMP = 0.1
#: The same of its turn rate [rad/s]
BODY_JUMP_TURN = 0.1
#: They may be this part of what was asked, if that is more [1]
CHANGE = 0.2

#: (what is done, part of it that is done, or None)
Progress = Callable[[str, float | None], None]
#: (what a limb is to do, why the foothold that was named last is refused, or "") -> "" for yes, the id of another
#: foothold, or None: it is not done, and the run ends
Ask = Callable[[str, str], str | None]


@dataclass(frozen=True)
class ClimbHooks:
    """Who is told and asked while a climb is made.

    Attributes:
        progress: is told. stop: is asked before every tick; True: it comes to rest and ends. ask: is asked before
            a limb lifts. twists: drive the body in place of the request's file.
        compiled: is called once when the controller is ready.
    """

    progress: Progress = lambda what, part: None
    stop: Callable[[], bool] = lambda: False
    ask: Ask | None = None
    twists: TwistSource | None = None
    compiled: Callable[[Controller], None] | None = None


@dataclass(frozen=True, eq=False)
class ClimbDone:
    """A climb that was planned, carried out and checked.

    Attributes:
        request: what was asked. plan: what was planned first. run: what was done.
        report: its check; None: it was not checked.
        planning: processor time of the plan [s]. looping: of all ticks [s].
        note: what the plan does otherwise than was asked; "" for nothing.
    """

    request: ClimbRequest
    plan: ContactPlan
    run: ClimbRun
    report: ClimbReport | None
    planning: float
    looping: float
    note: str = ""

    @property
    def figures(self) -> dict[str, Any]:
        """Plain data: times [s], and how many times faster than the climb plan and ticks were."""
        duration = float(self.run.log["t"][-1])
        return {
            "planning": self.planning, "looping": self.looping, "loop_real_time": duration / max(self.looping, 1e-9),
            "real_time": duration / max(self.planning + self.looping, 1e-9), "note": self.note,
        }  # fmt: skip


def climber_of(request: ClimberRequest) -> Climber:
    """The robot.

    Raises:
        UnknownNameError: no such name, file or frame. ShapeError, RangeError: options that are of other robots. What
        :class:`Climber` and ``wbc.robots.load`` raise.
    """
    path = pathlib.Path(request.robot)
    if request.robot != WALKER:
        for name, given in (("arms", request.arms != ClimberRequest.arms), ("set", bool(request.set))):
            if given:
                raise RangeError(name, getattr(request, name), f"it is of the robot {WALKER!r}, not of {request.robot}")
    if not path.suffix:
        if request.limbs:
            raise ShapeError("limbs", request.limbs, f"{request.robot} has limbs of its own; name those of a file")
        if request.robot != WALKER:
            return machines.climber(request.robot)
        values, arms = data_changes(request.set), validation.integer("arms", request.arms, *ARMS)
        data = WalkerData.read(**values)
        if "shoulder_radius" not in values:
            data = replace(data, shoulder_radius=spaced_radius(arms, data.shoulder_radius))
        return machines.walking_arms(robots.walker(arms, data=data), WALKER)
    frames = [name.strip() for text in request.limbs for name in text.split(",") if name.strip()]
    if len(frames) < 2:
        raise ShapeError("limbs", request.limbs, "give the frames at the tips of two limbs or more, with commas")
    # Soles are parts of links, and what is between the legs of humanoids is tight for capsules
    shapes = "convex" if request.hold == "flat" else "fit"
    robot = machines.with_rates(robots.load(str(path), base="floating", shapes=shapes))
    make: dict[str, Callable[[str], ClimbLimb]] = {
        "point": lambda frame: machines.point_foot(robot, frame, request.friction),
        "flat": lambda frame: machines.flat_foot(robot, frame, request.friction),
        "grip": lambda frame: ClimbLimb(frame, GripHand()),
        "rolling-grip": lambda frame: ClimbLimb(frame, GripHand(rolls=True)),
        "suction": lambda frame: ClimbLimb(frame, SuctionPad(friction=request.friction)),
    }
    climber = Climber(machines.ready(robot), [make[request.hold](frame) for frame in frames], name=path.stem)
    # A state of the description may be anything that its maker calls so, but zeros are none
    stands = climber.limbs[0].contact.pulls or not robot.notes.get("neutral", "").startswith("zero")
    return climber if stands else standing(climber)


@dataclass(frozen=True, eq=False)
class DrawnScene:
    """A scene as it is asked for.

    Attributes:
        scene: less the footholds that were removed. whole: with them: one may be over where they were.
        course: frames on the surface at the start and the goal of a family, z outwards and x ahead; () elsewhere.
    """

    scene: ClimbScene
    whole: ClimbScene
    course: tuple[pin.SE3, ...] = ()


def scene_of(request: SceneRequest, climber: Climber) -> DrawnScene:
    """The scene.

    Raises:
        UnknownNameError: no such scene. StructureFileError: a bad file. RangeError: a scene of another scale, or
        footholds that are not there to be removed.
    """
    course: tuple[pin.SE3, ...] = ()
    if pathlib.Path(request.scene).suffix:
        whole = read_scene(request.scene, request.gravity)
    elif request.scene in GRIDS:
        whole = GRIDS[request.scene]()
    else:
        validation.one_of("scene", request.scene, (*GRIDS, *scenes.families()))
        drawn = scenes.draw(request.scene, size_of(climber), request.seed, request.density)
        whole, course = drawn.scene, (drawn.start, drawn.goal)
    if request.gravity is not None:
        whole = replace(whole, gravity=np.array(request.gravity))
    scene = less_footholds(whole, request)
    check_scale(climber, scene)
    return DrawnScene(scene, whole, course)


def less_footholds(scene: ClimbScene, removed: RemovedFootholds) -> ClimbScene:
    """A scene less the footholds that are taken away.

    Raises:
        ShapeError, RangeError, NotFiniteError: footholds that are not there, or none would be left.
    """
    scene = remove_rows(scene, removed.remove_rows) if removed.remove_rows else scene
    scene = remove_columns(scene, removed.remove_columns) if removed.remove_columns else scene
    return remove_fraction(scene, removed.remove, removed.seed) if removed.remove else scene


def setup_of(request: ClimbRequest) -> ClimbSetup:
    """Robot, scene and way of a request, and of one that goes on with a run where the robot stands.

    Raises:
        ShapeError: places that are not said. What :func:`climber_of`, :func:`scene_of`, ``body_frames`` and
        ``stance_in`` raise.
    """
    climber = climber_of(request.climber)
    drawn, mode, earlier = scene_of(request.scene, climber), request.mode, request.earlier
    points = mode.points if isinstance(mode, PathRequest) else ()
    way = _way(climber, drawn, mode.start, points)
    setup = ClimbSetup(request, climber, drawn.scene, way if isinstance(mode, PathRequest) else way[:1])
    if isinstance(mode, PathRequest) and len(way) < 2:
        raise ShapeError("to", points, "say from which to which foothold; a file has no ends of its own")
    if earlier is None:
        return setup
    log = wbc.log.load(earlier.folder)
    stance = stance_in(log, climber, drawn.scene, earlier.at)
    rest = coming_to_rest(log, climber, drawn.scene, earlier.at, setup.options.motion)
    stance = stance if rest is None else replace(stance, q=rest.q[-1])
    return replace(setup, stance=stance, rest=rest, since=earlier.passed + earlier.at)


def _way(climber: Climber, drawn: DrawnScene, start: str, points: tuple[str, ...]) -> tuple[pin.SE3, ...]:
    """Poses of the body over places; those that are not said are the ends of the scene."""
    if drawn.course and not (start and points):
        named = surface_frames(drawn.whole, [name for name in (start, *points) if name]) if start or points else []
        frames = [*([] if start else drawn.course[:1]), *named, *([] if points else drawn.course[1:])]
        ahead = [b.translation - a.translation for a, b in pairwise(frames)]
        frames = [
            pin.SE3(facing(frame, way), frame.translation)
            for frame, way in zip(frames, (*ahead, ahead[-1]), strict=True)
        ]
        return tuple(body_over(climber, frame) for frame in frames)
    first, last = GRID_ENDS.get(drawn.whole.name, ("", ""))
    names = [start or first, *(points or ((last,) if last else ()))]
    if not all(names):
        raise ShapeError("from", start, "say over which foothold the body begins; a file has no ends of its own")
    return tuple(body_frames(climber, drawn.whole, names))


def plant_of(setup: ClimbSetup) -> ClimbPlant | RigidClimbPlant | None:
    """The plant of a request; None: the kinematic one.

    Raises:
        What ``climb_plant`` and texts of faults raise.
    """
    asked, seed = setup.request.plant, setup.request.scene.seed
    errors = PlantErrors(
        friction=asked.slippery, mass=asked.mass_error, delay=asked.delay, seed=seed, payload=asked.payload,
        rubbing=asked.rubbing,
    )  # fmt: skip
    faults = [PlantFault.read(text) for text in asked.fault]
    return climb_plant(asked.plant, setup.climber, setup.scene, errors, faults)


class ClimbSession:
    """A climb, prepared: what is wrong with its request shows here, before anything is written.

        ClimbSession(ClimbRequest(), ClimbHooks(progress=print)).run(folder)

    Args:
        request: what is asked for. hooks: who is told and asked meanwhile.

    Raises:
        What :func:`setup_of`, files of rates, poses and plans, and texts raise.
    """

    def __init__(self, request: ClimbRequest, hooks: ClimbHooks | None = None) -> None:
        validation.instance("request", request, ClimbRequest, "a ClimbRequest")
        self.hooks = hooks or ClimbHooks()
        tell = self.hooks.progress
        self.setup = replace(setup_of(request), told=lambda text: tell(f"planning: {text}", None))
        self._source, self._plant = source_of(self.setup, self.hooks.twists), plant_of(self.setup)
        self._ending, self._rests, self._told = "", np.inf, -np.inf

    def run(self, folder: pathlib.Path | None = None, checked: bool = True, backend: str = "auto") -> ClimbDone:
        """Plan, carry out and check.

        Args:
            folder: gets what was asked for, the plan and the log while they come, so that nothing is lost when the
                program is killed; None: nothing is written. checked: whether the checker looks at it.
            backend: as of ``Stack.compile``.

        Raises:
            NoStancesError, InfeasibleError: there is no plan. LogFileError: the folder cannot be written. What the
            plant raises.
        """
        setup, tell = self.setup, self.hooks.progress
        if folder is not None:
            begin_folder(folder, setup.request)
        tell("planning", None)
        begun = time.process_time()
        first = self._source.plan()
        planning = time.process_time() - begun
        if folder is not None:
            save_plan(first, folder / PLAN)
        tell("compiling", None)
        source, plant = self._source, self._plant
        delay = 0.0 if plant is None else plant.errors.delay
        loop = ClimbLoop(first, plant, replan=source.replan, onward=source.onward, delay=delay, backend=backend)
        if self.hooks.compiled is not None:
            validation.called("compiled", self.hooks.compiled, loop.controller)
        if self.hooks.ask is not None:
            loop.approve = lambda move: self._approved(loop, move)
        self._lasts = float(first.times[-1]) if source.lasts is None else source.lasts
        begun = time.process_time()
        with contextlib.nullcontext() if folder is None else loop.recorded(folder / PART):
            run = loop.run(2.0 * self._lasts + MOST_AFTER, self._before_tick)
        looping = time.process_time() - begun
        if folder is not None:
            save(run.log, folder, "npz")
            (folder / PART).unlink()
        report = None
        if checked and len(run.log) > 1:
            tell("checking", None)
            rules = rules_of(setup.request, setup.scene, setup.climber.body_pose(first.q[0]))
            if self.hooks.twists is not None:
                rules = replace(rules, speed=None, turn_rate=None)
            report = check(run.log, setup.climber, run.scene, rules)
        return ClimbDone(setup.request, first, run, report, planning, looping, "; ".join(source.notes))

    def _before_tick(self, loop: ClimbLoop) -> None:
        if not self._ending and self.hooks.stop():
            self._end(loop, "interrupted")
        if self._ending and (loop.still or loop.time > self._rests):
            loop.end(self._ending)
            return
        if loop.time >= self._told + TOLD:
            self._told = loop.time
            part = None if self._lasts == np.inf else min(loop.time / max(self._lasts, 1e-9), 1.0)
            self.hooks.progress("walking", part)
        self._source.before_tick(loop)

    def _end(self, loop: ClimbLoop, reason: str) -> None:
        """It comes to rest, and ends there."""
        self._ending, self._rests = reason, loop.time + RESTING
        loop.stop(reason)

    def _approved(self, loop: ClimbLoop, move: ContactMove) -> str | None:
        """What the one who is asked says to a move."""
        if self._ending or self.hooks.ask is None:
            return None
        text = loop.plan.told(move)
        refused, loop.refused = loop.refused, ""
        answer = self.hooks.ask(text, refused)
        if answer is None:
            self._end(loop, f"nobody said yes to {text}")
        return answer


def climb(
    request: ClimbRequest,
    folder: pathlib.Path | None = None,
    checked: bool = True,
    backend: str = "auto",
    hooks: ClimbHooks | None = None,
) -> ClimbDone:
    """Plan, carry out and check a climb; arguments as of :class:`ClimbSession`.

    Raises:
        What that raises.
    """
    return ClimbSession(request, hooks).run(folder, checked, backend)


def check_folder(folder: pathlib.Path) -> tuple[ClimbReport, bool]:
    """The check of the run in a folder, and whether it came to its end.

    Raises:
        LogFileError: there is no run, or one that was ended before it moved. What :func:`setup_of` raises.
    """
    request, log = read_folder(folder), wbc.log.load(folder)
    climber = climber_of(request.climber)
    whole = scene_of(request.scene, climber).scene
    names = log.meta["footholds"]
    later = [foothold for foothold in whole.footholds if foothold.id not in set(names)]
    scene = replace(whole, footholds=[*(whole.footholds[whole.row(name)] for name in names), *later])
    rules = rules_of(request, scene, climber.body_pose(log.array("q")[0]))
    return check(log, climber, scene, rules), not (folder / PART).is_file()


def rules_of(request: ClimbRequest, scene: ClimbScene, begins: pin.SE3) -> CheckRules:
    """What a run is to keep on the plant of a request; on the kinematic one also what was asked: a path's largest speed
    and turn rate, or the largest of a drive whose rates are texts or a file that is still there, where it begins at
    rest.

    Args:
        begins: where the body begins.

    Raises:
        What files of rates raise.
    """
    if request.plant.plant != KINEMATIC:
        return CheckRules.by_torques()
    mode, speed, turn_rate = request.mode, 0.0, 0.0
    if request.earlier is not None:
        return CheckRules()
    if isinstance(mode, PathRequest) and mode.speed and not mode.plan:
        speed, turn_rate = mode.speed, mode.turn_rate
    elif isinstance(mode, DriveRequest) and (mode.rate or pathlib.Path(mode.commands).is_file()):
        given = (read_twists(mode.commands) if mode.commands else twists_of(mode.rate)).twists
        turned = np.array([round_surface(scene, begins, twist) for twist in given])
        speed, turn_rate = (float(np.linalg.norm(part, axis=1).max()) for part in np.split(turned, 2, axis=1))
    else:
        return CheckRules()
    jumps = max(BODY_JUMP, CHANGE * speed), max(BODY_JUMP_TURN, CHANGE * turn_rate)
    return CheckRules(speed=speed, turn_rate=turn_rate, jump=jumps[0], jump_turn=jumps[1])
