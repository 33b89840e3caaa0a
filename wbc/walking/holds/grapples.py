"""Holds for the two-ended arm: a row of them on a plane."""

from __future__ import annotations

import pinocchio as pin

from wbc import validation
from wbc.errors import RangeError
from wbc.walking.holds.hold import FIXED, Hold, frame_of
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import PlaneSurface


def grapple_row(count: int = 6, pitch: float = 4.0) -> Structure:
    """Holds "1", "2", ... along x on the plane z = 0, ``pitch`` [m] apart, x of a hold along +x, fixed roll, no tilt.

    Raises:
        RangeError: fewer than two holds, or no pitch.
    """
    if isinstance(count, bool) or not isinstance(count, int) or count < 2:
        raise RangeError("count", count, "expected a whole number of at least 2")
    pitch = validation.scalar("pitch", pitch, low=0.0, open_low=True, unit="m")
    frames = [frame_of("hold", (k * pitch, 0.0, 0.0), (0, 0, -1), (1, 0, 0)) for k in range(count)]
    holds = tuple(Hold(str(k + 1), frame, FIXED) for k, frame in enumerate(frames))
    return Structure("grapples", holds, surface=PlaneSurface(pin.SE3.Identity()))
