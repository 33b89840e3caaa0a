"""What may go wrong with a plant of torques while it is climbed on: texts, and what they do at their time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from wbc import validation
from wbc.climb.climber import Climber
from wbc.climb.loop.stack import contact_frame
from wbc.errors import RangeError, ShapeError
from wbc.simulation.gripping import Gripping

#: Time in which a grip slips [s]
SLIPPING = 0.2
#: Forms of the texts, by kind
FORMS = {
    "slip": "slip LIMB METRES at SECONDS",
    "limp": "limp JOINT at SECONDS",
    "break": "break LIMB at SECONDS",
    "delay": "delay SECONDS",
}
#: What the number of a kind is that has one
SIZED = {"slip": "METRES", "delay": "SECONDS"}
#: "NAME at SECONDS"
_AT = re.compile(r"\s*(.+?)\s+at\s+(\S+)\s*")


def timed(field: str, text: str, form: str = "NAME at SECONDS") -> tuple[str, float]:
    """Name and time [s] of a text.

    Args:
        field, form: named where it is another one.

    Raises:
        ShapeError: another form. RangeError, NotFiniteError: a time below 0 s, or none.
    """
    parts = _AT.fullmatch(text)
    try:
        if parts is None:
            raise ValueError
        seconds = float(parts[2])
    except ValueError:
        raise ShapeError(field, text, f"expected {form!r}") from None
    return parts[1], validation.scalar(f"{field}, SECONDS", seconds, low=0.0, unit="s")


@dataclass(frozen=True)
class PlantFault:
    """One fault, of a text:

        slip arm2 0.005 at 4      what the closed limb arm2 holds moves by 5 mm, along the foothold's x axis
        limp arm3_joint2 at 4     the motor of the joint gives nothing any more
        break arm1 at 4           what arm1 holds breaks off
        delay 0.02                torques take hold 20 ms late, from the beginning

    Attributes:
        kind: of ``FORMS``. what: limb or joint. size: [m; s]. time: at which it comes [s].
    """

    kind: str
    what: str = ""
    size: float = 0.0
    time: float = 0.0

    @classmethod
    def read(cls, text: str) -> PlantFault:
        """The fault of a text.

        Raises:
            UnknownNameError: no such kind. ShapeError: another form. RangeError: a number below 0.
        """
        kind, _, rest = text.strip().partition(" ")
        form = FORMS[validation.one_of("fault", kind, FORMS)]
        words, time = (rest, 0.0) if kind == "delay" else timed("fault", rest, form)
        try:
            *names, number = [*words.split(), *([] if kind in SIZED else ["0"])]
            (what,) = ["", *names] if kind == "delay" else names
            size = float(number)
        except ValueError:
            raise ShapeError("fault", text, f"expected {form!r}") from None
        return cls(kind, what, validation.scalar(f"fault, {SIZED.get(kind, '')}", size, low=0.0), time)

    def check(self, climber: Climber) -> None:
        """Refuses a fault of what the climber does not have.

        Raises:
            UnknownNameError: no such limb or joint. RangeError: a joint without a motor, a limb that does not grip.
        """
        robot = climber.robot
        if self.kind == "limp":
            if not set(range(robot.nv)[robot.dofs(self.what)]) <= set(robot.motors):
                raise RangeError("fault", self.what, "no motor drives this joint")
        elif self.kind != "delay" and not climber.limbs[climber.row(self.what)].contact.pulls:
            raise RangeError("fault", self.what, f"it grips nothing, so that nothing can {self.kind}")


class FaultEvents:
    """Faults that come in time. A limb that is open cannot slip, and what it is to hold breaks when it has closed.

    Args:
        climber: whose limbs and joints they are. faults: in any order; delays are not among those that come.

    Raises:
        as :meth:`PlantFault.check`.
    """

    def __init__(self, climber: Climber, faults: Sequence[PlantFault]) -> None:
        for fault in faults:
            fault.check(climber)
        self._all = [fault for fault in faults if fault.kind != "delay"]
        self._frames = {limb.name: contact_frame(limb) for limb in climber.limbs}
        self.reset()

    def reset(self) -> None:
        """None has come yet."""
        self._coming = list(self._all)

    def happen(self, plant: Gripping, time: float) -> None:
        """Those whose time has come."""
        for fault in [fault for fault in self._coming if fault.time <= time]:
            if fault.kind == "limp":
                plant.limp(fault.what)
            else:
                frame = self._frames[fault.what]
                if frame not in plant.grips:
                    continue
                if fault.kind == "break":
                    plant.lose(frame)
                else:
                    plant.slip(frame, fault.size / SLIPPING * plant.grips[frame].pose.rotation[:, 0], SLIPPING)
            self._coming.remove(fault)


def delay_of(faults: Sequence[PlantFault]) -> float:
    """Delay of the torques [s]; 0 where none is among the faults.

    Raises:
        RangeError: two delays.
    """
    delays = [fault.size for fault in faults if fault.kind == "delay"]
    if len(delays) > 1:
        raise RangeError("fault", delays, "one delay at most")
    return delays[0] if delays else 0.0
