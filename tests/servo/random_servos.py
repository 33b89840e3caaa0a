"""Arms of the table and chains at random, on servos at random: what they are told and what becomes of it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import wbc
from tests.random_robots import Drawn, random_model
from wbc.robot import Robot
from wbc.servo import Following, Response, Servo

ARMS = ("ur3", "ur5", "ur10", "panda", "kinova", "xarm7", "z1", None, None)
PERIODS = (0.001, 0.002, 0.004, 0.005, 0.008, 0.01)
KINDS = ("position", "position", "velocity", "torque")
#: What is behind a servo: a lag of first or second order, or rigid bodies
FORMS = ("first", "second", "bodies")
#: Step of the plant [s]
FINE = 0.0005
#: From when on a run is judged [s]
SETTLED = 0.5
#: A fall: no hand is so far from its path that still follows [mm]
FELL = 5e3


def chain(rng: np.random.Generator) -> Robot:
    """Three to seven joints about axes at random, with masses, and limits of 3 rad and rad/s."""
    return wbc.robots.load(random_model(rng, Drawn())).with_limits(
        position_lower=-3.0, position_upper=3.0, velocity=3.0
    )


def drawn_robot(rng: np.random.Generator) -> Robot:
    name = ARMS[rng.integers(len(ARMS))]
    robot = chain(rng) if name is None else wbc.robots.load(name)
    robot = chain(rng) if robot.nq != robot.nv else robot
    return robot.with_limits(velocity=np.full(robot.nv, 2.0), acceleration=np.full(robot.nv, 10.0))


def start(rng: np.random.Generator, robot: Robot, frame: str) -> tuple[np.ndarray, float]:
    """The one of fifty postures from which the frame moves best, and how well: the least singular value."""
    low, high = np.maximum(robot.limits.position_lower, -2.5), np.minimum(robot.limits.position_upper, 2.5)
    data, index, best = robot.model.createData(), robot.model.getFrameId(frame), (robot.neutral, -1.0)
    for _ in range(50):
        q = low + (0.2 + 0.6 * rng.random(robot.nv)) * (high - low)
        J = pin.computeFrameJacobian(robot.model, data, q, index, pin.LOCAL_WORLD_ALIGNED)[:3]
        best = max(best, (q, float(np.linalg.svd(J)[1][2])), key=lambda one: one[1])
    return best


class Path:
    """A figure of two sines in each direction."""

    def __init__(self, rng: np.random.Generator, at: np.ndarray, size: float) -> None:
        self._at = at
        self._wide = size * rng.uniform(0.4, 1.0, (2, 3)) * rng.choice([-1, 1], (2, 3))
        self._w = 2 * np.pi * rng.uniform(0.2, 0.6) * np.array([[1.0], [2.0]])

    def __call__(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Where, and how fast."""
        (slow, quick), (w, w2), (one, two) = self._wide, self._w, self._w * t
        where = slow * (1 - np.cos(one)) / 2 + quick * np.sin(two) / 2
        return self._at + where, slow * w * np.sin(one) / 2 + quick * w2 * np.cos(two) / 2


class Servos:
    """Of a kind, over bodies or over lags, with a delay; measured with noise or without, with velocities or without."""

    def __init__(self, rng: np.random.Generator, robot: Robot, frame: str, kind: str, dt: float, q: np.ndarray,
                 form: str) -> None:  # fmt: skip
        self.kind, self.form, nv = kind, "bodies" if kind == "torque" else form, robot.nv
        model, self.fastest = robot.model.copy(), robot.limits.velocity
        inertia = float(np.diag(pin.crba(model, model.createData(), q)).max())
        self.armature = np.full(nv, rng.uniform(0.02, 0.15) * inertia)
        weight = max(np.abs(pin.computeGeneralizedGravity(model, model.createData(), q)).max(), 0.5 * inertia)
        self.delay = int(min(rng.integers(0, 9), 0.045 // dt))
        self.steps = max(1, round(dt / FINE))
        self.h, self.compensates = dt / self.steps, True
        if self.form == "bodies":
            payload = rng.uniform(0, 0.05) * sum(one.mass for one in model.inertias[1:]) * rng.integers(0, 2)
            held = model.frames[model.getFrameId(frame)]
            if payload:
                body = pin.Inertia(payload, held.placement.translation, 1e-4 * np.eye(3))
                model.appendBodyToJoint(held.parentJoint, body, pin.SE3.Identity())
            model.armature = model.armature + self.armature
            self.coulomb = rng.uniform(0, 0.04) * weight * rng.integers(0, 2)
            self.viscous = rng.uniform(0, 0.05) * weight
            self.stiffness, self.lag = np.zeros(nv), np.zeros(nv)
            if kind == "position":
                sag = np.exp(rng.uniform(np.log(0.001), np.log(0.03)))
                self.stiffness, self.lag = weight / sag * _each(rng, nv), _between(rng, 0.02, 0.2) * _each(rng, nv)
            elif kind == "velocity":
                self.stiffness += weight / np.exp(rng.uniform(np.log(0.005), np.log(0.1)))
                self.compensates = bool(rng.integers(0, 2))
        else:
            low, high = (0.005, 0.2) if kind == "position" else (0.002, 0.08)
            self.lag = _between(rng, low, high) * _each(rng, nv)
            self.sag = (0.01 if kind == "position" else 0.03) * rng.random() * rng.integers(0, 2) / weight
            self.rubs = rng.uniform(0, 2e-3 if kind == "position" else 1e-2) * rng.integers(0, 2)
            self.zeta = rng.uniform(0.5, 1.3) if self.form == "second" else 1.0
        self.noise = float(rng.choice([0.0, 1e-5, 1e-4])) if rng.random() < 0.5 else 0.0
        self.gives_velocity = bool(rng.integers(0, 2))
        self._seed, self._model, self._data = int(rng.integers(1 << 30)), model, model.createData()

    def reset(self, q: np.ndarray) -> None:
        """At rest, where the servos hold."""
        self.q, self.v, self.a = q.copy(), np.zeros(len(q)), np.zeros(len(q))
        sags, moves = self._gravity(), q if self.kind == "position" else np.zeros(len(q))
        if self.form != "bodies":
            sags = self.sag * sags
        elif self.kind != "torque":
            sags = sags / self.stiffness * (self.kind == "position" or not self.compensates)
        self._line = deque([moves + sags] * (self.delay + 1), maxlen=self.delay + 1)
        self._noise, self.top = np.random.default_rng(self._seed), 0.0

    def read(self) -> tuple[np.ndarray, np.ndarray | None]:
        """What is measured."""
        q = self.q + self.noise * self._noise.standard_normal(len(self.q))
        return q, self.v + 10 * self.noise * self._noise.standard_normal(len(q)) if self.gives_velocity else None

    def advance(self, u: np.ndarray) -> None:
        """A period; ``top`` is the largest part of its limit at which a joint has moved."""
        self._line.append(u.copy())
        for _ in range(self.steps):
            (self._bodies if self.form == "bodies" else self._lags)(self._line[0], self.h)
            self.top = max(self.top, float(np.abs(self.v / self.fastest).max()))

    def _gravity(self) -> np.ndarray:
        return pin.computeGeneralizedGravity(self._model, self._data, self.q).copy()

    def _bodies(self, u: np.ndarray, h: float) -> None:
        bias = pin.nonLinearEffects(self._model, self._data, self.q, self.v).copy()
        M = pin.crba(self._model, self._data, self.q)
        damping, force = self.viscous + self.coulomb / np.hypot(self.v, 0.01), u
        if self.kind == "position":
            damping, force = damping + self.stiffness * (self.lag + h), self.stiffness * (u - self.q)
        elif self.kind == "velocity":
            damping, force = damping + self.stiffness, self.stiffness * u + self.compensates * self._gravity()
        self.v = np.linalg.solve(M + h * np.diag(damping), M @ self.v + h * (force - bias))
        self.q = self.q + h * self.v

    def _lags(self, u: np.ndarray, h: float) -> None:
        x = self.q if self.kind == "position" else self.v
        behind = u - self.sag * self._gravity() - self.rubs * np.tanh(self.v / 0.01) - x
        if self.form == "first":
            self.a = (1 - np.exp(-h / self.lag)) * behind / h
        else:
            w = 2 * self.zeta / self.lag
            self.a = (self.a + h * w * w * behind) / (1 + 2 * self.zeta * w * h + w * w * h * h)
        self.v = self.a if self.kind == "position" else self.v + h * self.a
        self.q = self.q + h * self.v


def _each(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.exp(rng.uniform(-0.3, 0.3, count))


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


@dataclass(frozen=True)
class Outcome:
    """95 of 100 distances of the hand from its path once settled are below ``off`` [mm]; the largest parts of their
    limits at which joints moved and the reference did; how it followed at worst.
    """

    off: float
    top: float
    reference: float
    following: Following


class Case:
    """A robot, its servos, and two paths of its hand, in half of the cases the same."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([77, seed])
        self.dt = float(rng.choice(PERIODS))
        robot = drawn_robot(rng)
        self.frame = robot.model.frames[robot.model.nframes - 1].name
        self.q, reach = start(rng, robot, self.frame)
        self.kind, form = KINDS[rng.integers(len(KINDS))], FORMS[rng.integers(len(FORMS))]
        self.servos = Servos(rng, robot, self.frame, self.kind, self.dt, self.q, form)
        self.home = robot.pose(self.q, self.frame)
        first, second = (Path(rng, self.home.translation, min(0.08, 0.3 * reach)) for _ in range(2))
        self.paths = (first, first if rng.random() < 0.5 else second)
        stack = wbc.Stack(robot, dt=self.dt)
        stack.add(wbc.tasks.EndEffector(self.frame, gain=10.0), name="hand")
        stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
        stack.add(wbc.tasks.JointLimits())
        self.robot, self.control = robot, stack.compile(backend="vm")
        self.control["hand"].mask = [1, 1, 1, 0, 0, 0]

    def servo(self, response: Response | None = None) -> Servo:
        more = {"armature": self.servos.armature} if self.kind == "torque" else {}
        return Servo(self.control, self.kind, response=response, **more)

    def run(self, servo: Servo, path: Path, seconds: float) -> Outcome:
        servos, off, worst, reference = self.servos, [], Following.CLOSE, 0.0
        servos.reset(self.q)
        servo.reset(self.q)
        for k in range(round(seconds / self.dt)):
            where, rate = path(k * self.dt)
            servo.controller["hand"].target = pin.SE3(self.home.rotation, where)
            servo.controller["hand"].feedforward = [*rate, 0.0, 0.0, 0.0]
            before = servo.reference
            step = servo.step(*servos.read())
            reference = max(reference, float(np.abs((servo.reference - before) / self.dt / servos.fastest).max()))
            servos.advance(step.command.values)
            worst = max(worst, step.following, key=[*Following].index)
            hand = self.robot.pose(servos.q, self.frame).translation
            off.append(1e3 * float(np.linalg.norm(hand - path((k + 1) * self.dt)[0])))
            if not off[-1] < FELL:
                return Outcome(np.inf, servos.top, reference, worst)
        return Outcome(float(np.percentile(off[round(SETTLED / self.dt) :], 95)), servos.top, reference, worst)


def told_beside_untold(seed: int, seconds: float) -> tuple[Outcome, Outcome]:
    """The same path told nothing, and beside it with what was found on the other one."""
    case = Case(seed)
    untold = case.servo()
    first = case.run(untold, case.paths[0], seconds)
    beside = first if case.paths[0] is case.paths[1] else case.run(case.servo(), case.paths[1], seconds)
    return beside, case.run(case.servo(untold.response), case.paths[1], seconds)
