"""What a worker asks of each package. A contender keeps its own state; the worker hands over targets and time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path

from bench.problems import Array, Case


class Contender(ABC):
    """One package on one problem, used as its documentation shows.

    All contenders get the same description, targets, weights, limits and tick. Errors are corrected within one
    tick (gain 1/dt), which is the default of pink and mink and the only choice of placo.
    """

    def __init__(self, case: Case) -> None:
        """Build the tasks and limits; the state is that of :meth:`reset`."""
        self.case = case
        self.problem = case.problem

    @abstractmethod
    def reset(self) -> None:
        """Back to the first configuration."""

    @abstractmethod
    def aim(self, tick: int) -> None:
        """Hand over the targets of a tick."""

    @abstractmethod
    def call(self) -> None:
        """The call that a user makes each tick; the state moves on by one tick."""

    @abstractmethod
    def state(self) -> Array:
        """The configuration: base position and quaternion (x, y, z, w) if floating, joints in the problem's order."""

    def native(self) -> int | None:
        """As :meth:`call`, through the native function alone; its duration [ns], None where there is no such thing."""
        return None

    def export(self, folder: Path) -> bool:
        """Write the tick as C and a path of states; whether the package can."""
        return False

    def settle(self) -> None:  # noqa: B027 (most packages move their own state)
        """What is left to do after the timed call, such as moving a state that the package does not keep."""

    def cycle(self, tick: int) -> None:
        """Targets in, command out, and the state moves on: in one call, where the package has one."""
        self.aim(tick)
        self.call()
        self.settle()
