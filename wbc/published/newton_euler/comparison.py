"""The published controllers and today's beside them on the published task."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import pinocchio as pin

from wbc.motion_control.comparison import CONTROLLERS, Maker, Scenario
from wbc.motion_control.motion import Motion
from wbc.published.newton_euler.control import ERROR_WEIGHT, Adaptive, Linearised, Nominal, OneStep
from wbc.published.newton_euler.decoupling import DecoupledArm, DecoupledTwo
from wbc.published.newton_euler.links import Arm
from wbc.published.newton_euler.simulation import rigid
from wbc.published.newton_euler.three_link import arm, task
from wbc.robot import Robot
from wbc.robots import load

#: Preview of controller 2 [s]: the step of the thesis
PREVIEW = 0.01
#: Half the mass of the last link [kg]
HALF = 2.125
#: Frame at the tip, which is the origin of link 3
TIP = "tip"


@cache
def _arm() -> Arm:
    return arm()


def _stiff(robot: Robot, motion: Motion, dt: float) -> Linearised:
    """Controller 1 with errors of positions that weigh as the rates that remove them in one step."""
    return Linearised(_arm(), motion, dt, OneStep(3, np.diag([ERROR_WEIGHT / dt**2] * 3 + [ERROR_WEIGHT] * 3)))


#: Name -> published controller; the robot that they believe in is the published arm
PUBLISHED: Mapping[str, Maker] = {
    "nominal torque": lambda robot, motion, dt: Nominal(_arm(), motion),
    "1 linearised": lambda robot, motion, dt: Linearised(_arm(), motion, dt),
    "1 with stiff weights": _stiff,
    "2 decoupled": lambda robot, motion, dt: DecoupledTwo(motion, PREVIEW),
    "2 on all joints": lambda robot, motion, dt: DecoupledArm(rigid(_arm().model), motion, PREVIEW),
    "3 adaptive": lambda robot, motion, dt: Adaptive(_arm(), motion, dt),
}


def published_scenario() -> Scenario:
    """The arm, its line of 0.58 m in 1 s, the three controllers and today's."""
    model = _arm().model.copy()
    model.name = "three_link"
    model.addFrame(pin.Frame(TIP, model.njoints - 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return Scenario(load(model), task(), 1.0, {**PUBLISHED, **CONTROLLERS}, HALF, TIP)
