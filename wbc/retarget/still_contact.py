"""A contact that stands still in a motion of a clip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from wbc import tasks


@dataclass(frozen=True)
class StillContact(tasks.Hold):
    """A contact at rest; where its target is after a tick is met to rounding, second-order motion included."""

    abstract: ClassVar[bool] = True
    exact: ClassVar[bool] = True
