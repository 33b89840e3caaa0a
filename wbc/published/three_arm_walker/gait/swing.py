"""From handhold to handhold: off, across at 3 in above the cylinder, and down. Units: inch.

    P1 above the old hold, P2 above the new one, both at radius 103;    P3 on the new one, at radius 100

P1 only if the arm holds. Hands stand on the inward normal of their hold, with the same yaw on the structure whatever
the heading of the body. The line from P1 to P2 is straight, so it dips below the surface from 5.54 columns on.
Source: M. R. Patterson's thesis, Fig. 13 and the listing HHDPTH.
"""

from __future__ import annotations

from wbc.published.three_arm_walker.machine.grid import RADIUS, Place, frame
from wbc.validation import Array

#: Radius of the via points [in]
APPROACH = RADIUS + 3.0


def swing_poses(hand: Array, old: Place | None, new: Place) -> list[Array]:
    """The hand's pose, and those that it is to pass; ``old`` is None where it is in the air already."""
    lifted = [] if old is None else [frame(*old, APPROACH)]
    return [hand, *lifted, frame(*new, APPROACH), frame(*new)]
