"""What the reference calls feasible."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from wbc import validation
from wbc.errors import RangeError
from wbc.walking.holds.built_in import INCH

#: What ``Rules.dilated`` may be
DILATIONS = (0.0, 0.5, 1.0)


@dataclass(frozen=True)
class Rules:
    """When an arm can hold, and when two arms can hold together.

    Attributes:
        limit_part: part of the range of joints 1 to 5 that may be used.
        angle_room: besides, what joints 1 to 5 keep of their limits [rad]; negative: by how much they may go beyond.
        reach_room: what the wrist keeps of its reach [m]; negative: likewise.
        collisions: keep the clearance between arms, body and surface.
        branches: a hand keeps its wrist branch for as long as it holds, and no joint goes further than
            ``largest_step`` from one pose of the lattice to the next.
        largest_step: [rad].
        dilated: half the side of the box of poses [cells] that stands for a pose of the lattice: feasible is what is so
            somewhere in it. 0: the pose alone; 0.5: boxes that fill the lattice, looked at in their middle, corners and
            middles of faces; 1: the box up to the neighbours, diagonal ones included, looked at in those.

    Raises:
        ShapeError, NotFiniteError, RangeError: a bad number.
    """

    limit_part: float = 1.0
    angle_room: float = 0.0
    reach_room: float = 0.0
    collisions: bool = True
    branches: bool = True
    largest_step: float = radians(60.0)
    dilated: float = 0.0

    def __post_init__(self) -> None:
        validation.scalar("Rules.limit_part", self.limit_part, low=0.0, high=1.0)
        validation.scalar("Rules.angle_room", self.angle_room, unit="rad")
        validation.scalar("Rules.reach_room", self.reach_room, unit="m")
        validation.scalar("Rules.largest_step", self.largest_step, low=0.0, open_low=True, unit="rad")
        if self.dilated not in DILATIONS:
            raise RangeError("Rules.dilated", self.dilated, f"expected one of {DILATIONS}")
        if self.dilated and (self.collisions or self.branches):
            raise RangeError("Rules.dilated", self.dilated, "collisions and branches need single poses")


#: What these allow can be done
STRICT = Rules(limit_part=0.95, reach_room=0.25 * INCH)
#: What these forbid cannot be done: besides all poses near a lattice's, limits and reach have some slack, which covers
#: the tilt that a compliant hold leaves to a hand
RELAXED = Rules(angle_room=-radians(3.0), reach_room=-0.3 * INCH, collisions=False, branches=False, dilated=0.5)
#: The wider relaxation, which covers tilts of the body too
WIDE = Rules(collisions=False, branches=False, dilated=1.0)
