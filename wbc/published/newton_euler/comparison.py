"""The published controllers and today's beside them, on the published task and on any robot on a fixed base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wbc.errors import UnsupportedJointError
from wbc.motion_control.comparison import CONTROLLERS, ControlScenario, Maker, scenario_of
from wbc.motion_control.motion import Motion, checked_dynamics, checked_motion
from wbc.multibody import pin
from wbc.published.newton_euler.control import ERROR_WEIGHT, Adaptive, Linearised, Nominal, OneStep
from wbc.published.newton_euler.decoupling import DecoupledArm, DecoupledTwo
from wbc.published.newton_euler.dynamics import Rigid
from wbc.published.newton_euler.three_link import arm, task
from wbc.robot import Robot
from wbc.robots import load

#: Preview of controller 2 [s]: the step of the thesis
PREVIEW = 0.01
#: Half the mass of the last link [kg]
HALF = 2.125
#: Frame at the tip, which is the origin of link 3
TIP = "tip"


def _stiff(robot: Robot, motion: Motion, dt: float) -> Linearised:
    """Controller 1 with errors of positions that weigh as the rates that remove them in one step."""
    n = robot.nv
    weights = np.repeat([ERROR_WEIGHT / dt**2, ERROR_WEIGHT], n)
    return Linearised(_believed(robot, motion), motion, dt, OneStep(n, np.diag(weights)))


def _believed(robot: Robot, motion: Motion) -> Rigid:
    """The equations of a robot on a fixed base whose joints all have torques of their own."""
    if robot.base != "fixed":
        raise UnsupportedJointError("robot.base", robot.base, "the published controllers are of a fixed base")
    return Rigid(checked_dynamics(robot, checked_motion(robot, motion)(0.0)[0]).model)


#: Name -> published controller of any robot on a fixed base, by the equations of its model
PUBLISHED: Mapping[str, Maker] = {
    "nominal torque": lambda robot, motion, dt: Nominal(_believed(robot, motion), motion),
    "1 linearised": lambda robot, motion, dt: Linearised(_believed(robot, motion), motion, dt),
    "1 with stiff weights": _stiff,
    "2 on all joints": lambda robot, motion, dt: DecoupledArm(_believed(robot, motion), motion, PREVIEW),
    "3 adaptive": lambda robot, motion, dt: Adaptive(_believed(robot, motion), motion, dt),
}
#: What the thesis has for its own arm alone
OWN: Mapping[str, Maker] = {"2 decoupled": lambda robot, motion, dt: DecoupledTwo(motion, PREVIEW)}


def published_scenario() -> ControlScenario:
    """The arm, its line of 0.58 m in 1 s, the three controllers and today's."""
    model = arm().model.copy()
    model.name = "three_link"
    model.addFrame(pin.Frame(TIP, model.njoints - 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return ControlScenario(load(model), task(), 1.0, {**PUBLISHED, **OWN, **CONTROLLERS}, HALF, TIP)


def scenario_with_published(robot: Robot) -> ControlScenario:
    """A swing of any robot; on a fixed base with the published controllers too."""
    scenario = scenario_of(robot)
    return replace(scenario, controllers={**PUBLISHED, **scenario.controllers})
