"""What contacts, wrenches, motors and drives refuse, and what only a stack that commands torques takes."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.torque.problems import DT, robot, stack
from tests.torque.test_motors import WRIST
from wbc.api import Stack
from wbc.errors import BoundsError, CommandError, DuplicateNameError, RangeError, ShapeError, UnknownNameError
from wbc.robot.transmission import Transmission
from wbc.tasks import (
    DivergentComponent,
    DriveTorqueLimits,
    ExternalWrench,
    Item,
    JointFriction,
    LineContact,
    PointContact,
    RigidGrasp,
    RollingContact,
    SlidingContact,
    SurfaceContact,
    TorqueLimits,
    WrenchSum,
)


def on(name: str, item: Item) -> Stack:
    """A robot's stack of one item."""
    return Stack(robot(name), dt=DT).add(item)


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: RigidGrasp("a", force=-1.0), BoundsError),
        (lambda: RigidGrasp("a", torque=(1.0, 2.0)), ShapeError),
        (lambda: PointContact("a", friction=-0.1), RangeError),
        (lambda: PointContact("a", edges=3), RangeError),
        (lambda: PointContact("a", most=-1.0), RangeError),
        (lambda: SurfaceContact("a", half_lengths=(0.1,)), ShapeError),
        (lambda: SurfaceContact("a", half_lengths=(0.1, 0.0)), RangeError),
        (lambda: TorqueLimits(()), ShapeError),
        (lambda: on("talos", PointContact("left_sole")), UnknownNameError),
        (lambda: on("talos", TorqueLimits("no_joint")), UnknownNameError),
        (lambda: on("talos", TorqueLimits()).compile(), CommandError),
        (lambda: Stack(robot("talos"), dt=DT).compile(command="power"), UnknownNameError),
        (lambda: LineContact("a", half_length=0.0), RangeError),
        (lambda: SlidingContact("a", slow=0.0), RangeError),
        (lambda: SlidingContact("a", friction=-1.0), RangeError),
        (lambda: JointFriction(viscous=-1.0), BoundsError),
        (lambda: on("panda", JointFriction(coulomb=(1.0, 2.0))), ShapeError),
        (lambda: on("panda", ExternalWrench("no_frame")), UnknownNameError),
        (lambda: on("panda", ExternalWrench("panda_hand_tcp")).compile(), CommandError),
        (lambda: on("panda", JointFriction()).compile(command="acceleration"), CommandError),
        (lambda: TorqueLimits(slew=-1.0), BoundsError),
        (lambda: on("panda", TorqueLimits(slew=(1.0, 2.0))), ShapeError),
        (lambda: DriveTorqueLimits("wrist", 1.0), ShapeError),
        (lambda: DriveTorqueLimits(WRIST, (1.0, 2.0, 3.0)), ShapeError),
        (lambda: DriveTorqueLimits(WRIST, -1.0), BoundsError),
        (lambda: on("talos", DriveTorqueLimits(WRIST, 1.0)), UnknownNameError),
        (lambda: Transmission(("a", "b"), {"x": {"a": 1.0}, "y": {"a": 2.0}}), RangeError),
        (lambda: WrenchSum(()), ShapeError),
        (lambda: WrenchSum(("a", "a")), DuplicateNameError),
        (lambda: stack("walker").add(WrenchSum("grip 3")).commanding("torque"), UnknownNameError),
        (lambda: stack("walker").add(WrenchSum("hand")).commanding("torque"), UnknownNameError),
        (lambda: RollingContact("a", radius=0.0), RangeError),
        (lambda: RollingContact("a", radius=0.1, axis=(0.0, 0.0, 0.0)), RangeError),
        (lambda: RollingContact("a", radius=0.1, friction=-1.0), RangeError),
        (lambda: on("panda", RollingContact("panda_hand_tcp", radius=0.1)), RangeError),
        (lambda: on("walker", RollingContact("body", radius=0.1)), RangeError),
        (lambda: DivergentComponent(omega=0.0), RangeError),
    ],
)
def test_bad_declarations_are_refused(make: Callable[[], object], error: type[Exception]) -> None:
    with pytest.raises(error):
        make()
