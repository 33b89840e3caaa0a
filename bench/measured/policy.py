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
from wbc.api import Controller
from wbc.controller import Policy, core_of
from wbc.controller.policy import CHAIN
from wbc.shapes import Sphere
from wbc.tasks import CenterOfMass, EndEffector, JointLimits, Obstacle, Posture, SurfaceContact, TorqueLimits
from wbc.tick.buffers import UNSOUND

TICKS = 200
#: States of the humanoid, in which contacts, torques and limits have no common answer
THROWN = 5


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
        "humanoid": humanoid_links(),
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


def humanoid(soft: float | None) -> Controller:
    """TALOS on two feet, commanded by torques at 2 ms."""
    robot = wbc.robots.load("talos").with_limits(acceleration=40.0)
    stack = wbc.Stack(robot, dt=0.002).add(CenterOfMass(gain=4.0), name="balance", weight=10.0)
    stack.add(Posture(gain=5.0), name="posture", weight=1e-2).add(JointLimits()).add(TorqueLimits())
    for side in ("left", "right"):
        stack.add(SurfaceContact(f"{side}_sole_link", half_lengths=(0.1, 0.06)), name=side, soft=soft)
    return stack.compile(command="torque")


def humanoid_links() -> Sheet:
    """Whole ticks of a humanoid that end at a link, where all rows hold and where some give way."""
    columns = []
    for soft in (None, 1e3):
        tick, rng = humanoid(soft), np.random.default_rng(3)
        robot = tick.stack.robot
        still = rng.standard_normal((THROWN, robot.nv)) * 1e-3
        spread = np.where(np.arange(robot.nv) < robot.base_nv, 0.3, 1.0)
        for states in (still, rng.standard_normal((THROWN, robot.nv)) * spread):
            columns.append([after(tick, (link,), states)[0] for link in CHAIN])
    return Sheet(
        "", ("tick of TALOS that ends at [ms]", "rows hold", "rows give way", "soft contacts: hold", "give way"),
        [(link, *(f"{1e-3 * column[k]:.1f}" for column in columns)) for k, link in enumerate(CHAIN)],
    )  # fmt: skip


def after(arm: Controller, chain: tuple[str, ...], states: np.ndarray | None = None) -> tuple[float, float]:
    """(median, first) time of ticks whose first answer counts as not certified [us]; ``states``: velocities there."""
    arm.reset(arm.stack.robot.neutral)
    arm.policy = Policy(chain=chain)
    core = core_of(arm)
    real, fail = core.call, [True]

    def call() -> int:
        flag, fail[0] = real() | (UNSOUND if fail[0] else 0), False
        return flag

    given = [None] * TICKS if states is None else list(states)
    spent = np.empty(len(given))
    core.call = call
    try:
        for k, v in enumerate(given):
            fail[0] = True
            if v is not None:
                arm.reset(arm.stack.robot.neutral)
            began = perf_counter()
            arm.step(arm.stack.robot.neutral, v)
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
