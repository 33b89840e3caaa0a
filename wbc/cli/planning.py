"""What ``wbc track``, ``wbc export`` and ``wbc ik`` take, and the plan that their options make."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import robots, shapes, validation
from wbc.errors import ShapeError, UnknownNameError, WbcError
from wbc.robot import Robot
from wbc.track.path import Approach, TimedPath
from wbc.track.path_file import SUFFIXES, read_path
from wbc.track.presets import PRESETS, preset
from wbc.track.setup import ElbowSwing, MovingObstacle, PathRun
from wbc.validation import Array

PLANES = ("auto", "off", "hold", "swing")


def planned(
    robot: str,
    frame: str | None,
    start: str | None,
    hold: list[str] | None,
    obstacles: dict[str, MovingObstacle],
    *,
    follow: tuple[str, float | None, float | None] = ("circle", None, None),
    plane: tuple[str, float] = ("off", 0.0),
    rate: float = 200.0,
    **settings: Any,
) -> PathRun:
    """The plan that options mean. A plan has a path, on which its stack does not depend.

    Args:
        obstacles: beside those of the path. follow: path, duration [s] and size [m], see :func:`scene`.
        plane: what to do with the elbow plane, and the amplitude of its swing [rad]. rate: commands a second.
        settings: fields of the plan as they are.

    Raises:
        WbcError: an option that is not valid.
    """
    machine = robots.load(robot)
    frequency = validation.scalar("rate", rate, low=0.0, open_low=True, unit="Hz")
    tip = tip_frame(machine, frame)
    first = machine.neutral if start is None else configuration(machine, start)
    path, own, label = scene(machine, tip, first, *follow)
    return PathRun(
        machine,
        tip,
        path,
        label,
        first,
        dt=1.0 / frequency,
        obstacles=own | obstacles,
        plane=plane_command(machine, *plane),
        holds=tuple(hold) if hold else feet(machine),
        **settings,
    )


def tip_frame(robot: Robot, frame: str | None) -> str:
    """The frame to move.

    Raises:
        UnknownNameError: no such frame. WbcError: none given, and the table knows no tip of this robot.
    """
    if frame is not None:
        return robot.check_frame("frame", frame)
    for role in ("tip", "right_hand", "left_hand"):
        if role in robot.frames:
            return robot.frames[role]
    raise WbcError("frame", None, f"the table knows no tip of {robot.name}; choose with --frame", robot.frame_names[1:])


def configuration(robot: Robot, text: str) -> Array:
    """A configuration from numbers with commas."""
    return robot.configuration("start", comma_numbers("start", text))


def scene(
    robot: Robot, tip: str, q: Array, path: str, duration: float | None, size: float | None
) -> tuple[TimedPath, dict[str, MovingObstacle], str]:
    """(path, obstacles that belong to it, label). A file's path begins with an approach to its first waypoint.

    Raises:
        UnknownNameError: neither a preset nor a path file. WbcError: a bad file or number.
    """
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    here = data.oMf[robot.model.getFrameId(tip)].copy()
    if path in PRESETS:
        found = preset(path, here, 6.0 if duration is None else duration, size)
        parts = enumerate(found.obstacles)
        return found.path, {f"ball{k or ''}": MovingObstacle(s, pin.SE3(np.eye(3), p)) for k, (s, p) in parts}, path
    if not path.lower().endswith(SUFFIXES) and "/" not in path:
        raise UnknownNameError("path", path, PRESETS)
    if size is not None:
        raise WbcError("size", size, "belongs to a preset, not to a path file", PRESETS)
    timed = read_path(path)
    if duration is not None:
        timed = timed.stretched(validation.scalar("duration", duration, low=0.0, open_low=True, unit="s"))
    first = timed.sample(0.0).pose
    away = pin.log6(here.actInv(first))
    label = Path(path).stem
    if float(np.abs(away.vector).max()) < 1e-9:
        return timed, {}, label
    # Half a second, or as long as 0.25 m/s and 1 rad/s need
    time = max(0.5, float(np.linalg.norm(away.linear)) / 0.25, float(np.linalg.norm(away.angular)))
    return Approach(here, timed, time), {}, label


def given_obstacles(sphere: list[str] | None, floor: float | None) -> dict[str, MovingObstacle]:
    """Obstacles by name, as their options say."""
    out = {f"sphere{k}": parse_sphere(text) for k, text in enumerate(sphere or (), 1)}
    if floor is not None:
        height = validation.scalar("floor", floor, unit="m")
        out["floor"] = MovingObstacle(shapes.HalfSpace(), pin.SE3(np.eye(3), np.array([0.0, 0.0, height])))
    return out


def parse_sphere(text: str) -> MovingObstacle:
    """An obstacle from X,Y,Z,RADIUS[,VX,VY,VZ]."""
    numbers = comma_numbers("sphere", text)
    if len(numbers) not in (4, 7):
        raise ShapeError("sphere", text, "expected X,Y,Z,RADIUS or X,Y,Z,RADIUS,VX,VY,VZ")
    velocity = numbers[4:] if len(numbers) == 7 else np.zeros(3)
    return MovingObstacle(shapes.Sphere(float(numbers[3])), pin.SE3(np.eye(3), numbers[:3]), velocity)


def plane_command(robot: Robot, plane: str, swing: float) -> ElbowSwing | None:
    """The command of the elbow plane that an option means."""
    validation.one_of("plane", plane, PLANES)
    known = all(role in robot.frames for role in ("shoulder", "elbow", "wrist"))
    # Six joints have none to spare for the elbow once the hand has its pose
    if plane == "off" or (plane == "auto" and not (known and robot.nv > 6)):
        return None
    amplitude = validation.scalar("swing", swing, low=-math.pi, high=math.pi, unit="rad")
    return ElbowSwing(amplitude if plane == "swing" else 0.0)


def feet(robot: Robot) -> tuple[str, ...]:
    """Frames that a floating robot stands on, as far as the table knows them."""
    if robot.base != "floating":
        return ()
    return tuple(frame for role, frame in robot.frames.items() if role.endswith("foot"))


def comma_numbers(field: str, text: str) -> Array:
    """Numbers with commas between them.

    Raises:
        ShapeError, NotFiniteError: it is something else.
    """
    try:
        return validation.real_array(field, [float(part) for part in text.split(",")])
    except ValueError as error:
        raise ShapeError(field, text, "expected numbers with commas between them") from error
