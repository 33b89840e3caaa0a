"""Stacks under what learns: gradients for PyTorch, actions of Gymnasium, robots of LeRobot (floor 13)."""

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.learning.gymnasium_actions import stack_actions as stack_actions
    from wbc.learning.lerobot_robot import StackRobot as StackRobot, StackTeleoperator as StackTeleoperator
    from wbc.learning.torch_layer import command_layer as command_layer
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
