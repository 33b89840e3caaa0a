"""What a step tells of its tick: how it ended, which rows push or gave way, errors of tasks, the certificate."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from wbc.controller.policy import CHAIN
from wbc.validation import Array


class Status(StrEnum):
    """How a tick ended."""

    #: Every constraint row holds, v is the optimum
    SOLVED = "solved"
    #: Rows could not all hold: some gave way in the declared order, see :attr:`Step.relaxed`
    RELAXED = "relaxed"
    #: No optimum was found: v brings every joint to rest as fast as its bounds allow
    BRAKED = "braked"
    #: :attr:`Controller.iteration_cap` ended the search: v is as near to what it had found as the rows allow, seen from
    #: braking
    CAPPED = "capped"
    #: The first answer had no certificate; another way led to one that has, see :attr:`Step.answered_by`. Rows may have
    #: given way, see :attr:`Step.relaxed`
    RECOVERED = "recovered"


#: By the tick's flag
STATUSES: tuple[Status, ...] = (Status.SOLVED, Status.RELAXED, Status.BRAKED, Status.CAPPED)
STATUSES += (*[Status.RECOVERED] * len(CHAIN), Status.BRAKED, Status.BRAKED)
#: What gave the command, by the tick's flag
ANSWERED = ("", "", "", "", *CHAIN, "braking", "policy")


@dataclass(frozen=True)
class Binding:
    """A row that pushes: ``item`` and ``row`` names, ``side`` (lower, upper, equal), its multiplier.

    ``level``: the first level whose optimum it pushes against, None for the least velocity after all levels.
    """

    item: str
    row: str
    side: str
    multiplier: float
    level: int | None = 0

    def __str__(self) -> str:
        return f"{self.item}/{self.row} {self.side}"


@dataclass(frozen=True)
class Slack:
    """A row that gave way: by how much, in its unit per second (rows) or 1/s times its unit (margins)."""

    item: str
    row: str
    amount: float
    unit: str

    def __str__(self) -> str:
        return f"{self.item}/{self.row} by {self.amount:.3g} {self.unit}"


@dataclass(frozen=True, eq=False)
class Residual:
    """Error of a task: ``values`` row by row, with ``units`` and ``labels``, and the task's ``level``."""

    values: Array
    units: tuple[str, ...]
    labels: tuple[str, ...]
    level: int = 0

    def norm(self, unit: str) -> float:
        """Euclidean norm of the rows in ``unit``."""
        return float(np.linalg.norm([v for v, u in zip(self.values, self.units, strict=True) if u == unit]))

    def __str__(self) -> str:
        return ", ".join(f"{self.norm(u):.3g} {u}".rstrip() for u in dict.fromkeys(self.units))


@dataclass(frozen=True)
class Certificate:
    """How good the answer is, computed within the tick; all inf for a braked or capped tick.

    Attributes:
        stationarity: largest entry of |H v + g + A' lambda| (cost per rad/s).
        violation: largest violation of a row that was not relaxed, in its unit per second.
        complementarity: largest |lambda (A v - b)|.
        error_bound: bound on the largest |v - v*| [rad/s, m/s].
    """

    stationarity: float
    violation: float
    complementarity: float
    error_bound: float
