"""Ticks of one stack compiled for it, in the library that all stacks share, and in numpy."""

from __future__ import annotations

import wbc
from bench.measured.ticks import median_us
from bench.sheet import Sheet, us
from wbc.controller import core_of
from wbc.robot import Robot
from wbc.tasks import CenterOfMass, EndEffector, JointLimits, Posture
from wbc.tick.generic import GenericTick

#: Backend -> what runs where
BACKENDS = {
    "native": "C compiled for the stack",
    "vm": "rows on CasADi's virtual machine, the rest in the library that all stacks share",
    "python": "rows on CasADi's virtual machine, the rest in numpy and the daqp package",
}
ROBOTS = {"panda": "Panda", "g1": "G1, pelvis fixed"}


def parts() -> dict[str, Sheet | str]:
    """A table with a row a backend."""
    found = {name: _times(wbc.robots.load(name, base="fixed")) for name in ROBOTS}
    rows = [(f"`{b}`", what, *(us(found[name][b]) for name in ROBOTS)) for b, what in BACKENDS.items()]
    return {
        "ticks": Sheet("", ("backend", "what runs", *(f"tick of a {name} [us]" for name in ROBOTS.values())), rows),
    }


def _times(robot: Robot) -> dict[str, float]:
    """Backend -> median time of a tick [us]: a hand, the centre of mass, a posture, limits."""
    stack = wbc.Stack(robot, dt=0.005)
    stack.add(EndEffector(robot.frames["tip"] if "tip" in robot.frames else robot.frames["left_hand"]), name="hand")
    stack.add(CenterOfMass(), weight=0.1).add(Posture(), weight=1e-2).add(JointLimits())
    out = {}
    for backend in BACKENDS:
        controller = stack.compile(backend=backend)
        if isinstance(core_of(controller).tick, GenericTick) != (backend == "vm"):
            raise RuntimeError(f"{backend}: another tick runs than the table says")
        out[backend] = median_us(controller, robot.neutral, 300 if backend == "python" else 1000, 3)
    return out
