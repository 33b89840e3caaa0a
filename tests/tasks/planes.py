"""Arms, planes and their angles by Pinocchio, for the tests of PitchPlane.

The referee uses the shortest rotation from the pole to the line as a quaternion, not the reflections of the
expressions under test.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pinocchio as pin

import wbc.robots
from tests import models
from tests.evaluation import quick
from wbc.robot import Robot
from wbc.symbolic import Kinematics, Tracer
from wbc.tasks._plane import PlaneItem
from wbc.tasks._stereographic import PlaneReference
from wbc.tasks.pitch_plane import PitchPlane
from wbc.tasks.pitch_plane_limit import PitchPlaneLimit

TILTED = PlaneReference(pole=(0.3, -0.2, 0.9), direction=(1.0, 0.5, 0.0))


def equal_arm() -> Robot:
    """Equal links, so that the wrist can reach the shoulder."""
    return models.spherical_seven(0.4, 0.4)


def unequal_arm() -> Robot:
    """A short forearm, so that the folded arm's wrist stays away from the shoulder."""
    return models.spherical_seven(0.42, 0.25)


ROBOTS: dict[str, Callable[[], Robot]] = {
    "panda": lambda: wbc.robots.load("panda"),
    "spherical": models.spherical_seven,
    "equal": equal_arm,
    "unequal": unequal_arm,
    "four": models.four_joint_arm,
    "ssrms": models.ssrms,
    "talos": lambda: wbc.robots.load("talos"),
}
PANDA = PitchPlane("panda_link2", "panda_link4", "panda_link6")
SPHERICAL = PitchPlane("F1", "F4", "F5")
OFFSET = PitchPlane("F3", "F4", "F5")
TALOS = PitchPlane("arm_left_2_link", "arm_left_4_link", "arm_left_6_link", base="torso_2_link")
LIMIT = PitchPlaneLimit("F1", "F4", "F5", lower=-0.5, upper=1.0)
CASES: dict[str, tuple[str, PitchPlane]] = {
    "panda": ("panda", PANDA),
    "panda, tilted reference": ("panda", replace(PANDA, reference=TILTED)),
    "panda, point on a link": ("panda", replace(PANDA, elbow_offset=(0.05, -0.1, 0.02))),
    "panda, axis": ("panda", replace(PANDA, axis="panda_joint4", reference=TILTED)),
    "spherical": ("spherical", SPHERICAL),
    "lateral offsets": ("ssrms", OFFSET),
    "lateral offsets, axis": ("ssrms", replace(OFFSET, axis="joint3", reference=PlaneReference())),
    "lateral offsets, axis, base": ("ssrms", replace(OFFSET, axis="joint3", reference=TILTED, base="F1")),
    "floating base": ("talos", TALOS),
    "floating base in the world": ("talos", replace(TALOS, base="world", reference=TILTED)),
}


@functools.cache
def robot(name: str) -> Robot:
    return ROBOTS[name]()


@functools.cache
def compiled(name: str, item: PlaneItem) -> ca.Function:
    """(q, target) -> value, Jacobian, factor; value is the error of a task or the margins of a limit."""
    item.validate(robot(name))
    kin, target = Tracer(Kinematics(robot(name).model)), ca.SX.sym("target")
    given = {"target": target}
    own = None
    if isinstance(item, PitchPlane):
        value = item.error(robot(name), kin, given)
        own = item.jacobian(robot(name), kin, given)
    else:
        assert isinstance(item, PitchPlaneLimit)
        value = item.margins(robot(name), kin, given)
    jacobian = kin.jacobian(value) if own is None else kin.expand(own)
    drift = ca.jacobian(value, target)
    factor = item.row_factor(robot(name), kin, given)
    outputs = [kin.expand(value), ca.densify(jacobian), kin.expand(factor), kin.expand(ca.densify(drift))]
    return ca.Function("item", [kin.q, target], ca.cse(outputs))


@functools.cache
def quickly(name: str, item: PlaneItem) -> Callable[..., tuple[np.ndarray, ...]]:
    return quick(compiled(name, item))


def evaluate(name: str, item: PlaneItem, q: np.ndarray, target: float = 0.0) -> tuple[np.ndarray, ...]:
    value, jacobian, factor, _ = quickly(name, item)(q, target)
    return value.ravel(), jacobian, factor.ravel()


def wrap(angle: float) -> float:
    return float(np.arctan2(np.sin(angle), np.cos(angle)))


@dataclass
class Seen:
    """The plane of an arm from Pinocchio's poses, base axes."""

    line: np.ndarray
    direction: np.ndarray
    psi: float


def shortest(pole: np.ndarray, line: np.ndarray) -> np.ndarray:
    return pin.Quaternion.FromTwoVectors(pole, line).matrix()


def seen(name: str, item: PlaneItem, q: np.ndarray) -> Seen:
    model = robot(name).model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    named = ((item.shoulder, item.shoulder_offset), (item.elbow, item.elbow_offset), (item.wrist, item.wrist_offset))
    s, e, w = (data.oMf[model.getFrameId(f)].act(np.array(o)) for f, o in named)
    line, direction = w - s, e - s
    if item.axis is not None:
        joint = model.getJointId(item.axis)
        motion = data.oMi[joint].act(pin.Motion(np.array(model.joints[joint].createData().S).ravel()))
        axis = motion.angular
        line = line - axis * (axis @ line)
        direction = np.cross(line, axis)
    if item.base != "world":
        turn = data.oMf[model.getFrameId(item.base)].rotation.T
        line, direction = turn @ line, turn @ direction
    line = line / np.linalg.norm(line)
    reference = item.reference if item.reference is not None else PlaneReference()
    zero = shortest(np.array(reference.pole), line) @ np.array(reference.direction)
    psi = np.arctan2(line @ np.cross(zero, direction), zero @ direction)
    return Seen(line, direction, float(psi))


def states(name: str, count: int, seed: int = 0) -> np.ndarray:
    """Random configurations, joints within +-pi, floating base anywhere."""
    model = robot(name).model
    rng = np.random.default_rng(seed)
    tangent = rng.uniform(-np.pi, np.pi, (count, model.nv))
    return np.array([pin.integrate(model, pin.neutral(model), t) for t in tangent])


def clear(name: str, item: PlaneItem, count: int, seed: int = 0) -> list[np.ndarray]:
    """Random configurations where nothing fades."""
    found = [q for q in states(name, 8 * count, seed) if evaluate(name, item, q)[2].min() == 1.0]
    assert len(found) >= count
    return found[:count]


def angle_differs(name: str, item: PlaneItem) -> float:
    """Largest difference between the angle under test and the referee's."""
    out = 0.0
    for q in clear(name, item, 20, seed=1):
        for target in (0.0, 1.3, -3.0):
            got = evaluate(name, item, q, target)[0][0]
            assert -np.pi <= got <= np.pi
            out = max(out, abs(wrap(got - seen(name, item, q).psi + target)))
    return out
