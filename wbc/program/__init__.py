"""Programs of steps with guards over a controller's tasks. See docs/programs.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import extras, lazy

if TYPE_CHECKING:
    from wbc.program.hand import Gripper
    from wbc.program.reference import HandReference
    from wbc.program.runner import Event, Report, Runner
    from wbc.program.steps import (
        Activate,
        Alternatives,
        Approach,
        Grasp,
        Guard,
        Move,
        Operate,
        PoseTarget,
        Program,
        ProgramError,
        Release,
        Retreat,
        Wait,
    )
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "Activate",
    "Alternatives",
    "Approach",
    "Event",
    "Grasp",
    "Gripper",
    "Guard",
    "HandReference",
    "Move",
    "Operate",
    "PoseTarget",
    "Program",
    "ProgramError",
    "Release",
    "Report",
    "Retreat",
    "Runner",
    "Wait",
]


extras.require("programs", "a program of steps")


def __dir__() -> list[str]:
    return __all__
