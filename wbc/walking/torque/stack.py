"""The stack of torques under a walk."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from wbc import tasks
from wbc.api import Controller, Stack
from wbc.errors import RangeError
from wbc.robot.transmission import Transmission
from wbc.robots import HoldRating, Walker, hold_rating
from wbc.simulation import GripKind
from wbc.walking.torque.grasps import GRASPS

#: Period of the torques [s]
PERIOD = 0.001
#: Name of the wrench that acts on the body and is not known
UNKNOWN = "unknown"
#: Weight of the body's pose, beside 1 of every joint
BODY = 100.0
#: So many hands that may tilt fix the body
STEADY = 3


class TorqueStack:
    """The compiled stack: all coordinates follow a reference, closed hands bear wrenches within their rating.

    Args:
        walker: with masses, as :func:`wbc.robots.with_masses` gives it; its torque limits.
        kinds: how holds may be held. rating: of every hold. backend: as of ``Stack.compile``.

    Raises:
        RangeError: a robot without masses; holds that let hands tilt, and not roll or with fewer than four arms.
    """

    def __init__(
        self,
        walker: Walker,
        kinds: Iterable[GripKind],
        *,
        rating: HoldRating | None = None,
        period: float = PERIOD,
        backend: str = "auto",
    ) -> None:
        robot, rating = walker.robot, rating or hold_rating()
        if min(float(i.mass) for i in robot.model.inertias[1:]) <= 0.0:
            raise RangeError("walker", robot.name, "torques need masses: wbc.robots.with_masses(walker)")
        self.walker, self.kinds, self.rating = walker, tuple(dict.fromkeys(kinds)), rating
        few = GripKind.POSITION in self.kinds and len(walker.arms) <= STEADY
        if few or not set(self.kinds) <= set(GRASPS):
            why = (
                "two hands that may tilt on their holds bear no moment about the line through them, so that no torques "
                "keep the body from turning about it while the third one swings; take holds with max_tilt = 0, "
                "--rigid, or four arms"
            )
            raise RangeError("kinds", [str(kind) for kind in self.kinds], f"expected holds that fix the tilt: {why}")
        stack = Stack(robot, dt=period, calm=False)
        weights = np.where(np.arange(robot.nv) < robot.base_nv, BODY, 1.0)
        follow = tasks.Posture(joints=robot.joint_names, weights=tuple(weights.tolist()))
        stack.add(follow, name="reference")
        joints = tuple(name for name in robot.joint_names if robot.dofs(name).start >= robot.base_nv)
        # Each joint has a drive of its own: their limits can be set one by one, of a limp motor to 0
        drives = Transmission(joints, {name: {name: 1.0} for name in joints})
        effort = tuple(robot.limits.effort[robot.base_nv :].tolist())
        stack.add(tasks.JointLimits(), name="limits")
        stack.add(tasks.DriveTorqueLimits(drives, torque=effort), name="torques")
        stack.add(tasks.ExternalWrench("body"), name=UNKNOWN)
        for arm in walker.arms:
            for kind in self.kinds:
                grasp = GRASPS[kind](arm.hand, force=rating.force, torque=rating.torque)
                stack.add(grasp, name=f"{arm.hand} {kind}")
        self.controller: Controller = stack.compile(command="torque", backend=backend)
