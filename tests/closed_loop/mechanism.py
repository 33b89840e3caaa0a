"""Closed-loop check of what the mechanism imposes: mimic joints and undriven directions."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin

import wbc.robots
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import STARTS, anywhere
from wbc.robot import Robot
from wbc.tasks import Mechanism, Posture

#: An arm with its fingers, two hands whose mimic joints have offsets, a mobile base that cannot slide sideways
ROBOTS = ("panda", "alex_psyonic_hands", "tiago")

DT, GAIN = 0.02, 5.0


@cache
def coupled(name: str) -> Robot:
    """The robot with every joint that its description couples; the table's locks only where nothing is coupled."""
    return wbc.robots.load(name, shapes="none") if name == "tiago" else wbc.robots.load(name, shapes="none", lock=())


def build(name: str) -> Loop:
    """A posture task for all joints; the mechanism's rows are in every stack."""
    robot = coupled(name)
    assert robot.couplings or robot.locked_dofs
    return Loop(robot, {"rest": Posture(joints=robot.joint_names)}, DT, name)


def mechanism(loop: Loop, seed: int = 21) -> dict[str, float]:
    """While every joint, leaders and followers apart, is pulled elsewhere: q_follower - ratio q_leader - offset falls
    by 1 - gain dt a tick from wherever it starts, and undriven directions do not move.
    """
    robot, rng = loop.robot, np.random.default_rng(seed)
    own = next(e.name for e in loop.controller.stack.entries if isinstance(e.item, Mechanism))
    loop.only("rest", own)
    loop[own].gain, loop["rest"].gain = GAIN, 3.0
    at, ticks = robot.position_index, 40
    powers = (1 - GAIN * DT) ** np.arange(ticks + 1)
    figures = {"mismatch": 0.0, "sideways": 0.0, "moved": np.inf}
    for start in range(STARTS):
        q, goal = anywhere(robot, rng), anywhere(robot, rng)
        for c in robot.couplings:
            off = rng.uniform(-0.1, 0.1) * (start % 2)
            q[at[c.follower]] = c.ratio * q[at[c.leader]] + c.offset + off
        loop["rest"].target = goal
        run = loop.run(q, ticks)
        assert run.unsolved == 0
        for c in robot.couplings:
            gap = run.q[:, at[c.follower]] - c.ratio * run.q[:, at[c.leader]] - c.offset
            figures["mismatch"] = max(figures["mismatch"], float(np.abs(gap - powers * gap[0]).max()))
        for i in robot.locked_dofs:
            for before, after in zip(run.q[:-1], run.q[1:], strict=True):
                figures["sideways"] = max(figures["sideways"], abs(loop.eyes.velocity(before, after, DT)[i]))
        figures["moved"] = min(figures["moved"], float(np.abs(pin.difference(robot.model, q, run.q[-1])).max()))
        assert figures["mismatch"] < 1e-9, figures
        assert figures["sideways"] < 1e-9, figures
    assert figures["moved"] > 0.05, figures
    return figures
