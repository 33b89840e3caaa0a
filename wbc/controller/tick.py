"""What a tick is to the controller: named buffers, and one call."""

from __future__ import annotations

from typing import Protocol

from wbc.qp.problem import QP
from wbc.validation import Array


class Tick(Protocol):
    """Buffers that the controller writes, a report that it reads, and ``step``."""

    q: Array
    v_last: Array
    v_in: Array
    use_v: Array
    p: Array
    dt: Array
    weight: Array
    enabled: Array
    bound_enabled: Array
    report: Array

    def check(self) -> int:
        """Take q and a measured velocity over, or put the last good q back; negative for refused inputs."""

    def step(self) -> int:
        """Run one cycle; the flag, negative for refused inputs."""

    def reset(self) -> None:
        """Forget the active set of the last cycle."""

    def qp(self) -> QP:
        """The QP of the last cycle, before any relaxation."""
