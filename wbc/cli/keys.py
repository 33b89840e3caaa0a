"""A keyboard that drives a body: keys at a terminal become twists."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from wbc.terminal import END_OF_INPUT
from wbc.validation import Array

#: Speed that a key adds [m/s]
KEY_SPEED = 0.0254
#: Turn rate that a key adds [rad/s]
KEY_TURN = 0.02
#: Key -> what it adds to the body's twist, and how often
KEYS = {"w": (0, 1), "s": (0, -1), "a": (1, 1), "d": (1, -1), "q": (5, 1), "e": (5, -1)}
#: Key that stops the body
HALT = " "
#: Keys that end the drive: x, Escape and the end of the input
END = "x\x1b" + END_OF_INPUT
HELP = "w s: ahead and back, a d: left and right, q e: turn, blank: stop, x: end"


class KeyTwists:
    """Twists from keys; each adds its share, a blank takes all away.

    Args:
        read: keys that were pressed since the last call, "" for none.
        real_time: wait where the climb is ahead of the clock.
    """

    def __init__(self, read: Callable[[], str], real_time: bool = True) -> None:
        self._read, self._real_time = read, real_time
        self._twist, self._over = np.zeros(6), False
        self._begin: float | None = None

    def at(self, now: float) -> Array | None:
        """As of :class:`wbc.climb.rates.TwistSource`."""
        if self._real_time:
            self._begin = time.monotonic() - now if self._begin is None else self._begin
            time.sleep(max(self._begin + now - time.monotonic(), 0.0))
        for key in self._read():
            if key in END:
                self._over = True
            elif key == HALT:
                self._twist = np.zeros(6)
            elif key in KEYS:
                row, sign = KEYS[key]
                self._twist[row] = round(self._twist[row] + sign * (KEY_SPEED if row < 3 else KEY_TURN), 9)
        return None if self._over else self._twist.copy()
