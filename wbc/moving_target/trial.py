"""One trial: a tool is brought to a place on a moving object, relative to which its path is commanded.

The path is the operator's: it says where the tool is relative to the object, and knows nothing of the object's motion.

    far -> near        a smooth step over ``approach`` seconds, from where the tool is
    near               until the tool has been within ``aligned`` for 0.25 s
    near -> goal       along the goal's z axis, over ``insert`` seconds
    goal               for ``stay`` seconds

What the controller knows of the object is one of :class:`Knowledge`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import pinocchio as pin

from wbc.controller import Controller, Stack
from wbc.estimation import DropoutPolicy, FrameMotion, PoseFilter, PoseStream, StreamState
from wbc.moving_target.motions import Motion
from wbc.robot import Robot
from wbc.simulation import Connection, Plant
from wbc.tasks import EndEffector, JointLimits, MovingFrame, Posture
from wbc.validation import Array

#: How long a tool is to be aligned before it goes in [s]
STEADY = 0.25
TOOL, GOAL = "tool of the trial", "object"


class Knowledge(StrEnum):
    """What the controller is told of the object.

    ``NONE``: where it was at first, no compensation. ``POSE``: its exact pose. ``TWIST``: and its exact twist and
    acceleration, which are fed forward. ``LATE``: measured poses as they come, late and noisy. ``ESTIMATED``: the same
    through a filter that predicts the present pose and twist.
    """

    NONE = "none"
    POSE = "pose"
    TWIST = "twist"
    LATE = "late"
    ESTIMATED = "estimated"


@dataclass(frozen=True)
class Measurement:
    """What measures the object: standard deviations [m, rad], latency [s], period [s], and how often per second
    measurements stop coming, and for how long [s].
    """

    noise: tuple[float, float] = (0.5e-3, 0.5e-3)
    latency: float = 0.05
    period: float = 0.01
    dropouts: float = 0.0
    dropout: float = 0.2


@dataclass(frozen=True, eq=False)
class Scenario:
    """What is to be done, and with what.

    Attributes:
        robot, tip: the arm, and the frame that carries the tool. tool: its end in that frame, z along the tool.
        start: configuration at first [nq].
        goal: pose on the object that the tool's end is brought to, z the way in. near: distance before it [m].
        aligned: (position [m], angle [rad]) within which the tool may go in.
        allowed: the same at the goal: beyond, the trial has failed. approach, insert, stay, timeout: [s].
        lead: how deep the goal lies behind the mouth of a hole, whose walls are ``allowed[0]`` off the tool [m];
            0: there is no hole.
        rate: ticks a second. gain: of the tool [1/s]. process: restlessness that the filter assumes.
    """

    robot: Robot
    tip: str
    tool: pin.SE3
    start: Array
    goal: pin.SE3
    near: float
    aligned: tuple[float, float]
    allowed: tuple[float, float]
    lead: float
    approach: float = 3.0
    insert: float = 3.0
    stay: float = 0.5
    timeout: float = 20.0
    rate: float = 100.0
    gain: float = 20.0
    process: tuple[float, float] = (0.03, 0.03)
    measurement: Measurement = field(default_factory=Measurement)
    policy: DropoutPolicy = field(default_factory=DropoutPolicy)


@dataclass(frozen=True, eq=False)
class Trial:
    """What happened, tick by tick.

    Attributes:
        t: [s]. q: n x nq. command: n x 3 and error: n x 6, where the tool is wanted in the goal's axes and how far it
            is from there [m, rad]. known: n x 6, how wrong the controller's knowledge of the object was there. rates:
            largest joint rate of each tick, as a part of its limit. goal: n x 7, the goal in the world (quaternion).
        success: it arrived and stayed, and never left ``allowed``. reason: why not. time: when it was done [s].
        aligned_at: when it began to go in; nan if never.
    """

    t: Array
    q: Array
    command: Array
    error: Array
    known: Array
    rates: Array
    goal: Array
    success: bool
    reason: str
    time: float
    aligned_at: float

    @property
    def working(self) -> Array:
        """Ticks from the alignment on; without one, those after the tool has come near."""
        begin = self.aligned_at if np.isfinite(self.aligned_at) else min(3.5, 0.5 * float(self.t[-1]))
        return np.asarray(self.t >= begin - STEADY)


class Bench:
    """A compiled controller for the trials of a scenario.

    Args:
        plant: what is driven; None: the kinematic one. backend: of the controller.

    Raises:
        WbcError: a frame or configuration that the robot has not.
    """

    def __init__(self, scenario: Scenario, plant: Plant | None = None, backend: str = "auto") -> None:
        self.scenario = scenario
        self.robot = scenario.robot.with_frame(TOOL, scenario.tip, scenario.tool)
        self._plant = plant
        stack = Stack(self.robot, 1.0 / scenario.rate).add(MovingFrame(), name=GOAL)
        stack.add(EndEffector(TOOL, relative_to=GOAL, gain=scenario.gain), name="tool", level=0)
        stack.add(Posture(), name="posture", level=1)
        stack.add(JointLimits(), name="limits")
        self.controller: Controller = stack.compile(backend=backend)
        self._data = self.robot.model.createData()
        self._tool = self.robot.model.getFrameId(TOOL)

    def run(self, motion: Motion, knowledge: Knowledge, rng: np.random.Generator) -> Trial:
        """One trial; the object moves as ``motion`` says. Deterministic for one state of ``rng``.

        Raises:
            PlantError: the plant failed.
        """
        s, controller, dt = self.scenario, self.controller, 1.0 / self.scenario.rate
        known = _Known(s, knowledge, motion, rng)
        path = _Path(s)
        rows: list[tuple[Array, ...]] = []
        q = np.array(s.start)
        with Connection(self._plant, self.robot, dt) as connection:
            state = connection.reset(q)
            controller[GOAL].pose = motion.at(0.0).pose * s.goal
            controller.reset(q)
            controller["tool"].enabled = True
            path.begin((motion.at(0.0).pose * s.goal).actInv(self._placed(q)))
            for k in range(round(s.timeout * s.rate)):
                t = k * dt
                there = motion.at(t)
                goal = there.pose * s.goal
                wanted, speed = path.at(t)
                error = _difference(goal.actInv(self._placed(state.q)), wanted)
                estimate, lost = known.at(t)
                wrong = _difference(goal.actInv(estimate.pose * s.goal), pin.SE3.Identity())
                self._tell(estimate, wanted, speed)
                if lost:
                    controller["tool"].enabled = False
                step = controller.step(state.q)
                share = float(np.max(np.abs(step.v) / self.robot.limits.velocity))
                rows.append((np.array([t]), state.q, wanted.translation, error, wrong, np.array([share]), _flat(goal)))
                path.judge(t, error, lost)
                if path.over:
                    break
                state = connection.drive(step.v)
        times, q, command, error, wrong, shares, goals = (np.array(column) for column in zip(*rows, strict=True))
        reason = "" if path.success else path.reason or "it was not aligned in time"
        return Trial(
            times[:, 0], q, command, error, wrong, shares[:, 0], goals, path.success, reason, path.time, path.aligned_at
        )

    def _tell(self, estimate: FrameMotion, wanted: pin.SE3, speed: Array) -> None:
        """The goal, which the object carries, is the moving frame; the tool's path is given in it."""
        arm = estimate.pose.rotation @ self.scenario.goal.translation
        spin, turning = estimate.twist[3:], estimate.acceleration[3:]
        linear = estimate.twist[:3] + _cross(spin, arm)
        change = estimate.acceleration[:3] + _cross(turning, arm) + _cross(spin, _cross(spin, arm))
        frame, tool = self.controller[GOAL], self.controller["tool"]
        frame.pose = estimate.pose * self.scenario.goal
        frame.twist = np.concatenate([linear, spin])
        frame.acceleration = np.concatenate([change, turning])
        tool.target = wanted
        tool.feedforward = speed

    def _placed(self, q: Array) -> pin.SE3:
        pin.forwardKinematics(self.robot.model, self._data, q)
        return pin.updateFramePlacement(self.robot.model, self._data, self._tool).copy()


class _Known:
    """What the controller knows of the object over time."""

    def __init__(self, s: Scenario, knowledge: Knowledge, motion: Motion, rng: np.random.Generator) -> None:
        self._kind, self._motion, self._rng, self._m = knowledge, motion, rng, s.measurement
        noise = np.maximum(s.measurement.noise, 1e-6)
        # Measurements begin before the trial, as long as a filter takes to settle
        self._next, self._quiet = -1.0, -np.inf
        self._waiting: list[tuple[float, pin.SE3]] = []
        self._stream = PoseStream(PoseFilter(noise, s.process), s.policy)
        self._first = motion.at(0.0)
        self._last = self._first.pose

    def at(self, t: float) -> tuple[FrameMotion, bool]:
        """The estimate, and whether the object is lost."""
        if self._kind in (Knowledge.LATE, Knowledge.ESTIMATED):
            self._arrive(t)
        if self._kind is Knowledge.ESTIMATED:
            found = self._stream.at(t)
            return FrameMotion(found.pose, found.twist, found.acceleration), found.state is StreamState.LOST
        true = self._first if self._kind is Knowledge.NONE else self._motion.at(t)
        if self._kind is Knowledge.TWIST:
            return true, False
        return FrameMotion(self._last if self._kind is Knowledge.LATE else true.pose, np.zeros(6), np.zeros(6)), False

    def _arrive(self, t: float) -> None:
        """Take the measurements that are there by now; noise is drawn when one is taken."""
        while self._next <= t + 1e-9:
            if self._rng.random() < self._m.dropouts * self._m.period:
                self._quiet = self._next + self._m.dropout
            if self._next >= self._quiet:
                true, error = self._motion.at(self._next).pose, self._rng.normal(size=6)
                place = true.translation + self._m.noise[0] * error[:3]
                pose = pin.SE3(pin.exp3(self._m.noise[1] * error[3:]) @ true.rotation, place)
                self._waiting.append((self._next, pose))
            self._next += self._m.period
        while self._waiting and self._waiting[0][0] + self._m.latency <= t + 1e-9:
            stamp, self._last = self._waiting.pop(0)
            if self._kind is Knowledge.ESTIMATED:
                self._stream.push(stamp, self._last)


class _Path:
    """The operator's path, and the judgement of the trial."""

    def __init__(self, s: Scenario) -> None:
        self._s = s
        self._since: float | None = None
        self.aligned_at = self.time = float("nan")
        self.over = self.success = False
        self.reason = ""

    def begin(self, first: pin.SE3) -> None:
        """Where the tool is at first, as seen from the goal."""
        near = pin.SE3(np.eye(3), np.array([0.0, 0.0, -self._s.near - self._s.lead]))
        self._first, self._near = first, near
        self._turn = pin.log3(first.rotation)

    def at(self, t: float) -> tuple[pin.SE3, Array]:
        """Where the tool is wanted, as seen from the goal, and its twist there."""
        s, way = self._s, self._near.translation - self._first.translation
        if t < s.approach:
            share, slope = _smooth(t / s.approach)
            pose = pin.SE3(pin.exp3((1.0 - share) * self._turn), self._first.translation + share * way)
            return pose, slope / s.approach * np.concatenate([way, -self._turn])
        if not np.isfinite(self.aligned_at):
            return self._near, np.zeros(6)
        share, slope = _smooth(min((t - self.aligned_at) / s.insert, 1.0))
        near = self._near.translation
        return pin.SE3(np.eye(3), (1.0 - share) * near), -slope / s.insert * np.concatenate([near, np.zeros(3)])

    def judge(self, t: float, error: Array, lost: bool) -> None:
        """Aligned, arrived, or failed."""
        s = self._s
        if lost:
            self._end(t, "the object was lost")
        elif t >= s.approach and not np.isfinite(self.aligned_at):
            if np.linalg.norm(error[:3]) < s.aligned[0] and np.linalg.norm(error[3:]) < s.aligned[1]:
                self._since = t if self._since is None else self._since
                if t - self._since >= STEADY - 1e-9:
                    self.aligned_at = t
            else:
                self._since = None
        elif np.isfinite(self.aligned_at):
            wanted = self.at(t)[0].translation[2]
            depth = wanted + error[2] + s.lead
            done = t - self.aligned_at
            if s.lead > 0.0 and depth > 0.0 and not _fits(error, depth, s.allowed[0]):
                self._end(t, "it touched the wall of the hole")
            elif done >= s.insert and not self._there(error):
                self._end(t, "it was not at the goal")
            elif done >= s.insert + s.stay:
                self.success, self.time, self.over = True, t, True

    def _there(self, error: Array) -> bool:
        """Within ``allowed`` of the goal; in a hole, whose walls are judged already, deep enough to a tenth."""
        s = self._s
        near = abs(error[2]) < 0.1 * s.lead if s.lead > 0.0 else np.linalg.norm(error[:3]) < s.allowed[0]
        return bool(near and np.linalg.norm(error[3:]) < s.allowed[1])

    def _end(self, t: float, reason: str) -> None:
        self.reason, self.over = reason, True


def _fits(error: Array, depth: float, clearance: float) -> bool:
    """A cylinder in a hole that is wider by ``clearance`` all round: its axis is within that of the hole's at its end
    and at the mouth. Rotations by small angles: the axis goes aside by (ry, -rx) a metre.
    """
    end = error[:2]
    mouth = end - depth * np.array([error[4], -error[3]])
    return bool(np.hypot(*end) < clearance and np.hypot(*mouth) < clearance)


def _difference(found: pin.SE3, wanted: pin.SE3) -> Array:
    """(position [m]; rotation vector [rad]) from wanted to found, in the axes that both are given in."""
    return np.concatenate([found.translation - wanted.translation, pin.log3(found.rotation @ wanted.rotation.T)])


def _cross(a: Array, b: Array) -> Array:
    """a x b, without what numpy's takes for other shapes."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _flat(pose: pin.SE3) -> Array:
    return np.concatenate([pose.translation, pin.Quaternion(pose.rotation).coeffs()])


def _smooth(x: float) -> tuple[float, float]:
    """10 x^3 - 15 x^4 + 6 x^5 and its derivative, for x in [0, 1]."""
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * x * x * (1.0 - x) ** 2
