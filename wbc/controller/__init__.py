"""The controller (floor 6)."""

from wbc.controller.branches import Branches
from wbc.controller.continuation import Branch
from wbc.controller.controller import Controller
from wbc.controller.explanation import Explanation
from wbc.controller.outcome import Certificate, Status
from wbc.controller.policy import Policy
from wbc.controller.recorder import Recorder
from wbc.controller.recording import Recording
from wbc.controller.replaying import Replay, replay, replayed
from wbc.controller.solution import Ending, Solution
from wbc.controller.solver import Solver
from wbc.controller.stack import Stack
from wbc.controller.step import Step

__all__ = [
    "Branch",
    "Branches",
    "Certificate",
    "Controller",
    "Ending",
    "Explanation",
    "Policy",
    "Recorder",
    "Recording",
    "Replay",
    "Solution",
    "Solver",
    "Stack",
    "Status",
    "Step",
    "replay",
    "replayed",
]
