"""A keyboard that drives a body: keys at a terminal become rates."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator

import numpy as np

from wbc.errors import WbcError
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
HALT, END = " ", "x\x1b\x04"
HELP = "w s: along, d a: round, e q: turn, blank: stop, x: end"


class NoTerminalError(WbcError):
    """There is no terminal to read keys from."""


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
        """As of :class:`wbc.walking.commands.Commands`."""
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


def terminal() -> int:
    """The descriptor of the standard input.

    Raises:
        NoTerminalError: it is no terminal.
    """
    if not sys.stdin.isatty():
        raise NoTerminalError("commands", "keyboard", "the standard input is no terminal; give a file of commands")
    return sys.stdin.fileno()


@contextlib.contextmanager
def terminal_keys(file: int | None = None) -> Iterator[Callable[[], str]]:
    """Keys of a terminal as they are pressed, without waiting; it is as before afterwards.

    Args:
        file: descriptor of the terminal; default: the standard input.

    Raises:
        NoTerminalError: the standard input is none.
    """
    number = terminal() if file is None else file
    before = termios.tcgetattr(number)

    def read() -> str:
        out = b""
        while select.select([number], [], [], 0.0)[0]:
            some = os.read(number, 64)
            if not some:
                return out.decode(errors="ignore") + END[-1]
            out += some
        return out.decode(errors="ignore")

    try:
        tty.setcbreak(number)
        yield read
    finally:
        termios.tcsetattr(number, termios.TCSADRAIN, before)
