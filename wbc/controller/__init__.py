"""The tick (floor 6): buffers in, one call, a step out."""

from typing import TYPE_CHECKING

from wbc.controller import hooks
from wbc.controller.controller import Controller, core_of
from wbc.controller.outcome import Certificate, Status
from wbc.controller.policy import Policy
from wbc.controller.stack import Stack
from wbc.controller.step import Step

__all__ = ["Certificate", "Controller", "Policy", "Stack", "Status", "Step", "core_of"]

if not TYPE_CHECKING:
    __getattr__ = hooks.moved
