"""One trial: a program of steps (:mod:`wbc.program`) brings a tool to a place on an object that moves.

The goal on the object is the moving frame, so the program is the operator's part: it says where the tool goes relative
to the object and knows nothing of the object's motion. Its guards are what instruments at the goal tell:

    depth   how far the tool's end is behind the mouth of the hole, or the goal where there is no hole [m]
    aside   distance of the tool's end from the goal's axis, off: from the goal itself [m]
    tilt    angle between the tool and the goal [rad]
    wall    what is left between the tool and the wall of the hole [m]
    lost    1 when measurements of the object have failed to come for too long, else 0
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from wbc.api import Controller, Stack
from wbc.estimation import DropoutPolicy, FrameMotion
from wbc.moving_target.knowledge import Knowledge, Known, Measurement
from wbc.moving_target.motions import TargetMotion
from wbc.multibody import pin
from wbc.program import Program, Runner
from wbc.robot import Robot
from wbc.simulation import Connection, Plant
from wbc.tasks import EndEffector, JointLimits, MovingFrame, Posture
from wbc.validation import Array

#: Name of the tool's frame
TOOL = "tool of the trial"
#: Name of the hand's task in the stack
HAND = "tool"
#: Name of the goal's frame in the stack
GOAL = "goal"
#: Name of the program's step with which the work begins
WORK = "go in"


@dataclass(frozen=True, eq=False)
class TargetScenario:
    """What is to be done, and with what.

    Attributes:
        robot, tip: the arm, and the frame that carries the tool. tool: its end in that frame, z along the tool.
        start: configuration at first [nq].
        goal: pose on the object that the tool's end is brought to, z the way in.
        program: steps of the hand ``"tool"`` relative to the goal, with the signals of this module.
        lead: how deep the goal lies behind the mouth of a hole; 0: there is no hole. clearance: from the tool to the
            wall, or by how much it may be off the goal [m].
        size: of the scene, for pictures [m]. timeout: of a trial [s].
        rate: ticks a second. gain: of the tool [1/s]. process: restlessness that the filter assumes.
    """

    robot: Robot
    tip: str
    tool: pin.SE3
    start: Array
    goal: pin.SE3
    program: Program
    lead: float
    clearance: float
    size: float
    timeout: float = 20.0
    rate: float = 100.0
    gain: float = 20.0
    process: tuple[float, float] = (0.03, 0.03)
    measurement: Measurement = field(default_factory=Measurement)
    policy: DropoutPolicy = field(default_factory=DropoutPolicy)


@dataclass(frozen=True, eq=False)
class TargetTrial:
    """What happened, tick by tick.

    Attributes:
        t: [s]. q: n x nq. command: n x 3 and error: n x 6, where the tool is wanted in the goal's axes and how far it
            is from there [m, rad]. known: n x 6, how wrong the controller's knowledge of the goal was. rates:
            largest joint rate of each tick, as a part of its limit. goal: n x 7, the goal in the world (quaternion).
        success: the program succeeded. reason: why not. time: when it was over [s].
        began: when the tool began to go in; nan if never.
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
    began: float

    @property
    def working(self) -> Array:
        """Ticks from when the tool began to go in; where it never did, the last second."""
        begin = self.began if np.isfinite(self.began) else self.time - 1.0
        return np.asarray(self.t >= begin)


class Bench:
    """A compiled controller for the trials of a scenario.

    Args:
        plant: what is driven; None: the kinematic one. backend: of the controller.

    Raises:
        WbcError: a frame or configuration that the robot has not.
    """

    def __init__(self, scenario: TargetScenario, plant: Plant | None = None, backend: str = "auto") -> None:
        self.scenario = scenario
        self.robot = scenario.robot.with_frame(TOOL, scenario.tip, scenario.tool)
        self._plant = plant
        stack = Stack(self.robot, 1.0 / scenario.rate).add(MovingFrame(), name=GOAL)
        stack.add(EndEffector(TOOL, relative_to=GOAL, gain=scenario.gain), name=HAND, level=0)
        stack.add(Posture(), name="posture", level=1)
        stack.add(JointLimits(), name="limits")
        self.controller: Controller = stack.compile(backend=backend)
        self._data = self.robot.model.createData()
        self._tool = self.robot.model.getFrameId(TOOL)

    def run(self, motion: TargetMotion, knowledge: Knowledge, rng: np.random.Generator) -> TargetTrial:
        """One trial; the object moves as ``motion`` says. Deterministic for one state of ``rng``.

        Raises:
            PlantError: the plant failed.
        """
        s, controller, dt = self.scenario, self.controller, 1.0 / self.scenario.rate
        known = Known(knowledge, motion, s.measurement, s.process, s.policy, rng)
        rows: list[tuple[Array | float, ...]] = []
        with Connection(self._plant, self.robot, dt) as connection:
            state = connection.reset(np.array(s.start))
            controller[GOAL].pose = motion.at(0.0).pose * s.goal
            controller.reset(state.q)
            runner = Runner(s.program, controller)
            for k in range(round(s.timeout * s.rate)):
                true = motion.at(k * dt)
                goal = true.pose * s.goal
                seen = goal.actInv(self._placed(state.q))
                believed, lost = known.at(k * dt, true)
                self._place(believed)
                report = runner.tick(state.q, self._signals(_difference(seen, pin.SE3.Identity()), lost))
                wanted, step = runner.hands[HAND].target, controller.step(state.q)
                wrong = _difference(goal.actInv(believed.pose * s.goal), pin.SE3.Identity())
                share = float(np.max(np.abs(step.v) / self.robot.limits.velocity))
                error = _difference(seen, wanted)
                rows.append((k * dt, state.q, wanted.translation.copy(), error, wrong, share, pin.SE3ToXYZQUAT(goal)))
                if report.state != "running":
                    break
                state = connection.drive(step.v)
        t, q, command, off, known_off, rates, goals = (np.array(column) for column in zip(*rows, strict=True))
        began = next((e.time for e in runner.log if e.status == "begins" and e.step.endswith(WORK)), np.nan)
        success = report.state == "succeeded"
        # Without the figures, which differ from trial to trial
        told = re.split(r" \(|, ", report.reason)[0] or "not done in time"
        reason = "" if success else f"{report.step.partition(' ')[2]}: {told}"
        return TargetTrial(t, q, command, off, known_off, rates, goals, success, reason, float(t[-1]), began)

    def _place(self, believed: FrameMotion) -> None:
        """The goal, which the object carries, is the moving frame."""
        arm = believed.pose.rotation @ self.scenario.goal.translation
        spin, turning = believed.twist[3:], believed.acceleration[3:]
        linear = believed.twist[:3] + _cross(spin, arm)
        change = believed.acceleration[:3] + _cross(turning, arm) + _cross(spin, _cross(spin, arm))
        frame = self.controller[GOAL]
        frame.pose = believed.pose * self.scenario.goal
        frame.twist = np.concatenate([linear, spin])
        frame.acceleration = np.concatenate([change, turning])

    def _signals(self, off: Array, lost: bool) -> dict[str, float]:
        """What the instruments tell where the tool is off the goal, see the module."""
        s = self.scenario
        depth = float(off[2]) + s.lead
        return {
            "depth": depth,
            "aside": float(np.hypot(off[0], off[1])),
            "off": float(np.linalg.norm(off[:3])),
            "tilt": float(np.linalg.norm(off[3:])),
            "wall": gap(off, depth, s.clearance) if s.lead > 0.0 < depth else s.clearance,
            "lost": float(lost),
        }

    def _placed(self, q: Array) -> pin.SE3:
        pin.forwardKinematics(self.robot.model, self._data, q)
        return pin.updateFramePlacement(self.robot.model, self._data, self._tool)


def gap(off: Array, depth: float, clearance: float) -> float:
    """What is left between a cylinder and the wall of a hole that is wider by ``clearance`` all round, at its end and
    at the mouth. Rotations by small angles: the axis goes aside by (ry, -rx) a metre.
    """
    mouth = off[:2] - depth * np.array([off[4], -off[3]])
    return clearance - float(max(np.hypot(off[0], off[1]), np.hypot(*mouth)))


def _difference(found: pin.SE3, wanted: pin.SE3) -> Array:
    """(position [m]; rotation vector [rad]) from wanted to found, in the axes that both are given in."""
    return np.concatenate([found.translation - wanted.translation, pin.log3(found.rotation @ wanted.rotation.T)])


def _cross(a: Array, b: Array) -> Array:
    """a x b, without what numpy's takes for other shapes."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
