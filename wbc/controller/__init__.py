"""The tick (floor 6): buffers in, one call, a step out."""

from wbc.controller.controller import Controller, core_of
from wbc.controller.outcome import Status
from wbc.controller.policy import Policy
from wbc.controller.stack import Stack
from wbc.controller.step import Step
from wbc.qp.certificate import Certificate

__all__ = ["Certificate", "Controller", "Policy", "Stack", "Status", "Step", "core_of"]
