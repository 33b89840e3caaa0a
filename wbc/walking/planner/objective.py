"""What a plan is the best in."""

from __future__ import annotations

from typing import Literal

Objective = Literal["velocity", "destination"]
OBJECTIVES: tuple[Objective, ...] = ("destination", "velocity")
