"""The search over stances of a body with arms: what their conflicts and swings are."""

from __future__ import annotations

from typing import Any

from wbc.robots import Walker
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.conflicts import ArmClearance
from wbc.walking.planner.grips.table import Grips
from wbc.walking.planner.stances.search import StanceSearch
from wbc.walking.planner.swings.move import Move
from wbc.walking.planner.swings.swings import Swings


class BodySearch(StanceSearch[Swings]):
    """A search over the grips of a body's arms along one path.

    Args:
        known: a search over the same grips, whose swings and distances need not be computed again.
        more: of :class:`StanceSearch`.
    """

    def __init__(
        self,
        walker: Walker,
        structure: Structure,
        path: BodyPath,
        grips: Grips,
        *,
        known: BodySearch | None = None,
        **more: Any,
    ) -> None:
        self.walker, self.structure = walker, structure
        swings = Swings(walker, structure, path, grips, ArmClearance(walker, grips)) if known is None else known.swings
        super().__init__(path, grips, swings.arms, swings, hover=walker.margins.hover, **more)

    def exclude(self, move: Move) -> None:
        """A move is not possible, along whichever curve."""
        for curve in range(self.swings.curves):
            self.correct(move._replace(curve=curve), move.duration, False)
