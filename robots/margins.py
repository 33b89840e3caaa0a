"""What plans leave of a walker's limits to feedback, and how long they wait: one place for all of it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import radians

from wbc import validation

#: Reach of the arm that the lengths below were chosen for, upper arm and forearm of a PUMA 600 [m]
REACH = 0.8636
#: Fields that grow with the reach
_LENGTHS = (
    "held_reach",
    "held_clearance",
    "swing_reach",
    "swing_axis",
    "swing_clearance",
    "surface_clearance",
    "crossing",
    "across",
    "higher",
    "cell_reach",
)


@dataclass(frozen=True)
class Margins:
    """Margins of plans beyond the limits and clearances of a walker, and their patience.

    All of them were chosen here, on the published courses: as small as walks under feedback allow without a violation
    in ``python -m bench.walk``. Lengths are those of an arm with a reach of 0.8636 m; :meth:`of_reach` scales them.

    Attributes:
        held_rate: part of the joints' rates that holding arms use. held_angle: to joint limits [rad].
        held_reach: to the end of the reach [m]. held_clearance: of arms that hold, beyond the clearance [m].
        lean_from: a hand leans on a compliant hold where its reach is less than this times ``held_reach``.
        facing: least cosine between a hand's approach and the body's z axis: arms do not reach round the body.
        swing_rate, swing_acceleration: parts of the joints' limits that swings use. hand_speed: of a swing [m/s].
        swing_angle, swing_elbow: to joint limits, and of the elbow to a straight arm, which cannot follow what its body
            does [rad]. swing_reach, swing_axis: of the wrist to the end of its reach and from joint 1's axis [m].
        swing_clearance, surface_clearance: of a swing from other arms and from the structure, beyond the clearance [m].
        crossing: of a hand above the structure, beyond the height at which it crosses [m].
        across: how far it may be off its hold where it is that high [m]. higher: what alternative curves rise by [m].
        landing_wrist: least \\|sin theta5\\| of a hand that lands: joint 4 turns its axis only then.
        landing_elbow: least angle of its elbow: nearly straight arms correct slowly [rad].
        cell_angle, cell_reach: to the limits at cells of a detour, as there is less between them [rad, m].
        hover: how long a hand may be in the air for a hold that is not in reach yet [s]. long_wait: if it is longer, it
            may wait where it goes with the body instead [s]. slower: a swing may last so much longer than the search
            thought [s]. spare: of the time until the next lift that a slow, jerk-limited swing leaves [s].
        head, onward: path time that a body goes before the plan of its hands is made, from rest and under way [s].

    Raises:
        ShapeError, NotFiniteError, RangeError: a field that is no number, or negative.
    """

    held_rate: float = 0.85
    held_angle: float = radians(2.0)
    held_reach: float = 0.00762
    held_clearance: float = 0.01
    lean_from: float = 1.25
    facing: float = 0.5
    swing_rate: float = 0.96
    swing_acceleration: float = 0.9
    hand_speed: float = 2.0
    swing_angle: float = 0.02
    swing_elbow: float = 0.2
    swing_reach: float = 0.00762
    swing_axis: float = 0.08
    swing_clearance: float = 0.006
    surface_clearance: float = 0.0005
    crossing: float = 0.003
    across: float = 0.0015
    higher: float = 0.1
    landing_wrist: float = 0.08
    landing_elbow: float = 0.5
    cell_angle: float = radians(4.0)
    cell_reach: float = 0.01016
    hover: float = 0.75
    long_wait: float = 3.0
    slower: float = 0.08
    spare: float = 0.25
    head: float = 0.55
    onward: float = 1.0

    def __post_init__(self) -> None:
        for f in fields(self):
            value = validation.scalar(f"Margins.{f.name}", getattr(self, f.name), low=0.0)
            object.__setattr__(self, f.name, value)

    @classmethod
    def of_reach(cls, reach: float) -> Margins:
        """Those of an arm of another reach, upper arm and forearm [m]: lengths grow with it.

        Raises:
            RangeError: not positive.
        """
        scale = validation.scalar("reach", reach, low=0.0, open_low=True, unit="m") / REACH
        usual = cls()
        return replace(usual, **{name: scale * getattr(usual, name) for name in _LENGTHS})
