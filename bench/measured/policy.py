"""Ticks of a humanoid whose first answer is not certified: the links of the chain."""

from __future__ import annotations

from time import perf_counter

import numpy as np

import wbc
from bench.sheet import Sheet
from wbc.api import Controller
from wbc.controller import Policy, core_of
from wbc.controller.policy import CHAIN
from wbc.tasks import CenterOfMass, JointLimits, Posture, SurfaceContact, TorqueLimits
from wbc.tick.buffers import UNSOUND

#: States of the humanoid, in which contacts, torques and limits have no common answer
THROWN = 5


def parts() -> dict[str, Sheet | str]:
    """A table of links."""
    return {"humanoid": humanoid_links()}


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
            columns.append([after(tick, (link,), states) for link in CHAIN])
    return Sheet(
        "", ("tick of TALOS that ends at [ms]", "rows hold", "rows give way", "soft contacts: hold", "give way"),
        [(link, *(f"{1e-3 * column[k]:.1f}" for column in columns)) for k, link in enumerate(CHAIN)],
    )  # fmt: skip


def after(arm: Controller, chain: tuple[str, ...], states: np.ndarray) -> float:
    """Median time of ticks whose first answer counts as not certified [us], at these velocities."""
    arm.reset(arm.stack.robot.neutral)
    arm.policy = Policy(chain=chain)
    core = core_of(arm)
    real, fail = core.call, [True]

    def call() -> int:
        flag, fail[0] = real() | (UNSOUND if fail[0] else 0), False
        return flag

    spent = np.empty(len(states))
    core.call = call
    try:
        for k, v in enumerate(states):
            fail[0] = True
            arm.reset(arm.stack.robot.neutral)
            began = perf_counter()
            arm.step(arm.stack.robot.neutral, v)
            spent[k] = perf_counter() - began
    finally:
        core.call = real
    return 1e6 * float(np.median(spent))
