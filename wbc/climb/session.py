"""One climb from request to check: robot and scene by name or file, plan, loop, checker."""

from __future__ import annotations

import pathlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import robots, validation
from wbc.api import Controller
from wbc.climb import machines, scenes
from wbc.climb.checker import CheckRules, ClimbReport, check
from wbc.climb.climber import Climber, ClimbLimb
from wbc.climb.contacts import ContactKind, FlatFoot, GripHand, PointFoot, SuctionPad
from wbc.climb.loop import ClimbLoop, ClimbRun, LoopOptions
from wbc.climb.plan import ContactPlan
from wbc.climb.plants import ClimbPlant, PlantErrors
from wbc.climb.request import ClimbRequest
from wbc.climb.scene import ClimbScene, check_scale, read_scene
from wbc.climb.sources import source_of
from wbc.errors import ShapeError, UnknownNameError
from wbc.multibody import pin


def climber_of(request: ClimbRequest) -> Climber:
    """The robot.

    Raises:
        UnknownNameError: no such name, file or frame. What :class:`Climber` and ``wbc.robots.load`` raise.
    """
    path = pathlib.Path(request.robot)
    if not path.suffix:
        if request.limbs:
            raise ShapeError("limbs", request.limbs, f"{request.robot} has limbs of its own; name those of a file")
        return machines.climber(request.robot)
    frames = [name.strip() for text in request.limbs for name in text.split(",") if name.strip()]
    if len(frames) < 2:
        raise ShapeError("limbs", request.limbs, "give the frames at the tips of two limbs or more, with commas")
    robot = robots.load(str(path), base="floating", shapes="fit")
    if not np.isfinite(robot.limits.acceleration[robot.base_nv :]).all():
        robot = robot.with_limits(acceleration=machines.QUICK)
    kinds: dict[str, ContactKind] = {
        "point": PointFoot(request.friction), "flat": FlatFoot(friction=request.friction), "grip": GripHand(),
        "rolling-grip": GripHand(rolls=True), "suction": SuctionPad(friction=request.friction),
    }  # fmt: skip
    return Climber(machines.ready(robot), [ClimbLimb(frame, kinds[request.hold]) for frame in frames], name=path.stem)


def course_of(request: ClimbRequest, climber: Climber) -> tuple[ClimbScene, pin.SE3, pin.SE3]:
    """The scene, and frames on its surface at the start and at the goal: z outwards, x along the way.

    Raises:
        UnknownNameError: no such family, file or foothold. RangeError: a scene of another scale.
    """
    path = pathlib.Path(request.scene)
    if path.suffix:
        gravity = np.zeros(3) if request.gravity is None else np.array(request.gravity)
        scene = read_scene(path, gravity)
        needs_goal = not request.drive and not request.limb
        if request.start is None or (request.goal is None and needs_goal):
            ids = [foothold.id for foothold in scene.footholds]
            raise UnknownNameError("start" if request.start is None else "goal", None, ids)
        frames = None
    else:
        course = scenes.draw(request.scene, scenes.size_of(climber), request.seed, request.density)
        scene, frames = course.scene, (course.start, course.goal)
        if request.gravity is not None:
            scene = ClimbScene(scene.footholds, scene.bodies, np.array(request.gravity), scene.name)
    check_scale(climber, scene)
    start, goal = frames or (pin.SE3.Identity(), pin.SE3.Identity())
    if request.start is not None:
        start = scene.footholds[scene.row(request.start)].pose
    if request.goal is not None:
        goal = scene.footholds[scene.row(request.goal)].pose
    elif path.suffix:
        goal = start
    ahead = goal.translation - start.translation
    return scene, _facing(start, ahead), _facing(goal, ahead)


@dataclass(frozen=True, eq=False)
class ClimbDone:
    """A climb that was planned, carried out and checked.

    Attributes:
        plan: what was planned. run: what was done. report: its check; None: it was not checked.
        planning: processor time of the plan [s]. looping: of all ticks [s].
    """

    plan: ContactPlan
    run: ClimbRun
    report: ClimbReport | None
    planning: float
    looping: float

    @property
    def figures(self) -> dict[str, Any]:
        """Plain data: times [s], and how many times faster than the climb plan and ticks were."""
        duration = float(self.run.log["t"][-1])
        return {
            "planning": self.planning, "looping": self.looping, "loop_real_time": duration / max(self.looping, 1e-9),
            "real_time": duration / max(self.planning + self.looping, 1e-9),
        }  # fmt: skip


def climb(
    request: ClimbRequest,
    checked: bool = True,
    backend: str = "auto",
    compiled: Callable[[Controller], None] | None = None,
) -> ClimbDone:
    """Plan, carry out and check a climb.

    Args:
        compiled: called once when the controller is ready.

    Raises:
        What :func:`climber_of`, :func:`course_of`, the planner and the plant raise.
    """
    validation.instance("request", request, ClimbRequest, "a ClimbRequest")
    climber = climber_of(request)
    scene, start, goal = course_of(request, climber)
    begun = time.process_time()
    source = source_of(request, climber, scene, start, goal)
    planning = time.process_time() - begun

    plant, options, rules = None, LoopOptions(), CheckRules()
    if request.plant == "mujoco":
        errors = PlantErrors(request.slippery, request.mass_error, request.delay, request.seed)
        plant, options, rules = (
            ClimbPlant(climber, scene, errors),
            LoopOptions(delay=request.delay),
            CheckRules.by_torques(),
        )
    loop = ClimbLoop(source.first, plant, replan=source.replan, onward=source.onward, options=options, backend=backend)
    if compiled is not None:
        validation.called("compiled", compiled, loop.controller)
    begun = time.process_time()
    run = loop.run(source.most, source.before_tick)
    looping = time.process_time() - begun
    report = check(run.log, climber, run.scene, rules) if checked else None
    return ClimbDone(source.first, run, report, planning, looping)


def _facing(pose: pin.SE3, ahead: np.ndarray) -> pin.SE3:
    """A frame at a pose's place with its z axis, and x along a direction as far as z lets it."""
    z = pose.rotation[:, 2]
    x = ahead - (ahead @ z) * z
    if np.linalg.norm(x) < 1e-9:
        x = pose.rotation[:, 0]
    x = x / np.linalg.norm(x)
    return pin.SE3(np.column_stack([x, np.cross(z, x), z]), pose.translation)
