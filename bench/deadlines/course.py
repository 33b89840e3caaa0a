"""A hard course: targets that jump every second, balls that move through the workspace, limits of acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import wbc
from bench.problems import Array, Case
from wbc.controller import core_of

DT, TICKS, HOLD = 0.005, 4000, 200
RADIUS, MARGIN, GAIN = 0.05, 0.02, 40.0
#: Balls go to and fro by this [m] at this frequency [Hz]
SWING, FREQUENCY = 0.1, 0.2


@dataclass(frozen=True)
class Kind:
    """What differs between robots.

    Attributes:
        hands: frames that jump; the other frames of the problem stay.
        balls: how many. low, high: corners of the box that their middles lie in [m].
        caps: iterations a tick at most, None for no cap.
    """

    hands: tuple[str, ...]
    balls: int
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    caps: tuple[int | None, ...]


KINDS = {
    "panda": Kind(("panda_hand",), 14, (-0.7, -0.7, 0.1), (0.7, 0.7, 0.9), (None, 20, 10, 5)),
    "talos": Kind(
        ("wrist_left_ft_link", "wrist_right_ft_link"), 6, (0.3, -0.6, 0.7), (0.7, 0.6, 1.5), (None, 30, 15, 8)
    ),
}


class Course:
    """The controller, the run-time inputs of every tick, and where the hands are wanted then."""

    def __init__(self, case: Case) -> None:
        self.name, self.kind, self.q0 = case.problem.robot, KINDS[case.problem.robot], case.q0
        robot = wbc.robots.load(self.name)
        stack = wbc.Stack(robot, DT)
        for frame in case.problem.frames:
            stack.add(wbc.tasks.EndEffector(frame), name=frame, weight=1.0 if frame in self.kind.hands else 100.0)
        if case.problem.com:
            stack.add(wbc.tasks.CenterOfMass(), name="com")
        stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
        stack.add(wbc.tasks.JointLimits())
        self.balls = [f"ball{k}" for k in range(self.kind.balls)]
        for name in self.balls:
            stack.add(wbc.tasks.Obstacle(wbc.shapes.Sphere(RADIUS), margin=MARGIN), name=name)
        self.model = robot.model
        self.controller = stack.compile(backend="native")
        self.controller.reset(self.q0)
        for hand in self.kind.hands:
            self.controller[hand].gain = GAIN
        self._data = self.model.createData()
        self.inputs, self.wanted = self._course(np.random.default_rng(1))

    def place(self, q: Array, frame: str) -> pin.SE3:
        """Where a frame is."""
        pin.framesForwardKinematics(self.model, self._data, q)
        return pin.SE3(self._data.oMf[self.model.getFrameId(frame)])

    def _course(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Run-time inputs [ticks, parameters], positions of the hands [ticks, hands, 3]."""
        kind, c = self.kind, self.controller
        middles = self._middles(rng)
        phases = rng.uniform(0.0, 2.0 * np.pi, middles.shape)
        inputs, wanted = np.zeros((TICKS, core_of(c).layout.parameters)), np.zeros((TICKS, len(kind.hands), 3))
        for k in range(TICKS):
            if k % HOLD == 0:
                goals = self._goals(rng)
                for hand, goal in zip(kind.hands, goals, strict=True):
                    c[hand].target = goal
            angles = 2.0 * np.pi * FREQUENCY * k * DT + phases
            places, speeds = middles + SWING * np.sin(angles), 2.0 * np.pi * FREQUENCY * SWING * np.cos(angles)
            for name, place, speed in zip(self.balls, places, speeds, strict=True):
                c[name].set(pose=pin.SE3(np.eye(3), place), velocity=np.concatenate([speed, np.zeros(3)]))
            inputs[k] = core_of(c).tick.p
            wanted[k] = [goal.translation for goal in goals]
        return inputs, wanted

    def _middles(self, rng: np.random.Generator) -> Array:
        """Middles of the balls; those of an arm on a table keep off its column."""
        drawn = rng.uniform(self.kind.low, self.kind.high, (100 * self.kind.balls, 3))
        return drawn[np.linalg.norm(drawn[:, :2], axis=1) > 0.35][: self.kind.balls]

    def _goals(self, rng: np.random.Generator) -> list[pin.SE3]:
        """Poses to jump to: of a random configuration of an arm, near the first ones of a humanoid's hands."""
        if len(self.kind.hands) == 1:
            limits = self.controller.stack.robot.limits
            share = rng.uniform(0.35, 0.65, self.model.nv)
            q = limits.position_lower + share * (limits.position_upper - limits.position_lower)
            return [self.place(q, hand) for hand in self.kind.hands]
        homes = [self.place(self.q0, hand) for hand in self.kind.hands]
        turns, moves = rng.normal(0.0, 0.4, (2, 3)), rng.uniform((-0.1, -0.25, -0.3), (0.35, 0.25, 0.4), (2, 3))
        pairs = zip(homes, turns, moves, strict=True)
        return [pin.SE3(home.rotation @ pin.exp3(turn), home.translation + move) for home, turn, move in pairs]
