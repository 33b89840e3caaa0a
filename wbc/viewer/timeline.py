"""What can be looked at again: the states of a recording, or the last minutes of a loop."""

from __future__ import annotations

import bisect
import zlib
from collections.abc import Sequence

from wbc.viewer.link import SharedTick

#: Memory for the past of a live loop [bytes]
MEMORY = 24 << 20
#: Time between states that are kept [s]
BETWEEN = 1 / 30


class Timeline:
    """States by time, and where in them a page is.

    Args:
        states: of a recording; none: of a loop, whose states come with :meth:`add`.

    Attributes:
        live: the newest state is shown, and comes from a loop. at: the time that is shown [s].
        speed: of playing, 0 where it pauses.
    """

    def __init__(self, states: Sequence[SharedTick] = ()) -> None:
        self._states: list[SharedTick] = list(states)
        self._times = [state.time for state in self._states]
        #: bytes of a loop's states, which are compressed
        self._held = 0
        self.recorded = bool(states)
        self.live = not self.recorded
        self.at = self._times[0] if states else 0.0
        self.speed = 1.0

    def add(self, state: SharedTick) -> None:
        """The newest state of a loop; what is oldest goes where memory is full."""
        if self._times and state.time < self._times[-1]:
            # The loop began anew
            self._states.clear()
            self._times.clear()
            self._held = 0
        if self._times and state.time - self._times[-1] < BETWEEN:
            return
        self._states.append(state._replace(data=zlib.compress(state.data, 1)))
        self._times.append(state.time)
        self._held += len(self._states[-1].data)
        if self._held > MEMORY:
            # A tenth at a time: to cut the front off a list costs all of it
            gone = len(self._states) // 10
            del self._states[:gone], self._times[:gone]
            self._held = sum(len(kept.data) for kept in self._states)

    def seek(self, time: float) -> None:
        """Show the state of a time, and stay there."""
        self.live = False
        self.speed = 0.0
        self.at = min(max(time, self.begin), self.end)

    def play(self, speed: float) -> None:
        """Go on from there at so many times the speed; from the end anew; 0 pauses."""
        if self.live:
            self.at, self.live = self.end, False
        elif speed and self.at >= self.end:
            self.at = self.begin
        self.speed = speed

    def back(self) -> None:
        """Show what happens now; a recording has no now."""
        self.live = not self.recorded
        self.speed = 1.0

    def advance(self, seconds: float) -> None:
        """Let time go by."""
        if not self.live and self.speed:
            self.at = min(self.at + self.speed * seconds, self.end)
            if self.at >= self.end and self.recorded:
                self.speed = 0.0

    def state(self) -> SharedTick | None:
        """The state that is shown, None before there is any."""
        if not self._states:
            return None
        place = -1 if self.live else max(bisect.bisect_right(self._times, self.at + 1e-9) - 1, 0)
        found = self._states[place]
        return found if self.recorded else found._replace(data=zlib.decompress(found.data))

    @property
    def begin(self) -> float:
        """First time [s]."""
        return self._times[0] if self._times else 0.0

    @property
    def end(self) -> float:
        """Last time [s]."""
        return self._times[-1] if self._times else 0.0

    def told(self) -> dict[str, float | bool]:
        """For the page's slider."""
        at = self.end if self.live else self.at
        playing = bool(self.live or (self.speed and (self.at < self.end or not self.recorded)))
        return {"begin": self.begin, "end": self.end, "at": at, "live": self.live, "playing": playing}
