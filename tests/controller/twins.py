"""Controllers in pairs: what one saw and the other did not must leave no trace in what they answer."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, FRAMES, inside, robot
from wbc import Controller, Stack
from wbc.controller import core_of
from wbc.shapes import Sphere
from wbc.tasks import EndEffector, JointLimits, Obstacle, PitchPlane, Posture

BACKENDS = (IN_PYTHON, COMPILED)
TURN = pin.exp3(np.array([0.3, -1.2, 0.7]))
POSE = pin.SE3(TURN, np.array([0.4, 0.1, 0.5]))


@cache
def stack(name: str) -> Stack:
    """Values of every kind: pose, vector, rotation, scalar, configuration, tangent; tasks, margins and bounds."""
    bot, f = robot(name), FRAMES[name]
    out = Stack(bot, DT)
    out.add(EndEffector(f.tip), name="hand")
    out.add(Posture(), name="posture", weight=0.01)
    out.add(JointLimits(), name="limits")
    if name == "panda":
        out.add(EndEffector(f.tip, kind="position"), name="place", weight=0.2)
        out.add(EndEffector(f.tip, kind="orientation"), name="turn", weight=0.2)
        out.add(PitchPlane(*f.plane), name="plane", weight=0.1)
        out.add(Obstacle(Sphere(0.05)), name="ball")
    return out


@cache
def untouched(name: str, backend: str) -> Controller:
    """One that is compiled only."""
    return stack(name).compile(**way(backend))


def make(name: str, backend: str) -> Controller:
    return untouched(name, backend).clone()


def prepare(controller: Controller, ticks: int) -> None:
    """The same history each time: values set by the user, then some ticks."""
    bot = controller.stack.robot
    controller["posture"].weight = 0.02
    controller["limits"].velocity_scale = 0.9
    if "ball" in controller:
        controller["ball"].pose = POSE
        controller["hand"].mask = (1, 1, 1, 0.5, 0.5, 0.5)
    rng = np.random.default_rng(3)
    for _ in range(ticks):
        controller.step(inside(bot, rng))


def state(controller: Controller) -> dict[str, Any]:
    """Everything that a later answer may depend on, as bytes."""
    names = ("q", "v_last", "use_v", "p", "dt", "weight", "enabled", "bound_enabled", "report")
    buffers = {name: getattr(core_of(controller).tick, name).tobytes() for name in names}
    return buffers | {"last_command": controller.last_command.tobytes(), "table": table(controller)}


def table(controller: Controller) -> str:
    """The table that users see, and what each handle says about its switches."""
    handles = [
        (name, controller[name].enabled, controller[name].mask.tolist()) for name in core_of(controller).layout.blocks
    ]
    return f"{controller}{handles}"


def next_ticks(controller: Controller) -> list[bytes]:
    """All numbers of the next good ticks; the first without dt, then another dt and a measured velocity."""
    bot, rng = controller.stack.robot, np.random.default_rng(4)
    good = [inside(bot, rng) for _ in range(3)]
    steps = [
        controller.step(good[0]),
        controller.step(good[1], np.full(bot.nv, 0.1), 0.8 * DT),
        controller.step(good[2]),
    ]
    return [step._data for step in steps]
