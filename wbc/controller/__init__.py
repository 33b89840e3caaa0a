"""The controller (floor 6)."""

from wbc.controller.controller import Controller
from wbc.controller.stack import Stack
from wbc.controller.step import Certificate, Status, Step

__all__ = ["Certificate", "Controller", "Stack", "Status", "Step"]
