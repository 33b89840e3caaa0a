"""Whole-body control: declarative tasks, stacked into one QP, compiled to one native tick.

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()
step = controller.step(robot.neutral)
"""

from __future__ import annotations

__version__ = "0.1.0"

from wbc import controller, explain, ik, record
from wbc import export as export
from wbc import robots as robots
from wbc import shapes as shapes
from wbc import tasks as tasks
from wbc import trajectory as trajectory
from wbc.controller import Certificate, Controller, Policy, Stack, Status, Step
from wbc.errors import WbcError
from wbc.explain import Explanation
from wbc.ik import InverseKinematics, Solution
from wbc.record import Recording, Replay, replay

__all__ = [
    "Certificate",
    "Controller",
    "Explanation",
    "InverseKinematics",
    "Policy",
    "Recording",
    "Replay",
    "Solution",
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

# These stood in wbc.controller before they had packages of their own; they are found there for one version more
_MOVED = {
    explain: ("Explanation",),
    ik: ("Branches", "Ending", "InverseKinematics", "Solution"),
    record: ("Recorder", "Recording", "Replay", "replay", "replayed"),
}
vars(controller).update({name: getattr(room, name) for room, names in _MOVED.items() for name in names})
vars(controller).update({"Branch": ik.PathBranch, "Solver": ik.InverseKinematics})


def __getattr__(name: str) -> object:
    if name == "Solver":
        return ik.Solver  # says its new name
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
