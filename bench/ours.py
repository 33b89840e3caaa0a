"""This package on a problem, as its README shows it."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np

import wbc
from bench.contender import Contender
from bench.problems import Array, Case
from bench.solids import keep_clear, link_shapes
from wbc.controller import core_of
from wbc.tick.native import NativeTick


class Ours(Contender):
    """``controller.step(q)``, whose ``q_next`` is the configuration of the next tick."""

    def __init__(self, case: Case, calm: bool = True) -> None:
        """Declare and compile the stack; ``calm`` as there."""
        super().__init__(case)
        problem = self.problem
        base = "floating" if problem.floating else "fixed"
        robot = wbc.robots.load(problem.robot) if problem.robot else wbc.robots.load(case.urdf, base=base)
        self.robot = robot.with_shapes(link_shapes(problem.solids))
        assert list(self.robot.joint_names)[-len(problem.joints) :] == problem.joints
        stack = wbc.Stack(self.robot, problem.dt, damping=problem.damping, calm=calm)
        for frame in problem.frames:
            stack.add(wbc.tasks.EndEffector(frame), name=frame)
        if problem.com:
            stack.add(wbc.tasks.CenterOfMass(), name="com")
        stack.add(wbc.tasks.Posture(), name="posture", weight=problem.posture_weight)
        stack.add(wbc.tasks.JointLimits(acceleration=False))
        clear = keep_clear(problem)
        for name, constraint in clear.items():
            stack.add(constraint, name=name)
        self.tasks = [e.name for e in stack.tasks]
        self.controller = stack.compile(wait=True)
        self.controller.reset(self.case.q0)
        for name in self.tasks:
            self.controller[name].gain = 1.0 / problem.dt
        self.controller["posture"].target = self.case.q0
        for name in clear:
            self.controller[name].rate = problem.rate
        self.hand = self.controller[problem.frames[0]] if len(problem.frames) == 1 and not problem.com else None
        self.targets = [self._targets(k) for k in range(case.ticks)]
        self.reset()

    def reset(self) -> None:
        self.q = np.array(self.case.q0)
        self.controller.reset(self.q)
        self.step: wbc.Step | None = None
        self.tick = 0

    def aim(self, tick: int) -> None:
        self.tick = tick
        if self.hand is not None:
            self.hand.target = self.case.poses[tick][0]
            return
        self.controller.set(**self.targets[tick])

    def _targets(self, tick: int) -> dict[str, Any]:
        targets: dict[str, Any] = dict(zip(self.problem.frames, self.case.poses[tick], strict=True))
        return targets | ({"com": self.case.com[tick]} if self.problem.com else {})

    def call(self) -> None:
        self.step = self.controller.step(self.q)
        self.velocity = self.step.v

    def native(self) -> int | None:
        tick = core_of(self.controller).tick
        if not isinstance(tick, NativeTick):
            return None
        tick.q[:] = self.q
        start = perf_counter_ns()
        tick.step_function(tick.pointer)
        return perf_counter_ns() - start

    def export(self, folder: Path) -> bool:
        """``export``: the tick as C; ``path.bin``: configuration, run-time inputs and command of every tick."""
        self.reset()
        self.controller.export(folder / "export", states=100)
        layout = core_of(self.controller).layout
        path = [np.array([self.case.ticks, layout.nq, layout.nv, layout.parameters], dtype=np.float64)]
        for k in range(self.case.ticks):
            self.aim(k)
            path += [self.q.copy(), core_of(self.controller).tick.p.copy()]
            self.call()
            path.append(self.velocity)
            self.settle()
        np.concatenate(path).tofile(folder / "path.bin")
        return True

    def settle(self) -> None:
        # After a native call there is no step
        later = self.step and self.step.q_next
        self.q = self.robot.integrate(self.q, self.controller.last_command, self.problem.dt) if later is None else later
        self.step = None

    def cycle(self, tick: int) -> None:
        self.tick = tick
        self.step = self.controller.step(self.q, **self.targets[tick])
        self.velocity = self.step.v
        self.settle()

    def state(self) -> Array:
        return self.q
