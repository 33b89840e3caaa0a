"""Programs of steps with guards over a controller's tasks. See docs/programs.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import extras, lazy

if TYPE_CHECKING:
    from wbc.program.hand import Gripper as Gripper, HandReference as HandReference
    from wbc.program.runner import Event as Event, Report as Report, Runner as Runner
    from wbc.program.steps import (
        Activate as Activate,
        Alternatives as Alternatives,
        Approach as Approach,
        Grasp as Grasp,
        Guard as Guard,
        Move as Move,
        Operate as Operate,
        PoseTarget as PoseTarget,
        Program as Program,
        ProgramError as ProgramError,
        Release as Release,
        Retreat as Retreat,
        Wait as Wait,
    )
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)


extras.require("programs", "a program of steps")
