"""Out of reach, joints that a task does not speak of stay where they are: curvature bends nothing about them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.calm.scenes import TIPS, Array, machine
from wbc.api import Controller
from wbc.tasks import AxisAlign, EndEffector, JointLimits, LookAt, Posture

START = np.array([0.0, -0.3, 0.0, -2.0, 0.0, 1.8, 0.5])


def controller_of(*items: tuple[object, float]) -> Controller:
    stack = wbc.Stack(machine("panda"), 0.01)
    for k, (item, weight) in enumerate(items):
        stack.add(item, name=f"task{k}", weight=weight)  # type: ignore[arg-type]
    stack.add(Posture(), name="posture", weight=1e-4).add(JointLimits())
    controller = stack.compile(backend="vm")
    q = controller.stack.robot.neutral.copy()
    q[:7] = START
    controller.reset(q)
    controller.step(q)
    return controller


def commands(controller: Controller, ticks: int) -> Array:
    q = controller.stack.robot.neutral.copy()
    q[:7] = START
    controller.reset(q)
    controller["posture"].target = q
    out = []
    for _ in range(ticks):
        step = controller.step(q)
        assert step.status == "solved"
        q = pin.integrate(controller.stack.robot.model, q, step.v * 0.01)
        out.append(step.v.copy())
    return np.array(out)


@pytest.mark.parametrize("kind", ["align", "look"])
def test_of_an_axis(kind: str) -> None:
    """A hand reaches for what is too far away, and another task wants its axis elsewhere: no turn about the axis."""
    axis = AxisAlign("panda_hand") if kind == "align" else LookAt("panda_hand")
    controller = controller_of((EndEffector(TIPS["panda"], kind="position"), 1.0), (axis, 0.1))
    hand = controller["task0"]
    hand.target = np.array(hand.target) + [1.0, 0.0, 0.1]
    controller["task1"].target = (1.0, -1.0, 1.0) if kind == "align" else (0.3, -1.0, 1.0)
    hand.gain = controller["task1"].gain = controller["posture"].gain = 5.0
    v = commands(controller, 700)
    assert np.abs(v[:, 6]).max() < 1e-6
    assert np.abs(v[:, :6]).max() > 1.0
    assert np.abs(v[-50:]).max() < 1e-5


@pytest.mark.parametrize("kind", ["position", "pose"])
def test_of_the_joints_before_a_moving_reference(kind: str) -> None:
    item = EndEffector(TIPS["panda"], kind=kind, relative_to="panda_link3")  # type: ignore[arg-type]
    controller = controller_of((item, 1.0))
    hand, away = controller["task0"], np.array([1.0, 0.3, 0.2])
    if kind == "pose":
        pose = pin.SE3(hand.target)
        pose.translation = pose.translation + away
        hand.target = pose
    else:
        hand.target = np.array(hand.target) + away
    hand.gain = controller["posture"].gain = 5.0
    v = commands(controller, 400)
    assert np.abs(v[:, :3]).max() < 1e-6
    assert np.abs(v[:, 3:]).max() > 1.0
    assert np.abs(v[-50:]).max() < 1e-5
