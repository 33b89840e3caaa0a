"""The loop that carries out a contact plan: the stack, a state machine a limb, and the log."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.climb.loop.limb_state import TRANSITIONS as TRANSITIONS, Cause as Cause, LimbState as LimbState
    from wbc.climb.loop.loop import ClimbLoop as ClimbLoop, ClimbOutcome as ClimbOutcome, ClimbRun as ClimbRun
    from wbc.climb.loop.reference import PlanReference as PlanReference
    from wbc.climb.loop.stack import FootholdContact as FootholdContact, climb_stack as climb_stack
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
