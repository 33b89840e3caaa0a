"""Servos of an arm that is not MuJoCo's: lag, delay, friction and gravity in a few lines."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import wbc
from tests.models import Y, Z, add_chain
from wbc.api import Controller
from wbc.robot import Limits, Robot
from wbc.simulation import Command, CommandKind, PlantState

DT = 0.002
HOME = np.array([0.2, 0.7, -1.1])


def arm(acceleration: float = 10.0) -> Robot:
    """Three joints with masses."""
    model = pin.Model()
    add_chain(model, [(Z, (0, 0, 0.3)), (Y, (0.4, 0, 0)), (Y, (0.4, 0, 0))])
    for k, mass in enumerate((3.0, 2.0, 1.0), start=1):
        model.appendBodyToJoint(k, pin.Inertia(mass, np.array([0.15, 0.0, 0.0]), 0.02 * np.eye(3)), pin.SE3.Identity())
    wide, fast, quick = np.full(3, 3.0), np.full(3, 2.0), np.full(3, acceleration)
    return Robot("three", model, Limits(-wide, wide, fast, quick, np.full(3, np.inf)), neutral=HOME)


def controller(robot: Robot) -> Controller:
    """The tip's position, and limits."""
    stack = wbc.Stack(robot, dt=DT)
    stack.add(wbc.tasks.EndEffector("tip", gain=10.0), name="tip")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    stack.add(wbc.tasks.JointLimits())
    control = stack.compile()
    control["tip"].mask = [1, 1, 1, 0, 0, 0]
    return control


@dataclass
class Drives:
    """Servos of a kind: first-order for positions and velocities, Pinocchio's forward dynamics for torques.

    T dx/dt + x = u(t - delay) - S g(q) - F sign(v); M a + h = u(t - delay) - F sign(v), with a payload at the tip.
    """

    robot: Robot
    kind: CommandKind
    lag: float = 0.0
    delay: int = 0
    sag: float = 0.0
    friction: float = 0.0
    payload: float = 0.0
    blocked: bool = False

    def __post_init__(self) -> None:
        self.commands, self.time_step = (self.kind,), DT
        self.nq, self.nv = self.robot.nq, self.robot.nv
        self.model = pin.Model(self.robot.model)
        self.model.appendBodyToJoint(
            3, pin.Inertia(self.payload, np.array([0.4, 0, 0]), np.zeros((3, 3))), pin.SE3.Identity()
        )
        self.data = self.model.createData()

    def reset(self, q: np.ndarray, time: float = 0.0) -> None:
        self.q, self.v, self.time = q.copy(), np.zeros(self.nv), time
        rest = {
            CommandKind.POSITION: q + self.sag * self._gravity(),
            CommandKind.VELOCITY: self.sag * self._gravity(),
            CommandKind.TORQUE: self._gravity(),
        }[self.kind]
        self.late = deque([rest] * (self.delay + 1), maxlen=self.delay + 1)

    def _gravity(self) -> np.ndarray:
        return pin.computeGeneralizedGravity(self.model, self.data, self.q).copy()

    def apply(self, command: Command) -> None:
        assert command.kind is self.kind
        assert np.isfinite(command.values).all()
        self.late.append(command.values.copy())

    def advance(self, dt: float) -> None:
        assert dt == DT
        u, self.time = self.late[0], self.time + dt
        if self.blocked:
            self.v = np.zeros(self.nv)
            return
        part = 1.0 - np.exp(-DT / self.lag) if self.lag else 1.0
        rubs = self.friction * np.tanh(self.v / 0.01)
        if self.kind is CommandKind.TORQUE:
            # Ten sub-steps: friction about rest is stiff
            for _ in range(10):
                rubs = self.friction * np.tanh(self.v / 0.05)
                self.v = self.v + 0.1 * DT * pin.aba(self.model, self.data, self.q, self.v, u - rubs)
                self.q = self.q + 0.1 * DT * self.v
            return
        target = u - self.sag * self._gravity() - rubs
        if self.kind is CommandKind.VELOCITY:
            self.v = self.v + part * (target - self.v)
        else:
            self.v = part * (target - self.q) / DT
        self.q = self.q + DT * self.v

    def read(self) -> PlantState:
        return PlantState(self.q.copy(), self.v.copy(), self.time)
