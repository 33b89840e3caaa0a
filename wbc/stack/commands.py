"""What ticks command."""

from __future__ import annotations

from typing import Literal

#: By their numbers in C
COMMANDS: tuple[Literal["velocity", "acceleration", "torque"], ...] = ("velocity", "acceleration", "torque")
