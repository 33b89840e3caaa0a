"""The operator's say: every re-grasp is proposed, and waits for a yes, or for another hold."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from wbc.errors import WbcError
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.plan import NoPlanError, Regrasp
from wbc.walking.planner.planner import plan_slices
from wbc.walking.planner.slices import drained

#: Delays [s] and widths of the searches: somebody waits for the answer
TRIES = ((0.0, 16), (inf, 16))


class HoldRefusedError(WbcError):
    """A hold that the operator asked for and that the hand cannot take now, with the reason; nothing has changed."""


class Veto:
    """Proposals of a walk. A body that waits for an answer stops where the hand is to be lifted.

    Args:
        walk: whose lifts wait from now on, until :meth:`end`.
    """

    def __init__(self, walk: Walk) -> None:
        self.walk = walk
        self._accepted = -1
        walk.approve = lambda step: self._accepted == len(walk.progress.steps)

    @property
    def proposal(self) -> Regrasp | None:
        """The next re-grasp, if it waits for an answer."""
        walk = self.walk
        if walk.swinging is not None or walk.busy or walk.progress.next >= len(walk.plan.regrasps):
            return None
        return None if self._accepted == len(walk.progress.steps) else walk.plan.regrasps[walk.progress.next]

    def accept(self) -> None:
        """Yes to the proposal, if there is one."""
        if self.proposal is not None:
            self._accepted = len(self.walk.progress.steps)

    def choose(self, hold: str) -> Regrasp:
        """Another hold for the arm of the proposal; the rest of the path is planned anew behind it.

        Returns:
            The re-grasp that is made instead.

        Raises:
            UnknownNameError: no such hold. HoldRefusedError: there is no proposal, or no plan goes on with it.
        """
        walk, step = self.walk, self.proposal
        row = walk.structure.index(hold)
        if step is None:
            raise HoldRefusedError("hold", hold, "no re-grasp is proposed now")
        if row in walk.held.values():
            raise HoldRefusedError("hold", hold, "a hand holds it")
        names = [arm.name for arm in walk.walker.arms]
        arm, plan, grips = names.index(step.arm), walk.plan, walk.progress.grips
        if not len(np.nonzero((grips.arm == arm) & (grips.hold == row))[0]):
            raise HoldRefusedError("hold", hold, f"{step.arm} cannot hold it anywhere on the path")
        sample = int(np.ceil(walk.path_time / plan.path.spacing - 1e-9))
        begun = plan.cut(names, walk.progress.next, sample * plan.path.spacing)
        stance = tuple(chain[-1] for chain in begun.chain)
        onward: dict[str, Any] = {"grips": grips, "stance": stance, "sample": sample, "tries": TRIES}
        asked = plan_slices(walk.walker, walk.structure, plan.path, first=(arm, row), **onward)
        try:
            rest = drained(asked)
        except NoPlanError as error:
            raise HoldRefusedError("hold", hold, str(error)) from error
        if not rest.regrasps or rest.regrasps[0].target != hold:
            raise HoldRefusedError("hold", hold, f"{step.arm} cannot be moved there from {step.source}")
        if not rest.complete:
            raise HoldRefusedError("hold", hold, f"no plan goes on with it: {rest.reason}")
        walk.take(begun.then(rest))
        self._accepted = len(walk.progress.steps)
        return walk.plan.regrasps[walk.progress.next]

    def end(self) -> None:
        """Nobody is asked any more."""
        self.walk.approve = None
