"""Whole-body control: declarative tasks, stacked into one QP, compiled to one native tick.

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()
step = controller.step(robot.neutral)
"""

__version__ = "0.1.0"

from wbc import robots as robots
from wbc import shapes as shapes
from wbc import tasks as tasks
from wbc import trajectory as trajectory
from wbc.controller import (
    Certificate,
    Controller,
    Explanation,
    Policy,
    Recording,
    Replay,
    Solution,
    Solver,
    Stack,
    Status,
    Step,
    replay,
)
from wbc.errors import WbcError

__all__ = [
    "Certificate",
    "Controller",
    "Explanation",
    "Policy",
    "Recording",
    "Replay",
    "Solution",
    "Solver",
    "Stack",
    "Status",
    "Step",
    "WbcError",
    "__version__",
    "replay",
    "robots",
    "shapes",
    "tasks",
    "trajectory",
]
