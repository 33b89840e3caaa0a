"""How fast the body goes on along its path."""

from __future__ import annotations

from math import sqrt

from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.loop.body_command import BodyCommand
from wbc.walking.loop.stopping import Stops

#: From rest to the commanded speed [s]; back, where hands would lose their holds, as of :class:`Stops`
RAMP = 0.5
#: Part of the pace from which a body that brakes steadily comes to rest in time
PART = 0.9


class BodyMotion:
    """The pace of the body, 1 the path's own, and its command.

    Attributes:
        pace: now. wanted: that it should have. pose: where the body is to be as the tick ends: position [m] and
            quaternion x, y, z, w.
    """

    def __init__(self, dt: float, stops: Stops) -> None:
        self._dt, self._stops, self._command = dt, stops, BodyCommand(dt)
        self.pace, self.wanted = 0.0, 1.0

    @property
    def pose(self) -> Array:
        return self._command.pose

    def choose(self, margin: float, left: float, landing: tuple[float, float] | None, stands: bool) -> None:
        """The pace of this tick: as fast as asked, as slow as the hands need. Braking from p in a time T takes
        p^2 T / 2 of path time.

        Args:
            margin: path time until a holding hand reaches the end of its grip [s]. left: until the end of the path or
                of what is planned [s]. landing: path time that is left until the swinging hand has to hold, and the
                time that it needs until then [s]; None: no hand is swinging. stands: the body is to come to rest.
        """
        brake = self._stops.brake
        wanted = min(1.0, sqrt(2.0 * margin / brake * PART), sqrt(2.0 * left / RAMP * PART))
        if landing is not None and landing[0] < landing[1]:
            wanted = min(wanted, landing[0] / landing[1])
        self.wanted = 0.0 if stands else wanted
        self.pace = max(self.pace + min(max(self.wanted - self.pace, -self._dt / brake), self._dt / RAMP), 0.0)

    def go(self, path: BodyPath, begin: float) -> tuple[Array, float]:
        """A tick along a path from a path time on [s]: what the stack follows, as of :meth:`BodyCommand.go`, and the
        path time as it ends.
        """
        end = min(begin + self.pace * self._dt, path.duration)
        return self._command.go(path, begin, end), end
