"""A sensor that raises: the tick did not happen, whatever was given with it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stack.small import DT, Q, arm
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.shapes import Box, Capsule, PlacedShape
from wbc.tasks import EndEffector, JointLimits, Obstacle, Posture


@pytest.fixture(scope="module")
def made() -> Controller:
    """An acceleration of 1 rad/s^2 at most, and a box that is measured."""
    import pinocchio as pin

    bare = arm()
    robot = bare.with_limits(acceleration=1.0).with_shapes(
        {"tip": [PlacedShape(Capsule(0.02, 0.1), pin.SE3.Identity())]}
    )
    stack = Stack(robot, DT).add(EndEffector("tip", kind="position"), name="hand")
    stack.add(Posture(), name="posture", weight=1e-3).add(JointLimits(), name="limits")
    stack.add(Obstacle(Box((0.1, 0.1, 0.1))), name="box")
    return stack.compile(backend="vm")


class Broken:
    """In the place of a sensor."""

    def sense(self, q: np.ndarray) -> None:
        raise OSError("the camera is gone")


def fail(controller: Controller, **given: object) -> None:
    """One step whose sensor raises."""
    good = core_of(controller).sensors
    core_of(controller).sensors = [(Broken(), handle) for _, handle in good]
    with pytest.raises(OSError, match="camera"):
        controller.step(np.array([1.0, -1.0]), **given)
    core_of(controller).sensors = good


@pytest.mark.parametrize("given", [{"v": [0.5, -0.5]}, {"dt": 2 * DT}, {}])
def test_the_next_step_is_as_if_nothing_had_been(made: Controller, given: dict) -> None:
    commands = []
    for broken in (False, True):
        controller = made.clone()
        controller.reset(np.array(Q))
        controller["hand"].target = (0.2, 0.6, 0.0)
        controller["posture"].ramp(1.0, 10 * DT)
        for tick in range(6):
            if broken and tick in (0, 3):
                fail(controller, **given)
            commands.append((controller.step(np.array(Q)).v.tolist(), controller["posture"].weight))
    assert commands[:6] == commands[6:]
    changes = np.abs(np.diff([[0.0, 0.0], *(v for v, _ in commands[6:])], axis=0))
    assert changes.max() <= 1.0 * DT * (1 + 1e-9)
