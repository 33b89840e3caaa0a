"""Ticks whose first answer is not certified: the links of the chain; recordings; explanations."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
import pinocchio as pin

import wbc
from bench.measured.ticks import median_us
from bench.sheet import Sheet, us
from wbc.controller import Controller, Policy
from wbc.controller.controller import core_of
from wbc.controller.policy import CHAIN
from wbc.controller.tick.buffers import UNSOUND
from wbc.shapes import Sphere
from wbc.tasks import EndEffector, JointLimits, Obstacle, Posture

TICKS = 200


def parts() -> dict[str, Sheet | str]:
    """A table of links, and one of all else."""
    arm = controller()
    rows = [(link, *map(us, after(arm, (link,)))) for link in CHAIN] + [("braking", *map(us, after(arm, ())))]
    q = arm.stack.robot.neutral
    arm.policy = Policy()
    plain = median_us(arm, q)
    with TemporaryDirectory() as folder, arm.record(Path(folder) / "run.npz"):
        recorded = median_us(arm, q)
    clone, compile_ = milliseconds(arm.clone), milliseconds(arm.stack.compile)
    step = arm.step(q)
    explained = milliseconds(step.explain, 5)
    return {
        "links": Sheet("", ("tick of a Panda that ends at", "median [us]", "first [us]"), rows),
        "calls": Sheet("", ("Panda: hand, posture, limits, a ball", "median"), [
            ("tick", f"{plain:.1f} us"), ("tick while a recording is made", f"{recorded:.1f} us"),
            ("`clone()`", f"{clone:.1f} ms"), ("`stack.compile()` of a stack in the cache", f"{compile_:.1f} ms"),
            ("`step.explain()`", f"{explained:.1f} ms"),
        ]),
    }  # fmt: skip


def controller() -> Controller:
    """A hand with a target in reach, a posture, limits and a ball."""
    robot = wbc.robots.load("panda")
    stack = wbc.Stack(robot, dt=0.005)
    stack.add(EndEffector("panda_hand_tcp"), name="hand").add(Posture(), name="posture", weight=1e-3)
    ball = Obstacle(Sphere(0.1), links="panda_hand", pose=pin.SE3(np.eye(3), np.array([0.9, 0.4, 0.4])))
    return stack.add(JointLimits()).add(ball, name="ball").compile()


def after(arm: Controller, chain: tuple[str, ...]) -> tuple[float, float]:
    """(median, first) time of ticks whose first answer counts as not certified [us]."""
    arm.reset(arm.stack.robot.neutral)
    arm.policy = Policy(chain=chain)
    core = core_of(arm)
    real, fail = core.call, [True]

    def call() -> int:
        flag, fail[0] = real() | (UNSOUND if fail[0] else 0), False
        return flag

    spent = np.empty(TICKS)
    core.call = call
    try:
        for k in range(TICKS):
            fail[0] = True
            began = perf_counter()
            arm.step(arm.stack.robot.neutral)
            spent[k] = perf_counter() - began
    finally:
        core.call = real
    return 1e6 * float(np.median(spent)), 1e6 * float(spent[0])


def milliseconds(call: object, times: int = 20) -> float:
    """Median of a call [ms]."""
    spent = np.empty(times)
    for k in range(times):
        began = perf_counter()
        call()  # type: ignore[operator]
        spent[k] = perf_counter() - began
    return 1e3 * float(np.median(spent))
