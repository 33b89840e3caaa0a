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
    from wbc import (
        analysis as analysis,
        climb as climb,
        coordinates as coordinates,
        errors as errors,
        proximity as proximity,
        resolvers as resolvers,
        robots as robots,
        shapes as shapes,
        tasks as tasks,
        teleop as teleop,
        track as track,
        trajectory as trajectory,
        viewer as viewer,
    )
    from wbc.api import Controller as Controller, Stack as Stack
    from wbc.controller import Certificate as Certificate, Policy as Policy, Status as Status, Step as Step
    from wbc.errors import WbcError as WbcError
    from wbc.explain import Explanation as Explanation
    from wbc.ik import InverseKinematics as InverseKinematics, Solution as Solution
    from wbc.multibody import SE3 as SE3
    from wbc.record import Recording as Recording
    from wbc.replaying import Replay as Replay, replay as replay
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__, "__version__")
