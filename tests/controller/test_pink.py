"""Equal stacks give pink's velocities: answers that pink_answers.py recorded of pink on several robots.

FrameTask of pink has the error log6(T'T_target) in the frame's axes, which is no item of this package; it is written
here as an :class:`Expression`, so that its rows and their derivatives come from this package's kinematics.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.robot.sources.files import example_data_folder
from wbc.tasks import Expression, Input, JointLimits, Posture

KNOWN = json.loads((Path(__file__).parent / "data" / "pink.json").read_text())


def frame_task(frame: str) -> Expression:
    """e = log6(T_target' T) with the sign turned: V^-1(theta) R'(p_t - p), theta = log3(R'R_t)."""

    def error(kin: Any, p: Any) -> ca.SX:
        R, target = kin.rotation(frame), p["target"]
        # the rotation vector is along the axis, so that it is the same in both frames
        theta = -R.T @ kin.rotation_error(frame, "world", target.rotation)
        shift = R.T @ (target.position - kin.position(frame))
        square = ca.dot(theta, theta)
        large = ca.if_else(square > 1e-2, square, 1.0)
        half = 0.5 * ca.sqrt(large)
        exact = (1.0 - half / ca.tan(half)) / large
        series = 1.0 / 12.0 + square / 720.0 + square**2 / 30240.0
        across = ca.cross(theta, shift)
        linear = shift - 0.5 * across + ca.if_else(square > 1e-2, exact, series) * ca.cross(theta, across)
        return ca.vertcat(linear, theta)

    weights = (KNOWN["metre"] ** 2,) * 3 + (KNOWN["radian"] ** 2,) * 3
    return Expression(
        error,
        units=("m",) * 3 + ("rad",) * 3,
        inputs=(Input("target", kind="pose", default=pin.SE3.Identity()),),
        weights=weights,
    )


@pytest.mark.parametrize("name", list(KNOWN["robots"]))
def test_equal_stacks_give_the_velocities_of_pink(name: str) -> None:
    known = KNOWN["robots"][name]
    urdf = example_data_folder() / known["urdf"]
    model = pin.buildModelFromUrdf(str(urdf), *([pin.JointModelFreeFlyer()] if known["floating"] else []))
    model = pin.buildReducedModel(model, [model.getJointId(joint) for joint in known["locked"]], pin.neutral(model))
    robot = wbc.robots.load(model, shapes="none")
    stack = wbc.Stack(robot, KNOWN["dt"], damping=KNOWN["damping"], length=1.0, calm=False)
    for frame in known["frames"]:
        stack.add(frame_task(frame), name=frame)
    stack.add(Posture(), weight=KNOWN["posture"]).add(JointLimits(acceleration=False))
    controller = stack.compile(backend="vm")
    for frame in (*known["frames"], "posture"):
        controller[frame].gain = KNOWN["gain"] / KNOWN["dt"]
    controller["posture"].target = pin.neutral(model)
    bound = 0
    for case in known["cases"]:
        controller.reset(case["q"])
        for frame, target in zip(known["frames"], case["targets"], strict=True):
            controller[frame].target = np.array(target)
        step = controller.step(case["q"])
        assert step.status == "solved"
        assert np.abs(step.v - case["v"]).max() <= 1e-6
        bound += bool(step.binding)
    assert bound >= 2
