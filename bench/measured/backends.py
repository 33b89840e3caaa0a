"""Ticks of one stack in its own library and in the shared one, beside each other."""

from __future__ import annotations

import wbc
from bench.measured.ticks import median_us
from bench.sheet import Sheet, us
from wbc.robot import Robot
from wbc.tasks import CenterOfMass, EndEffector, JointLimits, Posture

#: Tier -> what runs where
TIERS = {
    "native": "C compiled for the stack: all ticks of `compile(wait=True)`, those of `compile()` some seconds on",
    "vm": "rows on CasADi's virtual machine, the rest in the library that all stacks share: the first of `compile()`",
}
ROBOTS = {"panda": "Panda", "g1": "G1, pelvis fixed"}


def parts() -> dict[str, Sheet | str]:
    """A table with a row a tier."""
    found = {name: _times(wbc.robots.load(name, base="fixed")) for name in ROBOTS}
    rows = [(f"`{tier}`", what, *(us(found[name][tier]) for name in ROBOTS)) for tier, what in TIERS.items()]
    return {"ticks": Sheet("", ("tier", "what runs", *(f"tick of a {name} [us]" for name in ROBOTS.values())), rows)}


def stack_of(robot: Robot) -> wbc.Stack:
    """A hand, the centre of mass, a posture, limits."""
    stack = wbc.Stack(robot, dt=0.005)
    stack.add(EndEffector(robot.frames["tip"] if "tip" in robot.frames else robot.frames["left_hand"]), name="hand")
    return stack.add(CenterOfMass(), weight=0.1).add(Posture(), weight=1e-2).add(JointLimits())


def _times(robot: Robot) -> dict[str, float]:
    """Tier -> median time of a tick [us]."""
    stack, out = stack_of(robot), {}
    for tier in TIERS:
        out[tier] = median_us(stack.compile(backend=tier), robot.neutral, 1000, 3)
    return out
