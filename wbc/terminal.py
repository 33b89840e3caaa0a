"""Keys of a terminal as they are pressed."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator

from wbc.errors import WbcError

#: What stands for the end of the input
END_OF_INPUT = "\x04"


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
        NoTerminalError: the standard input is none.
    """
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
