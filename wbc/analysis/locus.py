"""What the locus algorithms give."""

from __future__ import annotations

from dataclasses import dataclass

from wbc.analysis.branches import Branch


@dataclass(frozen=True)
class Locus:
    """Where a Jacobian is short of full rank.

    Attributes:
        branches: their union is the locus; none lies within another one.
        open: branches that the budget left undecided; the locus may reach into them. Empty: the locus is complete.
    """

    branches: tuple[Branch, ...]
    open: tuple[Branch, ...] = ()
