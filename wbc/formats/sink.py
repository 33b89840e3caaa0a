"""Where a run goes to, whatever its format."""

from __future__ import annotations

import pathlib
from abc import ABC, abstractmethod
from typing import ClassVar

from wbc.formats.run import Run, SeenTick
from wbc.log import Log


class Sink(ABC):
    """A file, folder or connection into which a run is written.

    Attributes:
        needs: the extra that brings its packages, and what needs them in the words of an error; empty: none.
    """

    needs: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def __init__(self, path: pathlib.Path) -> None:
        """Make the file, or connect."""

    @abstractmethod
    def begin(self, run: Run) -> None:
        """Comes first."""

    @abstractmethod
    def write(self, log: Log, seen: list[SeenTick]) -> None:
        """The next ticks, and what is to be seen of some of them."""

    @abstractmethod
    def close(self) -> None:
        """Nothing more comes."""
