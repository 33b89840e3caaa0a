"""What may go wrong on a walk under torques: a grip slips, a motor dies, a hold breaks off, commands come late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError

if TYPE_CHECKING:
    from wbc.walking.torque.tested import Tested

#: Time in which a grip slips [s]
SLIPPING = 0.2
KINDS = ("slip", "limp", "break", "delay")


@dataclass(frozen=True)
class Fault:
    """One fault, of a text:

        slip arm2 0.005 at 4      the closed hand of arm2 is moved 5 mm by its hold, along the hold's x axis
        limp arm3_joint2 at 4     the motor of the joint gives nothing any more
        break arm1 at 4           the hold of arm1 breaks off
        delay 0.02                torques take hold 20 ms late, from the beginning

    Attributes:
        kind: of :data:`KINDS`. what: arm or joint. size: [m; s]. time: at which it comes [s].
    """

    kind: str
    what: str = ""
    size: float = 0.0
    time: float = 0.0

    @classmethod
    def read(cls, text: str) -> Fault:
        """Of a text.

        Raises:
            UnknownNameError: no such kind. ShapeError: another form. RangeError: a number below 0.
        """
        kind, *words = text.split() or [""]
        validation.one_of("fault", kind, KINDS)
        form = {"slip": "slip ARM METRES at SECONDS", "limp": "limp JOINT at SECONDS", "break": "break ARM at SECONDS",
                "delay": "delay SECONDS"}[kind]  # fmt: skip
        try:
            if kind == "delay":
                (size,) = words
                return cls(kind, size=validation.scalar("fault", float(size), low=0.0, unit="s"))
            what, *numbers, at, when = words
            (size,) = numbers if kind == "slip" else ("0",)
            if at != "at" or (kind != "slip" and numbers):
                raise ValueError
            length = validation.scalar("fault", float(size), low=0.0, unit="m")
            return cls(kind, what, length, validation.scalar("fault", float(when), low=0.0, unit="s"))
        except ValueError as error:
            raise ShapeError("fault", text, f"expected {form!r}") from error

    def begin(self, plant: Tested) -> bool:
        """Let it happen; whether it has. A hand that is open cannot slip, and its hold breaks when it has closed."""
        if self.kind == "limp":
            plant.limp(self.what)
            return True
        hand = f"{self.what}_hand"
        if hand not in plant.grips:
            return False
        if self.kind == "break":
            plant.lose(hand)
        else:
            plant.slip(hand, self.size / SLIPPING * np.array(plant.grips[hand].pose.rotation[:, 0]), SLIPPING)
        return True


def delay_of(faults: tuple[Fault, ...]) -> float:
    """Of the torques [s].

    Raises:
        RangeError: two delays.
    """
    delays = [fault.size for fault in faults if fault.kind == "delay"]
    if len(delays) > 1:
        raise RangeError("fault", delays, "one delay at most")
    return delays[0] if delays else 0.0
