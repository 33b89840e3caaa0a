"""From where a robot stands to where it is to go: stances, then the motion through them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from wbc import validation
from wbc.climb.balance import Equilibrium
from wbc.climb.climber import Climber
from wbc.climb.goal import Goal
from wbc.climb.let_go import joined, let_go
from wbc.climb.motion import MotionOptions, MoveError, Mover, carry_out
from wbc.climb.plan import ContactPlan
from wbc.climb.scene import ClimbScene
from wbc.climb.search import LateMove, NoStancesError, StanceOptions, StanceWay, no_stances
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.climb.time_law import MotionSpeeds
from wbc.climb.watch import PlanWatch
from wbc.errors import RangeError

#: How often links of a limb at a foothold are in the way, or it cannot leave a stance, before such moves are dear
BLAMED = 2


@dataclass(frozen=True)
class ClimbOptions:
    """How a plan is made.

    Attributes:
        stances, motion: of the search and of the motion; stances keep clearances, margin and friction of both.
        again: how often stances are sought again without a move that has no motion, at most.
        seconds: time of all of it at most [s]; a plan that it ends is refused as of a limit.
        told: is called with what was done so far, some times a second; what it raises ends planning.

    Raises:
        RangeError: a time that is not above 0 s.
    """

    stances: StanceOptions = field(default_factory=StanceOptions)
    motion: MotionOptions = field(default_factory=MotionOptions)
    again: int = 80
    seconds: float = np.inf
    told: Callable[[str], None] | None = None

    def __post_init__(self) -> None:
        if not self.seconds > 0.0:
            raise RangeError("ClimbOptions.seconds", self.seconds, "expected a time above 0 s")

    @classmethod
    def by_torques(cls) -> ClimbOptions:
        """For a loop of torques: with three quarters of friction a slack of 0.05 weights on the way, 0.06 where limbs
        lift and land, three quarters of the joints' efforts and three tenths of their accelerations, as limbs of other
        masses than thought stray in proportion to these.
        """
        return cls(
            StanceOptions(margin=0.06, effort=0.75, friction=0.75),
            MotionOptions(margin=0.05, effort=0.75, friction=0.75, speeds=MotionSpeeds(acceleration_share=0.3)),
        )


def plan_climb(
    climber: Climber, scene: ClimbScene, start: Stance, goal: Goal, options: ClimbOptions | None = None
) -> ContactPlan:
    """The motion of a climber to a goal. A move for which no motion is found is left out, and stances are sought again.
    Limbs in the air that touch a body leave it first, as of :func:`let_go`.

    Args:
        start: where it stands.

    Raises:
        NoStancesError: no stances lead there. MoveError: motions were found for none of so many ways. ShapeError,
            RangeError: start, goal or options that do not fit.
    """
    given = ClimbOptions() if options is None else validation.instance("options", options, ClimbOptions, "ClimbOptions")
    validation.instance("start", start, Stance, "a Stance, as of first_stance")
    lifting, first = let_go(climber, scene, start, given.motion)
    equilibrium = Equilibrium(climber, scene, given.motion.friction)
    watch = PlanWatch(given.seconds, given.told)
    mover = Mover(climber, scene, given.motion, equilibrium, watch)
    sought = replace(
        given.stances,
        clearance=max(given.stances.clearance, given.motion.clearance),
        apart=max(given.stances.apart, given.motion.apart),
        margin=max(given.stances.margin, given.motion.margin),
        friction=min(given.stances.friction, given.motion.friction),
    )
    blamed = Counter[LateMove]()
    way = StanceWay(climber, scene, first, goal, sought, watch)
    last: MoveError | None = None
    for tries in range(given.again + 1):
        try:
            stances = way.found()
        except NoStancesError as error:
            if last is None:
                raise
            told = f"{last.field}: {last.reason}"
            before = f"{tries} ways over stances have a move without a motion, the last one {told}; no other was found"
            raise error.about(before) from last
        try:
            plan = carry_out(climber, scene, stances, mover=mover)
            return plan if lifting is None else joined(lifting, plan)
        except MoveError as error:
            last = error
            if watch.passed:
                told = f"{error.field}: {error.reason}"
                seen = f"{tries + 1} ways over stances were found, and none could be moved along; the last: {told}"
                reason = f"the limit of {given.seconds:g} s ended planning, which proves nothing: {seen}"
                raise no_stances("seconds", given.seconds, reason, "limit") from error
            contacts = [tuple(stance.contacts) for stance in stances.stances]
            moves = [row for row in range(len(contacts) - 1) if contacts[row] != contacts[row + 1]]
            # A body that cannot shift is kept from the move that it shifts for, or at last from the one before
            ahead = next((row for row in moves if row >= error.move), moves[-1] if moves else None)
            if ahead is None or tries == given.again:
                raise
            at, after = contacts[error.move], contacts[ahead + 1]
            blamed.update(((), limb, at[limb]) for limb in error.limbs if at[limb] != FREE_LIMB)
            blamed.update((at, limb, FREE_LIMB) for limb in range(len(at)) if at[limb] != after[limb])
            way.forbid(ahead, [late for late, times in blamed.items() if times >= BLAMED])
    raise AssertionError
