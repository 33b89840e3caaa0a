"""Keys of a terminal as they are pressed, and lines of the standard input that may be waited for in vain."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from collections.abc import Callable, Iterator

from wbc.errors import WbcError

#: What stands for the end of the input
END_OF_INPUT = "\x04"
#: Time between two looks at whether to stop while a line is waited for [s]
WAIT = 0.1


class NoTerminalError(WbcError):
    """There is no terminal to read keys from."""


def terminal(field: str = "keyboard") -> int:
    """The descriptor of the standard input.

    Args:
        field: what wants it, for the error.

    Raises:
        NoTerminalError: it is no terminal.
    """
    if not sys.stdin.isatty():
        raise NoTerminalError(field, "keyboard", "the standard input is no terminal; give a file of commands")
    return sys.stdin.fileno()


@contextlib.contextmanager
def terminal_keys(file: int | None = None) -> Iterator[Callable[[], str]]:
    """Keys without waiting for a line, and without echo; the terminal is as before afterwards.

    Args:
        file: descriptor of the terminal; default: the standard input.

    Yields:
        What was typed since the last call, "" for nothing; :data:`END_OF_INPUT` after the end.

    Raises:
        NoTerminalError: the standard input is none, or the platform is Windows, whose terminals are not read.
    """
    try:
        import termios
        import tty
    except ModuleNotFoundError as error:
        raise NoTerminalError(
            "keyboard", "keyboard", "keys are not read on Windows; give a file of commands"
        ) from error
    number = terminal() if file is None else file
    before = termios.tcgetattr(number)

    def read() -> str:
        out = b""
        while select.select([number], [], [], 0.0)[0]:
            some = os.read(number, 64)
            if not some:
                return out.decode(errors="ignore") + END_OF_INPUT
            out += some
        return out.decode(errors="ignore")

    try:
        tty.setcbreak(number)
        yield read
    finally:
        termios.tcsetattr(number, termios.TCSADRAIN, before)


class LinesOfInput:
    """Lines of the standard input, until it ends or somebody stops waiting.

    Attributes:
        stop: asked while there is no line yet; true: there is none.
    """

    def __init__(self) -> None:
        self.stop: Callable[[], bool] = lambda: False
        self._read = b""

    def read(self) -> str | None:
        """The next line without blanks at its ends; None at the end of the input, or where it was stopped."""
        try:
            number = sys.stdin.fileno()
        except (OSError, ValueError):  # no file, as in a test
            line = sys.stdin.readline()
            return line.strip() if line else None
        # A line that waits in a buffer of sys.stdin would not be seen by select, and readline would not hear a stop
        while b"\n" not in self._read:
            if self.stop():
                return None
            if select.select([number], [], [], WAIT)[0]:
                some = os.read(number, 4096)
                if not some:
                    return None
                self._read += some
        first, _, self._read = self._read.partition(b"\n")
        return first.decode(errors="replace").strip()
