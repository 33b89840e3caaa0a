"""What the locus algorithms give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from wbc.analysis.algebra.branches import LocusBranch
from wbc.analysis.algebra.deficiency import Exact


@dataclass(frozen=True)
class Locus:
    """Where a Jacobian is short of full rank.

    Attributes:
        branches: their union is the locus; none lies within another one.
        open: branches that the budget left undecided; the locus may reach into them. Empty: the locus is complete.
    """

    branches: tuple[LocusBranch, ...]
    open: tuple[LocusBranch, ...] = ()


class Located(Protocol):
    """What pictures need of an analysis: a locus, and the arithmetic that it is written in."""

    @property
    def exact(self) -> Exact:
        """Arithmetic of the robot."""

    @property
    def locus(self) -> Locus:
        """Where the rows lose rank."""
