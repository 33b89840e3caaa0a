"""What the reference answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bench.walk.reference.lattice import GridPose

Kind = Literal["possible", "impossible", "undecided"]


@dataclass(frozen=True)
class Step:
    """A stance of a way, and how the body goes on from it.

    Attributes:
        pose: of the body. holds: id of each arm's hold. branches: of each arm's wrist, 0: theta5 >= 0, 1: theta5 < 0.
        moves: row of the arm that lifts here and holds again at the next step, -1 at the last, which has none; the arm
            may come back to its own hold.
        route: poses from this one to that of the next step, both included, each a neighbour of the one before; the
            hands that do not move hold at all of them.
    """

    pose: GridPose
    holds: tuple[str, str, str]
    branches: tuple[int, int, int]
    moves: int
    route: tuple[GridPose, ...]


@dataclass(frozen=True)
class Verdict:
    """Whether a walker can get from a start to a goal.

    Attributes:
        kind: possible, impossible or undecided.
        path: for possible, the stances from start to goal.
        separating: for impossible, ids of the holds at which the way ends.
        reason: one sentence.
        time: that it took [s]. expanded: nodes that the strict search looked at.
    """

    kind: Kind
    path: tuple[Step, ...]
    separating: tuple[str, ...]
    reason: str
    time: float
    expanded: int

    @property
    def regrasps(self) -> int:
        """Re-grasps of the path; it need not be the fewest."""
        return sum(step.moves >= 0 for step in self.path)
