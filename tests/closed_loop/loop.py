"""A compiled stack in a loop with an ideal robot: q (+) v dt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from tests.closed_loop.eyes import Array
from tests.optimised import ticks
from wbc.api import Controller
from wbc.robot import Robot
from wbc.tasks import Item


@dataclass(frozen=True, eq=False)
class Run:
    """Configurations [n + 1, nq], commands [n, nv] and how many ticks were not simply solved."""

    q: Array
    v: Array
    unsolved: int


class Loop:
    """One compiled stack; each check switches on the items that it is about."""

    def __init__(
        self, robot: Robot, items: Mapping[str, Item], dt: float, backend: str = "auto", calm: bool = True
    ) -> None:
        stack = wbc.Stack(robot, dt, calm=calm)
        for key, item in items.items():
            stack.add(item, name=key)
        self.robot, self.dt = robot, dt
        with ticks():  # thousands of ticks a check
            self.controller: Controller = stack.compile(backend=backend)
        self._names = [entry.name for entry in stack.entries]
        self._settle()

    def _settle(self) -> None:
        """Give every input that waits for a first configuration a value, so that a reset has none to work out."""
        self.controller.reset(self.robot.neutral)
        for name in self._names:
            handle = self.controller[name]
            for key in handle.names:
                setattr(handle, key, getattr(handle, key))

    def __getitem__(self, name: str) -> Any:
        return self.controller[name]

    def only(self, *names: str) -> None:
        """Switch these items on and all others off."""
        for name in names:
            assert name in self._names, name
        for name in self._names:
            self.controller[name].enabled = name in names

    def run(
        self,
        q: Array,
        ticks: int,
        v: Array | None = None,
        before: Callable[[int, Array], None] | None = None,
    ) -> Run:
        """``ticks`` commands from velocity ``v`` (rest), each followed for dt; ``before(tick, q)`` sets inputs."""
        self.controller.reset(v=v)
        path, commands = np.empty((ticks + 1, self.robot.nq)), np.empty((ticks, self.robot.nv))
        path[0], unsolved = q, 0
        for k in range(ticks):
            if before is not None:
                before(k, path[k])
            step = self.controller.step(path[k])
            commands[k] = step.v
            unsolved += step.status != "solved"
            path[k + 1] = pin.integrate(self.robot.model, path[k], commands[k] * self.dt)
        return Run(path, commands, unsolved)
