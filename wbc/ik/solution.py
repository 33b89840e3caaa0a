"""What inverse kinematics returns: a configuration, how the search ended, and everything a tick knows there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from wbc.controller.step import Step
from wbc.tick.outcome import Binding, Residual
from wbc.validation import Array


class Ending(StrEnum):
    """How a search ended."""

    #: Every goal is within its tolerance and every constraint holds
    SOLVED = "solved"
    #: No descent met the goals: q is the nearest configuration that was found
    UNREACHABLE = "unreachable"
    #: The time was over before one descent came to its end
    OUT_OF_TIME = "out of time"
    #: Every goal can be met alone but not all together, or no configuration was found that keeps the constraints
    CONTRADICTORY = "contradictory"


@dataclass(frozen=True, eq=False)
class Solution:
    """Answer of :meth:`wbc.InverseKinematics.solve`.

    Attributes:
        q: the configuration, within the position limits [nq].
        status: how the search ended.
        goals: names of the tasks that were to be met.
        ticks: iterations, each as costly as a tick.
        descents: configurations that a descent started from, the first one included.
        seconds: what the search took [s].
        step: the tick at q, whose units of time mean nothing.
    """

    q: Array
    status: Ending
    goals: tuple[str, ...]
    ticks: int
    descents: int
    seconds: float
    step: Step

    @property
    def solved(self) -> bool:
        """Whether the goals are met."""
        return self.status == Ending.SOLVED

    @property
    def residuals(self) -> Mapping[str, Residual]:
        """Error of every task at q, by name: ``residuals["hand"].norm("m")`` is its distance."""
        return self.step.residuals

    @property
    def error(self) -> float:
        """Largest error of a row of the goals, in its unit."""
        residuals = self.residuals
        return max(float(np.abs(residuals[name].values).max(initial=0.0)) for name in self.goals)

    @property
    def margins(self) -> Mapping[str, Array]:
        """Margins h of every margin constraint at q, by name."""
        return self.step.margins

    @property
    def binding(self) -> tuple[Binding, ...]:
        """Rows and bounds that keep the tasks from coming nearer."""
        return self.step.binding

    def explain(self) -> str:
        """One line: how it ended, how far the goals are, what cannot be kept and what binds."""
        residuals = self.residuals
        text = f"{self.status} after {self.descents} descents, {self.ticks} ticks, {1e3 * self.seconds:.3g} ms"
        text += "".join(f"; {name} off by {residuals[name]}" for name in self.goals)
        if not self.solved and self.step.relaxed:
            text += "; cannot be kept: " + ", ".join(str(slack) for slack in self.step.relaxed)
        if not self.solved and self.binding:
            text += "; binding: " + ", ".join(str(b) for b in self.binding)
        return text

    def __repr__(self) -> str:
        return f"Solution({self.explain()})"


@dataclass(frozen=True, eq=False)
class BatchSolution:
    """Answers of :meth:`wbc.InverseKinematics.solve_batch`, one for each target.

    Attributes:
        q: configurations [count, nq].
        statuses: how each search ended; ``contradictory`` only where no configuration kept the constraints.
        descents: configurations that each search started from [count].
        seconds: what each search took [s], [count].
    """

    q: Array
    statuses: tuple[Ending, ...]
    descents: Array
    seconds: Array

    @property
    def solved(self) -> Array:
        """1 where the goals are met, else 0 [count]."""
        return np.array([float(status == Ending.SOLVED) for status in self.statuses])
