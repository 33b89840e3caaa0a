"""The controller (floor 6)."""

from wbc.controller.controller import Controller
from wbc.controller.recorder import Recorder
from wbc.controller.recording import Recording
from wbc.controller.replaying import Replay, replay, replayed
from wbc.controller.stack import Stack
from wbc.controller.step import Certificate, Status, Step

__all__ = [
    "Certificate",
    "Controller",
    "Recorder",
    "Recording",
    "Replay",
    "Stack",
    "Status",
    "Step",
    "replay",
    "replayed",
]
