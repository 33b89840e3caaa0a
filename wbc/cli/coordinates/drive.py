"""``wbc coordinates drive``: an arm by rates from a file or the keyboard."""

from __future__ import annotations

from dataclasses import dataclass

from wbc.cli.coordinates.asked import DriveAsked


@dataclass(frozen=True)
class DriveArm(DriveAsked):
    """Drive an arm by rates of a chosen pair, 50 times a second.

    At most six rates at a time. What of a command is lost is said, with the reason and the pair to use; the log has it
    tick by tick.
    """

    def run(self) -> int:
        from wbc.cli.coordinates.session import driven

        return driven(self)
