"""Other ways along a body path: lower, or turned about the approach direction, where the direct way is not possible."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, radians

import numpy as np
import pinocchio as pin

from wbc.validation import Array
from wbc.walking.body_path import BodyPath

#: How much lower than the path [m], and turned by [rad], in the order of trying
LOWER = tuple(k * 2 * 0.0254 for k in range(5))
TURNED = tuple(radians(x) for x in (0.0, 30.0, -30.0, 60.0, 90.0, -15.0, 15.0, 45.0))
#: How fast the body goes down [m/s] and turns [rad/s] at the beginning and at the end
DOWN_SPEED, TURN_SPEED = 0.05, 0.1


@dataclass(frozen=True)
class Detour:
    """The body goes down and turns where the path begins, follows it so, and comes back where it ends.

    Attributes:
        lower: along the body's z axis, into the structure [m]. turned: about it [rad].
    """

    lower: float
    turned: float

    def offset(self, part: float) -> Array:
        """The change of the body's pose, in its own axes, 4 x 4; ``part`` from 0, none, to 1, all of it."""
        turn = pin.utils.rotate("z", part * self.turned)
        return np.array(pin.SE3(turn, np.array([0.0, 0.0, part * self.lower])).homogeneous)

    def along(self, path: BodyPath) -> BodyPath:
        """The path with the detour. Its middle is as long as the path; the spacing is the same."""
        seconds = max(self.lower / DOWN_SPEED, abs(self.turned) / TURN_SPEED)
        count = ceil(seconds / path.spacing - 1e-9)
        parts = [k / count for k in range(count)]
        into = [path.poses[0] @ self.offset(part) for part in parts]
        back = [path.poses[-1] @ self.offset(part) for part in reversed(parts)]
        return BodyPath(np.array([*into, *(path.poses @ self.offset(1.0)), *back]), path.spacing)

    def __str__(self) -> str:
        return f"{self.lower:.3f} m lower, turned by {np.degrees(self.turned):.0f} deg"


def detours() -> Iterator[Detour]:
    """All detours, those that change little first."""
    every = [Detour(lower, turned) for lower in LOWER for turned in TURNED if lower or turned]
    yield from sorted(every, key=lambda d: (d.lower / LOWER[-1] + abs(d.turned) / radians(90.0), d.lower, d.turned))
