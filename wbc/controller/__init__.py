"""The controller (floor 8): run-time values in, one call, a step out."""

from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.controller.policy import Policy
from wbc.controller.step import Step
from wbc.qp.certificate import Certificate
from wbc.tick.outcome import Status

__all__ = ["Certificate", "CompiledStack", "Policy", "Status", "Step", "core_of"]
