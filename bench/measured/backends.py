"""Ticks of one stack in its own library and in the shared one, and when a process has its first command."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

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
#: How long a process with an empty cache may take [s]
_PATIENCE = 300.0
#: The same: seconds until its first command, and until its ticks are native code
_COLD = """
from time import perf_counter, sleep
began = perf_counter()
import sys
import wbc.robots
from bench.measured.backends import stack_of
robot = wbc.robots.load(sys.argv[1], base="fixed")
controller = stack_of(robot).compile(wait=sys.argv[2] == "wait")
controller.step(robot.neutral)
first = perf_counter() - began
while controller.tier == "vm":
    sleep(0.005)
    controller.step(robot.neutral)
print(first, perf_counter() - began)
"""


def parts() -> dict[str, Sheet | str]:
    """A table with a row a tier, and cold processes."""
    found = {name: _times(wbc.robots.load(name, base="fixed")) for name in ROBOTS}
    rows = [(f"`{tier}`", what, *(us(found[name][tier]) for name in ROBOTS)) for tier, what in TIERS.items()]
    cold = [
        (f"`wait={wait}`", *(f"{seconds:.1f}" for name in ROBOTS for seconds in _cold(name, wait)))
        for wait in (True, False)
    ]
    columns = (f"{name}: {what}" for name in ROBOTS.values() for what in ("first command [s]", "native ticks [s]"))
    return {
        "ticks": Sheet("", ("tier", "what runs", *(f"tick of a {name} [us]" for name in ROBOTS.values())), rows),
        "cold": Sheet("", ("a process with an empty cache", *columns), cold),
    }


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


def _cold(name: str, wait: bool) -> tuple[float, float]:
    with tempfile.TemporaryDirectory() as cache:
        command = [sys.executable, "-c", _COLD, name, "wait" if wait else "go"]
        environment = {**os.environ, "WBC_CACHE": cache}
        told = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=_PATIENCE)
    first, native = map(float, told.stdout.split())
    return first, native
