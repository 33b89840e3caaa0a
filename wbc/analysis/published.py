"""Sets of coordinates that the literature on operators' arms names, and its symbols for lengths.

Source: E. Dupuis, PhD thesis, McGill University, 2001, chapters 3 and 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from wbc import validation
from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows, Rows
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robots import operator_arm

#: Frames across whose second axis, in SSRMS, or third one, in SPDM, the pitch joints turn
_PITCH = {"spherical_4r": 1, "ssrms_simplified": 1, "ssrms": 1, "spdm_arm_simplified": 2, "spdm_arm": 2}
_SYMBOLS: dict[str, dict[str, float]] = {
    "planar_3r": {"L1": 1.0, "L2": 0.8, "L3": 0.5},
    "spherical_4r": {"L3": 1.0, "L4": 0.8},
    "ssrms_simplified": {"L": 7.11},
    "ssrms": {"L": 7.11, "D": -0.7026, "Y3": -1.0442, "Y5": -0.5692, "X7": 1.3589},
    "spdm_arm_simplified": {"L": 1.0, "D": 0.2},
    "spdm_arm": {"L": 1.0, "D": 0.2},
}
#: Robots that have sets
ROBOTS = tuple(_SYMBOLS)


@dataclass(frozen=True, eq=False)
class PublishedSets:
    """A robot with the task and the constraint sets that were studied on it.

    Attributes:
        robot: with all frames that the rows need. symbols: the source's names of lengths [m].
        task: the rows of the task. sets: name -> constraint rows.
    """

    robot: Robot
    symbols: Mapping[str, float]
    task: tuple[Rows, ...]
    sets: Mapping[str, tuple[Rows, ...]]


def published_sets(name: str) -> PublishedSets:
    """The sets of a robot.

    Raises:
        UnknownNameError: no published sets for it.
    """
    return _published(validation.one_of("robot", name, ROBOTS))


@cache
def _published(name: str) -> PublishedSets:
    robot = operator_arm(name).robot
    if name == "planar_3r":
        middle = robot.with_frame("middle", "F2", pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0])))
        tip, half = (BodyRows(f, expressed="F3", translation=(0, 1), rotation=()) for f in ("tip", "middle"))
        return PublishedSets(middle, _SYMBOLS[name], (tip,), {"middle": (half,)})
    beta = _in_plane("F3", "F2", _PITCH[name], "beta")
    elbow = BodyRows("end3", rotation=(), name="elbow")
    if name == "spherical_4r":
        alpha = PitchPlaneRows("F3", "tip")
        sets: dict[str, tuple[Rows, ...]] = {
            "elbow": (elbow,),
            "alpha": (alpha,),
            "alpha, beta": (alpha, beta),
            "elbow, beta": (elbow, beta),
        }
        return PublishedSets(robot, _SYMBOLS[name], (BodyRows("tip", rotation=()),), sets)
    alpha, gamma = PitchPlaneRows("F3", "F5"), _in_plane("F5", "F6", _PITCH[name], "gamma")
    roll, yaw, twist = (JointRows(f"joint{k}", name=f"q{k}") for k in (1, 2, 7))
    sets = {"q1": (roll,), "q2": (yaw,), "q1, q2": (roll, yaw), "alpha": (alpha,)}
    if name.startswith("spdm"):
        sets |= {"alpha, q1, q7": (alpha, roll, twist), "alpha, q1, q7, elbow": (alpha, roll, twist, elbow)}
    else:
        sets |= {"elbow, beta, gamma": (elbow, beta, gamma)}
    return PublishedSets(robot, _SYMBOLS[name], (BodyRows("tip"),), sets)


def candidate_rows(name: str) -> dict[str, Rows]:
    """The constraints that the sets of a robot with a pitch plane are made of, and a lock of every joint.

    Raises:
        UnknownNameError: no published sets for it, or no pitch plane.
    """
    validation.one_of("robot", name, _PITCH)
    joints = operator_arm(name).robot.nv
    wrist = "F5" if joints == 7 else "tip"
    out: dict[str, Rows] = {
        "elbow": BodyRows("end3", rotation=(), name="elbow"),
        "alpha": PitchPlaneRows("F3", wrist),
        "beta": _in_plane("F3", "F2", _PITCH[name], "beta"),
    }
    if joints == 7:
        out["gamma"] = _in_plane("F5", "F6", _PITCH[name], "gamma")
    return out | {f"q{k}": JointRows(f"joint{k}", name=f"q{k}") for k in range(1, joints + 1)}


def _in_plane(frame: str, body: str, pitch: int, name: str) -> BodyRows:
    """Angular velocity of a body about the pitch axis of a frame."""
    return BodyRows(body, expressed=frame, translation=(), rotation=(pitch,), name=name)
