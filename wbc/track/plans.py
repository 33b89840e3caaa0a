"""Parts of a plan from what a user names: the path, the elbow plane's command, and feet that stand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from wbc import validation
from wbc.errors import UnknownNameError, WbcError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.track.path import ApproachedPath, TimedPath
from wbc.track.path_file import SUFFIXES, read_path
from wbc.track.presets import PRESETS, preset
from wbc.track.setup import ElbowSwing, MovingObstacle
from wbc.validation import Array

#: Least time of an approach to a path's first pose [s]
APPROACH_TIME = 0.5
#: Speed of an approach [m/s]
APPROACH_SPEED = 0.25
#: Turn rate of an approach [rad/s]
APPROACH_TURN = 1.0


def followed(
    robot: Robot, tip: str, q: Array, path: str, duration: float | None, size: float | None
) -> tuple[TimedPath, dict[str, MovingObstacle], str]:
    """(path, obstacles that belong to it, label). A file's path begins with an approach to its first waypoint.

    Raises:
        UnknownNameError: neither a preset nor a path file. WbcError: a bad file or number.
    """
    here: pin.SE3 = robot.pose(q, tip)
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
    away = pin.log6(here.actInv(timed.sample(0.0).pose))
    label = Path(path).stem
    if float(np.abs(away.vector).max()) < 1e-9:
        return timed, {}, label
    far, turn = float(np.linalg.norm(away.linear)), float(np.linalg.norm(away.angular))
    time = max(APPROACH_TIME, far / APPROACH_SPEED, turn / APPROACH_TURN)
    return ApproachedPath(here, timed, time), {}, label


def plane_command(robot: Robot, plane: str, swing: float) -> ElbowSwing | None:
    """The command of the elbow plane that an option means."""
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
