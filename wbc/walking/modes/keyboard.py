"""A keyboard that drives a body: keys at a terminal become rates."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from wbc.terminal import END_OF_INPUT
from wbc.validation import Array

#: Rates that a key adds: speeds [m/s] and spin [rad/s]
SPEED, SPIN = 0.0254, 0.02
#: Key -> what it adds to the rates round, along and of turning
KEYS = {
    "w": (0.0, SPEED, 0.0),
    "s": (0.0, -SPEED, 0.0),
    "d": (SPEED, 0.0, 0.0),
    "a": (-SPEED, 0.0, 0.0),
    "e": (0.0, 0.0, SPIN),
    "q": (0.0, 0.0, -SPIN),
}
#: Keys that stop the body, and that end the drive: x, Escape and the end of the input
HALT, END = " ", "x\x1b" + END_OF_INPUT
HELP = "w s: along, d a: round, e q: turn, blank: stop, x: end"


class KeyCommands:
    """Rates from keys; each adds its share, a blank takes all away.

    Args:
        read: keys that were pressed since the last call, "" for none.
        real_time: wait where the walk is ahead of the clock.
    """

    def __init__(self, read: Callable[[], str], real_time: bool = True) -> None:
        self._read, self._real_time = read, real_time
        self._rates, self._over = np.zeros(3), False
        self._begin: float | None = None

    def rates(self, now: float) -> Array | None:
        """As of :class:`wbc.walking.modes.commands.Commands`."""
        if self._real_time:
            self._begin = time.monotonic() - now if self._begin is None else self._begin
            time.sleep(max(self._begin + now - time.monotonic(), 0.0))
        for key in self._read():
            if key in END:
                self._over = True
            elif key == HALT:
                self._rates = np.zeros(3)
            elif key in KEYS:
                self._rates = np.round(self._rates + KEYS[key], 9)
        return None if self._over else self._rates.copy()
