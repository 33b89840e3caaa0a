"""Closed loops of limits on frames and tasks: a posture task pulls all joints to where a quantity is past its limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.closed_loop.eyes import Array, Eyes, length
from tests.closed_loop.limit_trials import AXIS, NORMALS, POINT, Maker, Trial, axis_cone, gaze, point, sided, walls
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import anywhere, machine, near
from tests.repeats import repeats
from tests.tasks.robots import FRAMES, Frames
from wbc.robot import Robot
from wbc.tasks import (
    AxisCone,
    CenterOfMass,
    Constraint,
    Distance,
    Elbow,
    EndEffector,
    GazeCone,
    Item,
    JointLimits,
    Limit,
    PitchPlane,
    Posture,
    WorkspaceBox,
    WorkspacePolyhedron,
)

DT, RATE, TICKS = 0.01, 20.0, 60

Figures = dict[str, float]


@dataclass(frozen=True, eq=False)
class Guard:
    """A constraint, how it is declared, and its trials."""

    cls: type[Constraint]
    declare: Callable[[Frames, Robot], Item]
    trial: Maker


def distance(eyes: Eyes, f: Frames, q: Array) -> Array:
    """Distance of a point of the tip from the origin of the moving frame."""
    return np.array([length(point(eyes, q, f.tip, POINT, f.base))])


def plane_is_clear(eyes: Eyes, f: Frames, q: Array) -> bool:
    """Angles of the plane well away from where they wrap, and where the task does not fade."""
    return eyes.plane_is_clear(q, f.plane) and abs(eyes.plane_angle(q, f.plane)) < 2.0


def plane_bend(loop: Loop, before: Array, after: Array, v: Array) -> float:
    """The plane's angle has no simple bound on its curvature: measured on these robots at these speeds [rad]."""
    return 1e-3


GUARDS: dict[str, Guard] = {
    "box": Guard(
        WorkspaceBox,
        lambda f, robot: WorkspaceBox(f.tip, lower=-5.0, upper=5.0, offset=POINT),
        sided(lambda eyes, f, q: point(eyes, q, f.tip, POINT, "world")),
    ),
    "box on a moving frame": Guard(
        WorkspaceBox,
        lambda f, robot: WorkspaceBox(f.tip, lower=-5.0, upper=5.0, relative_to=f.base, offset=POINT),
        sided(lambda eyes, f, q: point(eyes, q, f.tip, POINT, f.base)),
    ),
    "walls": Guard(WorkspacePolyhedron, lambda f, robot: WorkspacePolyhedron(f.tip, NORMALS, offset=POINT), walls),
    "cone": Guard(AxisCone, lambda f, robot: AxisCone(f.tip, 1.0, axis=tuple(AXIS)), axis_cone(lambda f: "world")),
    "cone on a moving frame": Guard(
        AxisCone,
        lambda f, robot: AxisCone(f.tip, 1.0, axis=tuple(AXIS), relative_to=f.base),
        axis_cone(lambda f: f.base),
    ),
    "view": Guard(
        GazeCone,
        lambda f, robot: GazeCone(f.tip, 1.0, axis=tuple(AXIS), apex=POINT),
        gaze(lambda f: f.tip, lambda f: "world"),
    ),
    "view of a moving frame": Guard(
        GazeCone,
        lambda f, robot: GazeCone(f.base, 1.0, axis=tuple(AXIS), apex=POINT, point_frame=f.tip),
        gaze(lambda f: f.base, lambda f: f.tip),
    ),
    "limit of a place": Guard(
        Limit,
        lambda f, robot: Limit(
            EndEffector(f.tip, kind="position", relative_to=f.base), lower=-5.0, upper=5.0, only=("z", "x")
        ),
        sided(lambda eyes, f, q: point(eyes, q, f.tip, (0, 0, 0), f.base)[[2, 0]], target=np.zeros(3)),
    ),
    "limit of an elbow": Guard(
        Limit,
        lambda f, robot: Limit(Elbow(f.middle, offset=POINT), lower=-5.0, upper=5.0),
        sided(lambda eyes, f, q: point(eyes, q, f.middle, POINT, "world"), aimed=True),
    ),
    "limit of a mass": Guard(
        Limit,
        lambda f, robot: Limit(CenterOfMass(), lower=-5.0, upper=5.0),
        sided(lambda eyes, f, q: eyes.center_of_mass(q), aimed=True),
    ),
    "limit of a distance": Guard(
        Limit,
        lambda f, robot: Limit(Distance(f.tip, f.base, offset=POINT), lower=-5.0),
        sided(distance, upper=False, target=0.0),
    ),
    "limit of a plane": Guard(
        Limit,
        lambda f, robot: Limit(PitchPlane(*f.plane), lower=-1.0, upper=1.0),
        sided(
            lambda eyes, f, q: np.array([eyes.plane_angle(q, f.plane)]),
            plane_bend,
            usable=plane_is_clear,
            open_share=0.0,
            target=0.0,
        ),
    ),
}


def build(name: str) -> Loop:
    """Every guard's item, the posture task that pulls, and limits of velocity."""
    robot = machine(name)
    items = {key: guard.declare(FRAMES[name], robot) for key, guard in GUARDS.items()}
    items |= {"rest": Posture(joints=robot.joint_names), "caps": JointLimits(acceleration=False)}
    return Loop(robot, items, DT, name)


def check(loop: Loop, name: str, seed: int = 31, starts: int = repeats(12)) -> Figures:
    """Tick by tick every margin h, by Pinocchio, is at least (1 - rate dt) h - curvature of the tick before; none falls
    below zero by more than curvature allows, here 2 mm or mrad; and most trials end at the limit.
    """
    guard, rng = GUARDS[name], np.random.default_rng(seed)
    loop.only(name, "rest", "caps")
    loop["caps"].velocity_scale, loop["rest"].gain, loop["rest"].weight = 0.5, 5.0, 1.0
    figures = {"deepest": np.inf, "excess": -np.inf, "at the limit": 0.0, "clear": 0.0, "unsolved": 0.0}
    found = drawn = 0
    while found < starts:
        drawn += 1
        assert drawn < 60 * starts, "hardly any start and goal of use"
        q = anywhere(loop.robot, rng)
        goal = near(loop.robot, rng, q, 0.8)
        trial = guard.trial(loop, q, goal, rng, bool(found % 2))
        if trial is None or trial.margins(q, 0.0).min() < 0:
            continue

        def aim(k: int, _: Array, trial: Trial = trial) -> None:
            loop[name].set(**trial.values(k * loop.dt))

        aim(0, q)
        loop["rest"].target = goal
        run = loop.run(q, TICKS, before=aim if found % 2 else None)
        found += 1
        figures["unsolved"] += run.unsolved
        if not all(trial.clear(x) for x in run.q):
            continue
        figures["clear"] += 1
        h = np.array([trial.margins(x, k * loop.dt) for k, x in enumerate(run.q)])
        allowed = np.array([trial.curvature(*x) for x in zip(run.q[:-1], run.q[1:], run.v, strict=True)])
        with np.errstate(invalid="ignore"):
            short = np.nan_to_num((1 - RATE * loop.dt) * h[:-1] - h[1:], nan=-np.inf)
        figures["deepest"] = min(figures["deepest"], float(h.min()))
        figures["excess"] = max(figures["excess"], float((short - allowed[:, None]).max()))
        figures["at the limit"] += bool(h[-1].min() < 3e-3)
        assert figures["excess"] < 1e-9, figures
        assert figures["deepest"] > -2e-3, figures
    assert figures["unsolved"] == 0, figures
    assert figures["clear"] > 0.8 * starts, figures
    assert figures["at the limit"] > 0.6 * figures["clear"], figures
    return figures
