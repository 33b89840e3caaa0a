"""Built-in scenarios: maps of what a hand reaches and of how well it moves, sets of inverse kinematics, walks."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from wbc import robots, validation
from wbc.api import Stack
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.tasks import EndEffector, JointLimits
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.climb import Climber, ClimbScene
    from wbc.ik import InverseKinematics
    from wbc.robot import Robot

#: Most rows of one trial
MOST = 10**6


class Reach(TypedDict):
    """Places [m] and whether the frame gets there."""

    x: Array
    y: Array
    z: Array
    reached: Array


class ManipulabilityResult(TypedDict):
    """Places [m], volume of the ellipsoid of velocities, and the least singular value over the greatest."""

    x: Array
    y: Array
    z: Array
    measure: Array
    conditioning: Array


class Solved(TypedDict):
    """Share of targets that are met, descents each, and time each [s]."""

    solved: float
    descents: float
    seconds: float


class LayoutResult(TypedDict):
    """Share of the holds that is left out, whether there is a plan, its re-grasps and its duration [s]."""

    removed: float
    planned: float
    regrasps: float
    duration: float


def reach(
    *,
    seed: int,
    threads: int,
    robot: str = "panda",
    frame: str = "",
    poses: int = 1000,
    radius: float = 1.0,
    restarts: int = 8,
) -> Reach:
    """Random poses in a ball, each orientation as likely as any other, sought by inverse kinematics within limits.

    Args:
        frame: what is to get there; default: the robot's tip. radius: of the ball [m]. restarts: of each search.
    """
    machine, _, kinematics = _kinematics(robot, frame)
    count = validation.integer("poses", poses, 1, MOST)
    size = validation.scalar("radius", radius, low=0.0, open_low=True, unit="m")
    rng = np.random.default_rng(seed)
    targets = np.tile(np.eye(4), (count, 1, 1))
    targets[:, :3, :3] = [pin.Quaternion(x / np.linalg.norm(x)).matrix() for x in rng.normal(size=(count, 4))]
    away = rng.normal(size=(count, 3))
    away *= (size * np.cbrt(rng.random(count)) / np.linalg.norm(away, axis=1))[:, None]
    targets[:, :3, 3] = _centre(machine) + away
    start = _middle(machine)
    found = kinematics.solve_batch(
        start, {"hand": list(targets)}, budget=None, restarts=restarts, workers=threads, nearest=False
    )
    x, y, z = targets[:, :3, 3].T
    return {"x": x, "y": y, "z": z, "reached": found.solved}


def manipulability(*, seed: int, robot: str = "panda", frame: str = "", samples: int = 1000) -> ManipulabilityResult:
    """Random configurations within limits, and there, with J scaled by the robot's characteristic length,

        measure = sqrt(det(J J')),    conditioning = s_min / s_max

    (T. Yoshikawa, Manipulability of robotic mechanisms, Int. J. Robotics Research 4(2), 1985).
    """
    machine, tip = _robot(robot, frame)
    rng, model = np.random.default_rng(seed), machine.model
    low, high = _box(machine)
    data, index = model.createData(), model.getFrameId(tip)
    scale = np.repeat([1.0 / machine.characteristic_length, 1.0], 3)[:, None]
    places, singular = [], []
    for share in rng.random((validation.integer("samples", samples, 1, MOST), machine.nq)):
        J = pin.computeFrameJacobian(model, data, low + share * (high - low), index, pin.LOCAL_WORLD_ALIGNED)
        singular.append(np.linalg.svd(scale * J, compute_uv=False))
        places.append(pin.updateFramePlacement(model, data, index).translation.copy())
    s, (x, y, z) = np.array(singular), np.array(places).T
    # Fewer than six joints have no volume in six directions
    measure = s.prod(axis=1) if s.shape[1] == 6 else np.zeros(len(s))
    return {"x": x, "y": y, "z": z, "measure": measure, "conditioning": s[:, -1] / s[:, 0]}


def ik(
    *, seed: int, threads: int, robot: str = "panda", frame: str = "", targets: int = 100, restarts: int = 100
) -> Solved:
    """Poses of random configurations within limits, sought from the middle of the limits."""
    machine, tip, kinematics = _kinematics(robot, frame)
    low, high = _box(machine)
    rng, data, index = np.random.default_rng(seed), machine.model.createData(), machine.model.getFrameId(tip)
    wanted = []
    for share in rng.random((validation.integer("targets", targets, 1, MOST), machine.nq)):
        pin.forwardKinematics(machine.model, data, low + share * (high - low))
        wanted.append(pin.updateFramePlacement(machine.model, data, index).homogeneous)
    start = _middle(machine)
    found = kinematics.solve_batch(start, {"hand": wanted}, budget=None, restarts=restarts, workers=threads)
    solved, descents, seconds = (float(np.mean(x)) for x in (found.solved, found.descents, found.seconds))
    return {"solved": solved, "descents": descents, "seconds": seconds}


def layouts(*, seed: int, least: float = 0.1, most: float = 0.6, speed: float = 0.05) -> LayoutResult:
    """The published cylinder with a random share of its holds left out, between ``least`` and ``most``, and a plan for
    the three-armed walker from a random place to another one.

    Args:
        speed: of the body [m/s].
    """
    from wbc.climb import BodyPlace, ClimbOptions, MotionOptions, NoStancesError, first_stance, plan_climb
    from wbc.climb.grids import remove_fraction
    from wbc.climb.motion import MoveError
    from wbc.climb.places import body_frames
    from wbc.climb.time_law import MotionSpeeds

    low = validation.scalar("least", least, low=0.0, high=1.0)
    high = validation.scalar("most", most, low=low, high=1.0)
    rng = np.random.default_rng(seed)
    removed = low + (high - low) * float(rng.random())
    climber, grid = _walker()
    ends = np.zeros((2, 2))
    # As far apart as a few re-grasps
    while np.hypot(*(ends[0] - ends[1])) < 6.0:
        ends = rng.integers((3, 3), (23, 22), (2, 2), endpoint=True).astype(float)
    begin, end = body_frames(climber, grid, [f"{t:g},{a:g}" for t, a in ends])
    scene, options = (
        remove_fraction(grid, removed, seed),
        ClimbOptions(motion=MotionOptions(speeds=MotionSpeeds(speed))),
    )
    try:
        start = first_stance(climber, scene, climber.with_body(climber.rest, begin))
        plan = plan_climb(climber, scene, start, BodyPlace(end.translation, end.rotation), options)
    except (NoStancesError, MoveError):
        return {"removed": removed, "planned": 0.0, "regrasps": np.nan, "duration": np.nan}
    return {
        "removed": removed,
        "planned": 1.0,
        "regrasps": float(len(plan.moves)),
        "duration": float(plan.times[-1]),
    }


@functools.lru_cache(maxsize=8)
def _robot(name: str, frame: str) -> tuple[Robot, str]:
    """A robot on a fixed base whose coordinates are joint angles and lengths, and its frame."""
    machine = robots.load(name)
    if machine.nq != machine.nv or machine.base_nv:
        raise RangeError("robot", name, "needs a fixed base and joints of one coordinate each")
    tip = frame or machine.frames.get("tip", machine.frame_names[-1])
    return machine, machine.check_frame("frame", tip)


@functools.lru_cache(maxsize=8)
def _kinematics(name: str, frame: str) -> tuple[Robot, str, InverseKinematics]:
    machine, tip = _robot(name, frame)
    stack = Stack(machine, dt=0.01)
    stack.add(EndEffector(tip), name="hand")
    stack.add(JointLimits())
    return machine, tip, stack.inverse_kinematics()


@functools.lru_cache(maxsize=1)
def _walker() -> tuple[Climber, ClimbScene]:
    from wbc.climb.grids import cylinder_grid
    from wbc.climb.machines import climber

    return climber("walker"), cylinder_grid()


def _box(robot: Robot) -> tuple[Array, Array]:
    """Limits; what has none is within half a turn, or a metre, of neutral."""
    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    half = np.where(np.array(robot.dof_units) == "rad", np.pi, 1.0)
    return (
        np.where(np.isfinite(lower), lower, robot.neutral - half),
        np.where(np.isfinite(upper), upper, robot.neutral + half),
    )


def _middle(robot: Robot) -> Array:
    low, high = _box(robot)
    return np.asarray((low + high) / 2.0)


def _centre(robot: Robot) -> Array:
    """Where the second joint sits, about which arms reach [m]."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, _middle(robot))
    return np.array(data.oMi[min(2, robot.model.njoints - 1)].translation)
