"""Joint paths that follow a path of poses, with the tasks and constraints of a stack."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.ik.continuation import Tracker
from wbc.ik.engine import SearchEngine
from wbc.multibody import pin
from wbc.stack.declaration import Declaration
from wbc.tasks import EndEffector
from wbc.trajectory.paths.path import Path, PolynomialPath
from wbc.validation import Array

#: The pose's errors at the samples [m, rad], far below any tolerance: a law's jerk sees the spline's third derivative
CLOSEST = 1e-9

#: Samples that a path may have
MOST = 4000


@dataclass(frozen=True, eq=False)
class Followed:
    """A joint path, and how well it follows.

    Attributes:
        path: joint coordinates over the same s.
        error: largest distance of the followed frame from the pose, between samples too (position [m]; angle [rad]).
        samples: configurations that it was made from.
    """

    path: PolynomialPath
    error: tuple[float, float]
    samples: int


def follow(
    stack: Declaration,
    poses: Path,
    start: Any,
    task: str,
    tolerance: float = 1e-5,
) -> Followed:
    """Configurations q(s) with the frame of a task at pose(s), and everything else as the stack wants it there.

        q(s) = the configuration at which the stack comes to rest with the task's target at pose(s),

    found from the one before, so that the branch stays. The other tasks (elbow, posture) decide what the pose leaves
    open, the constraints (limits, obstacles) hold. A cubic spline through so many q(s) that between them the frame is
    within the tolerance of pose(s).

    Args:
        stack: its joints have one coordinate each.
        poses: a path with ``space`` "poses".
        start: configuration from which the first one is searched [nq].
        task: name of an EndEffector of kind "pose" in the stack. Its weight is raised above all others.
        tolerance: for positions [m], and for angles over the stack's length [rad].

    Raises:
        UnknownNameError: no such task. ShapeError: a path of joints, or a robot with joints of several coordinates.
        InfeasibleError: poses that cannot be reached; ``value`` is the s where that begins, and the message names what
            binds.
        ContinuityError: the configurations jump; ``value`` is the s where they do, and the message names the joint.
        RangeError: the tolerance asks for more than :data:`MOST` samples.

    Cannot do: choose another branch than the one that it is on; go on where a limit has to be passed by a detour.
    """
    tolerance = validation.scalar("tolerance", tolerance, low=0.0, open_low=True, unit="m")
    seeker = _Seeker(stack, poses, task, tolerance)
    tracker, first = seeker.begin(stack.robot.configuration("start", start))
    s = np.linspace(poses.knots[0], poses.knots[-1], 33)
    s = np.unique(np.concatenate([s, poses.knots]))
    q = [tracker.at(s[0], first)]
    for before, here in itertools.pairwise(s):
        q.append(tracker.go(before, here, q[-1]))
    at, found = s, np.array(q)
    while True:
        path = _spline(at, found)
        middle = 0.5 * (at[:-1] + at[1:])
        bad, error = seeker.errors(path, middle)
        if not bad.any():
            return Followed(path, error, len(at))
        if len(at) + bad.sum() > MOST:
            raise RangeError(
                "tolerance", tolerance, f"needs more than {MOST} samples; the error is {max(error):.2g} now"
            )
        more = middle[bad]
        new = [tracker.go(a, m, x) for a, m, x in zip(at[:-1][bad], more, found[:-1][bad], strict=True)]
        order = np.argsort(np.concatenate([at, more]), kind="stable")
        at = np.concatenate([at, more])[order]
        found = np.concatenate([found, np.array(new)])[order]


class _Seeker:
    """Configurations at one pose after the other, and how far the frame is off between them."""

    def __init__(self, stack: Declaration, poses: Path, task: str, tolerance: float) -> None:
        validation.instance("stack", stack, Declaration, "a wbc Stack")
        if validation.instance("poses", poses, Path, "a path of poses").space != "poses":
            raise ShapeError("poses", poses.space, "expected a path of poses")
        if stack.robot.nq != stack.robot.nv:
            raise ShapeError(
                "stack.robot", stack.robot.name, "has joints of several coordinates; a path needs one each"
            )
        names = [e.name for e in stack.tasks if isinstance(e.item, EndEffector) and e.item.kind == "pose"]
        validation.one_of("task", task, names)
        self.poses, self.robot, self.data = poses, stack.robot, stack.robot.model.createData()
        self.near, self.turned = tolerance, tolerance / stack.length
        self.engine = SearchEngine(stack, (task,), "auto")
        self.handle = self.engine.controller[task]
        item = stack[task].item
        assert isinstance(item, EndEffector)
        self.frame = self.robot.model.getFrameId(item.frame)

    def begin(self, start: Any) -> tuple[Tracker, Array]:
        """A tracker that begins at a configuration. What nobody has set, as the posture's target, is taken from it."""
        first = self.engine.begin(start)
        return Tracker(self.engine, self.aim, CLOSEST), first

    def aim(self, s: float) -> None:
        """The target becomes pose(s)."""
        self.handle.target = self.poses.evaluate(np.array([s]))[0]

    def off(self, s: float, q: Array) -> tuple[float, float]:
        """Distance [m] and angle [rad] of the frame from pose(s), by Pinocchio."""
        pin.framesForwardKinematics(self.robot.model, self.data, q)
        error = pin.SE3(self.poses.evaluate(np.array([s]))[0]).actInv(self.data.oMf[self.frame])
        return float(np.linalg.norm(error.translation)), float(np.linalg.norm(pin.log3(error.rotation)))

    def errors(self, path: PolynomialPath, at: Array) -> tuple[np.ndarray, tuple[float, float]]:
        """Which points are off by more than the tolerance, and by how much they are off at worst."""
        found = np.array([self.off(s, q) for s, q in zip(at, path.evaluate(at), strict=True)])
        bad = (found[:, 0] > self.near) | (found[:, 1] > self.turned)
        return bad, (float(found[:, 0].max()), float(found[:, 1].max()))


def _spline(s: Array, q: Array) -> PolynomialPath:
    """The cubic spline through configurations, with two continuous derivatives."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(s, q)
    return PolynomialPath(spline.x, spline.c)
