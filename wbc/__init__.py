"""Whole-body control: declarative tasks, stacked into one QP, compiled to one native tick.

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()
step = controller.step(robot.neutral)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

__version__ = "0.2.0"

if TYPE_CHECKING:
    from wbc import analysis as analysis
    from wbc import coordinates as coordinates
    from wbc import errors as errors
    from wbc import proximity as proximity
    from wbc import resolvers as resolvers
    from wbc import robots as robots
    from wbc import shapes as shapes
    from wbc import tasks as tasks
    from wbc import teleop as teleop
    from wbc import track as track
    from wbc import trajectory as trajectory
    from wbc import viewer as viewer
    from wbc import walking as walking
    from wbc.api import Controller, Stack
    from wbc.controller import Certificate, Policy, Status, Step
    from wbc.errors import WbcError
    from wbc.explain import Explanation
    from wbc.ik import InverseKinematics, Solution
    from wbc.record import Recording
    from wbc.replaying import Replay as Replay
    from wbc.replaying import replay
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "Certificate",
    "Controller",
    "Explanation",
    "InverseKinematics",
    "Policy",
    "Recording",
    "Solution",
    "Stack",
    "Status",
    "Step",
    "WbcError",
    "__version__",
    "analysis",
    "coordinates",
    "errors",
    "proximity",
    "replay",
    "resolvers",
    "robots",
    "shapes",
    "tasks",
    "teleop",
    "track",
    "trajectory",
    "viewer",
    "walking",
]


def __dir__() -> list[str]:
    return __all__
