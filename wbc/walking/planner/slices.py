"""Work that is done in slices: a generator that yields after bounded work and returns the result."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import TypeVar

T = TypeVar("T")

Slices = Generator[None, None, T]


@dataclass
class Allowance:
    """Work that several searches share; what ends when it is spent is the same every time, as no clock is asked.

    Attributes:
        left: slices, of some milliseconds each; below 0 where the last piece of work was larger than what was left.
    """

    left: float

    @property
    def spent(self) -> bool:
        """Whether nothing is left."""
        return self.left <= 0.0


def counted(work: Slices[T], allowance: Allowance | None) -> Slices[T]:
    """The same work, each slice of it taken from an allowance."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: T = end.value
            return result
        if allowance is not None:
            allowance.left -= 1.0
        yield None


def drained(work: Generator[object, None, T]) -> T:
    """All of it at once."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: T = end.value
            return result
