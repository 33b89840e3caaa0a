"""Joint paths that follow a path of poses, with the tasks and constraints of a stack."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.controller import Controller, Stack
from wbc.errors import ContinuityError, InfeasibleError, RangeError, ShapeError, UnknownNameError
from wbc.tasks import EndEffector
from wbc.trajectory.path import Path, PolynomialPath
from wbc.validation import Array

#: The followed pose outweighs every other task by this, so that what they want costs it next to nothing
FIRST = 1e6

#: Joints move by no more than this in a tick of the search [rad or m]
STRIDE = 0.2

#: A configuration has been found when a tick moves no joint by more than this [rad or m]
SETTLED = 1e-10

#: Ticks that a configuration may take
TICKS = 400

#: Neighbouring configurations farther apart than this [rad or m] have a jump between them if halving does not help
JUMP = 0.02

#: How often the distance of two neighbours is halved to tell a jump from a steep place
HALVINGS = 24

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
    stack: Stack,
    poses: Path,
    start: Any,
    task: str,
    tolerance: float = 1e-5,
) -> Followed:
    """Configurations q(s) with the frame of a task at pose(s), and everything else as the stack wants it there.

        q(s) = the configuration at which the stack comes to rest with the task's target at pose(s),

    found from the one before, so that the branch is kept. The other tasks (elbow, posture) decide what the pose leaves
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
    first = stack.robot.configuration("start", start)
    # Once: what nobody has set, as the posture's target, is taken from the configuration of a reset
    seeker.controller.reset(first)
    s = np.linspace(poses.knots[0], poses.knots[-1], 33)
    s = np.unique(np.concatenate([s, poses.knots]))
    q = [seeker.at(s[0], first)]
    for before, here in itertools.pairwise(s):
        q.append(seeker.go(before, here, q[-1]))
    places, found = s, np.array(q)
    while True:
        path = _spline(places, found)
        middle = 0.5 * (places[:-1] + places[1:])
        bad, error = seeker.errors(path, middle)
        if not bad.any():
            return Followed(path, error, len(places))
        if len(places) + bad.sum() > MOST:
            raise RangeError(
                "tolerance", tolerance, f"needs more than {MOST} samples; the error is {max(error):.2g} now"
            )
        more = middle[bad]
        new = [seeker.go(a, m, x) for a, m, x in zip(places[:-1][bad], more, found[:-1][bad], strict=True)]
        order = np.argsort(np.concatenate([places, more]), kind="stable")
        places = np.concatenate([places, more])[order]
        found = np.concatenate([found, np.array(new)])[order]


class _Seeker:
    """A controller that comes to rest at one pose after the other."""

    def __init__(self, stack: Stack, poses: Path, task: str, tolerance: float) -> None:
        if poses.space != "poses":
            raise ShapeError("poses", poses.space, "expected a path of poses")
        if stack.robot.nq != stack.robot.nv:
            raise ShapeError(
                "stack.robot", stack.robot.name, "has joints of several coordinates; a path needs one each"
            )
        names = [e.name for e in stack.tasks if isinstance(e.item, EndEffector) and e.item.kind == "pose"]
        if task not in names:
            raise UnknownNameError("task", task, names)
        self.stack, self.poses, self.tolerance, self.task = _timeless(stack), poses, tolerance, task
        self.controller: Controller = self.stack.compile()
        self.robot, self.data = stack.robot, stack.robot.model.createData()
        item = stack[task].item
        assert isinstance(item, EndEffector)
        self.frame = self.robot.model.getFrameId(item.frame)
        self.rest = np.zeros(self.robot.nv)
        others = [float(np.max(self.controller[e.name].weight)) for e in stack.tasks if e.name != task]
        self.controller[task].weight = FIRST * max([1.0, *others])
        for entry in stack.tasks:
            self.controller[entry.name].gain = 1.0 / stack.dt

    def pose(self, s: float) -> pin.SE3:
        """The pose that is followed."""
        return pin.SE3(self.poses.evaluate(np.array([s]))[0])

    def at(self, s: float, q: Array) -> Array:
        """Where the stack comes to rest with the target at pose(s), from a configuration nearby."""
        self.controller[self.task].target = self.pose(s)
        for _ in range(TICKS):
            step = self.controller.step(q, self.rest)
            q = np.asarray(pin.integrate(self.robot.model, q, step.v * self.stack.dt))
            if float(np.abs(step.v).max()) * self.stack.dt < SETTLED:
                break
        off, turn = self.off(s, q)
        if step.status != "solved" or off > self.tolerance or turn > self.tolerance / self.stack.length:
            names = ", ".join(f"{b.item}/{b.row}" for b in step.binding) or "nothing, the arm does not reach"
            reason = f"the pose is not reached: off by {off:.3g} m and {turn:.3g} rad; binding: {names}"
            raise InfeasibleError("poses", float(s), reason)
        return q

    def go(self, before: float, here: float, q: Array) -> Array:
        """From the configuration at one coordinate to that at the next, in steps without a jump."""
        place, step, halved = before, here - before, 0
        while place < here:
            ahead = min(place + step, here) if here - place > 1.5 * step else here
            try:
                found = self.at(ahead, q)
                moved = np.abs(found - q)
                jump = moved.max() > JUMP
                if jump and halved >= HALVINGS:
                    joint = self.robot.dof_names[int(moved.argmax())]
                    raise ContinuityError("poses", float(ahead), f"{joint} jumps by {moved.max():.3g} here")
            except InfeasibleError:
                # Halving finds the place where it begins
                if halved >= HALVINGS:
                    raise
                jump = True
            if jump:
                step, halved = 0.5 * (ahead - place), halved + 1
                continue
            if halved and moved.max() < 0.25 * JUMP:
                step, halved = 2.0 * step, halved - 1
            place, q = ahead, found
        return q

    def off(self, s: float, q: Array) -> tuple[float, float]:
        """Distance [m] and angle [rad] of the frame from pose(s), by Pinocchio."""
        pin.framesForwardKinematics(self.robot.model, self.data, q)
        error = self.pose(s).actInv(self.data.oMf[self.frame])
        return float(np.linalg.norm(error.translation)), float(np.linalg.norm(pin.log3(error.rotation)))

    def errors(self, path: PolynomialPath, places: Array) -> tuple[np.ndarray, tuple[float, float]]:
        """Which places are off by more than the tolerance, and by how much they are off at worst."""
        found = np.array([self.off(s, q) for s, q in zip(places, path.evaluate(places), strict=True)])
        bad = (found[:, 0] > self.tolerance) | (found[:, 1] > self.tolerance / self.stack.length)
        return bad, (float(found[:, 0].max()), float(found[:, 1].max()))


def _timeless(stack: Stack) -> Stack:
    """The same stack for joints that may move by :data:`STRIDE` in a tick, however fast: there is no time here."""
    robot = stack.robot.with_limits(velocity=STRIDE / stack.dt, acceleration=np.inf)
    out = Stack(robot, stack.dt, damping=stack.damping, length=stack.length, calm=stack.calm)
    for entry in stack.entries:
        if entry.name not in {e.name for e in out.entries}:
            out.add(entry.item, name=entry.name, level=entry.level, weight=entry.weight)
    return out


def _spline(s: Array, q: Array) -> PolynomialPath:
    """The cubic spline through configurations, with two continuous derivatives."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(s, q)
    return PolynomialPath(spline.x, spline.c)
