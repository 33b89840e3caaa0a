"""The states of a limb in the loop, and what leads from one to another."""

from __future__ import annotations

from enum import IntEnum, StrEnum

from wbc.errors import RangeError


class LimbState(IntEnum):
    """What a limb does; its number is in the log.

    Attributes:
        HELD: closed on a foothold: hard rows.
        UNLOADING: still closed; its load goes over to the others.
        SWINGING: in the air, follows the plan.
        REACHING: about to land; from the planned time on the plan waits for it.
        LATCHING: closed again; it takes its load.
        FREE: in the air, and the plan has no foothold for it.
    """

    HELD = 0
    UNLOADING = 1
    SWINGING = 2
    REACHING = 3
    LATCHING = 4
    FREE = 5


class Cause(StrEnum):
    """Why a limb's state changes."""

    LIFT_NEARS = "its lift comes near"
    UNLOADED = "its load is gone"
    LANDING_NEARS = "its landing comes near"
    AT_FOOTHOLD = "it is at its foothold"
    SETTLED = "it bears its load"
    NO_FOOTHOLD = "the plan has no foothold for it"
    HOLD_LOST = "what it held is gone"
    LIMB_FAILED = "it holds no more"
    NEW_PLAN = "a new plan begins"


#: States in which a limb's contact is closed
CLOSED = frozenset({LimbState.HELD, LimbState.UNLOADING, LimbState.LATCHING})
#: (state, cause) -> next state: what is not here does not happen
TRANSITIONS: dict[tuple[LimbState, Cause], LimbState] = {
    (LimbState.HELD, Cause.LIFT_NEARS): LimbState.UNLOADING,
    (LimbState.UNLOADING, Cause.UNLOADED): LimbState.SWINGING,
    (LimbState.FREE, Cause.LIFT_NEARS): LimbState.SWINGING,
    (LimbState.SWINGING, Cause.LANDING_NEARS): LimbState.REACHING,
    (LimbState.SWINGING, Cause.NO_FOOTHOLD): LimbState.FREE,
    (LimbState.REACHING, Cause.AT_FOOTHOLD): LimbState.LATCHING,
    (LimbState.LATCHING, Cause.SETTLED): LimbState.HELD,
    # A foothold that gives way, or a limb that fails
    **{(state, cause): LimbState.FREE for state in CLOSED for cause in (Cause.HOLD_LOST, Cause.LIMB_FAILED)},
    # A plan that begins where another was broken off: limbs that are closed hold, those in the air are free
    (LimbState.UNLOADING, Cause.NEW_PLAN): LimbState.HELD,
    (LimbState.LATCHING, Cause.NEW_PLAN): LimbState.HELD,
    (LimbState.SWINGING, Cause.NEW_PLAN): LimbState.FREE,
    (LimbState.REACHING, Cause.NEW_PLAN): LimbState.FREE,
}


def after(state: LimbState, cause: Cause) -> LimbState:
    """The next state, as of ``TRANSITIONS``.

    Raises:
        RangeError: this cause leads nowhere from this state.
    """
    found = TRANSITIONS.get((state, cause))
    if found is None:
        causes = sorted({str(c) for s, c in TRANSITIONS if s is state})
        raise RangeError("cause", str(cause), f"a limb that is {state.name.lower()} changes by: {'; '.join(causes)}")
    return found
