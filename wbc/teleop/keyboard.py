"""Orders from a keyboard: keys that are held down, in a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from wbc import validation
from wbc.teleop.order import AT_ONCE, Order
from wbc.terminal import END_OF_INPUT, terminal_keys

#: Key -> (row of the task, direction)
AXES = {
    "w": (0, 1.0),
    "s": (0, -1.0),
    "a": (1, 1.0),
    "d": (1, -1.0),
    "r": (2, 1.0),
    "f": (2, -1.0),
    "u": (3, 1.0),
    "o": (3, -1.0),
    "i": (4, 1.0),
    "k": (4, -1.0),
    "j": (5, 1.0),
    "l": (5, -1.0),
}
NEXT = "n"
BEFORE = "p"
STOP = " "
FASTER = "+"
SLOWER = "-"
QUIT = "q"
HELP = "w/s a/d r/f: rows 1 to 3, u/o i/k j/l: rows 4 to 6; n, p: next pair, the one before; space: stop; +, -; q: quit"
#: A key counts as held for this long after it was seen: terminals repeat keys after up to half a second [s]
HELD = 0.6
#: Least and greatest factor of the rates
FACTORS = (0.1, 4.0)


class Keyboard:
    """Keys as orders. ``feed`` takes what was typed; :meth:`terminal` reads it from this process's terminal.

    Args:
        linear, angular: rates of rows in metres and in radians [m/s, rad/s]. Keys of rows that a task has not do
            nothing.
    """

    def __init__(self, linear: float = 0.02, angular: float = 0.01) -> None:
        self._speeds = {
            "m": validation.scalar("linear", linear, low=0.0, open_low=True, unit="m/s"),
            "rad": validation.scalar("angular", angular, low=0.0, open_low=True, unit="rad/s"),
        }
        self.factor, self._typed = 1.0, ""
        self._until = [-1.0] * AT_ONCE
        self._sign = [0.0] * AT_ONCE
        self._read: Callable[[], str] | None = None

    def feed(self, text: str) -> None:
        """Keys that were typed since the last order."""
        self._typed += validation.instance("text", text, str, "text")

    def order(self, time: float, names: Sequence[str], active: str, units: Sequence[str]) -> Order:
        """What the keys say: axes that are held, another pair, or stop.

        Raises:
            StopIteration: quit was typed, or the input ended.
        """
        if self._read is not None:
            self.feed(self._read())
        typed, self._typed = self._typed, ""
        pair, stop = None, False
        for key in typed:
            if key in (QUIT, END_OF_INPUT):
                raise StopIteration
            if key in AXES:
                row, sign = AXES[key]
                self._until[row], self._sign[row] = time + HELD, sign
            elif key in (NEXT, BEFORE):
                step = 1 if key == NEXT else -1
                pair = names[(list(names).index(pair or active) + step) % len(names)]
                self._until = [-1.0] * AT_ONCE
            elif key in (FASTER, SLOWER):
                self.factor = min(FACTORS[1], max(FACTORS[0], self.factor * (1.25 if key == FASTER else 0.8)))
            elif key == STOP:
                stop, self._until = True, [-1.0] * AT_ONCE
        rates = [
            self.factor * sign * self._speeds[unit] if time < until else 0.0
            for sign, unit, until in zip(self._sign, units, self._until, strict=False)
        ]
        return Order(tuple(rates), pair=pair, stop=stop)

    @contextmanager
    def terminal(self) -> Iterator[Keyboard]:
        """Read keys as they are typed, without echo, until the end of the block.

        Raises:
            NoTerminalError: standard input is no terminal.
        """
        with terminal_keys() as self._read:
            try:
                yield self
            finally:
                self._read = None
