"""Ctrl-C (SIGINT), and ``kill`` (SIGTERM), which asks the same of a command that does not hear Ctrl-C.

A shell without job control, such as a script, has what it starts in the background ignore SIGINT, since a Ctrl-C at the
terminal is meant for what runs in the foreground. Nothing here makes such a process listen to it again.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


def obey_kill() -> None:
    """From now on SIGTERM raises KeyboardInterrupt in the main thread, as Ctrl-C does. For whole commands only: a
    library must leave to its program how that ends.
    """
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, signal.default_int_handler)


@contextmanager
def interrupts(handler: Callable[[], None]) -> Iterator[None]:
    """Within it ``handler`` is called in place of a KeyboardInterrupt, for each signal that would raise one.

    SIGINT stays ignored where it is, and SIGTERM goes on doing what it does where no :func:`obey_kill` was. Elsewhere
    than in the main thread no signal arrives.
    """
    heard = {signal.SIGINT: signal.getsignal(signal.SIGINT)} if callable(signal.getsignal(signal.SIGINT)) else {}
    if signal.getsignal(signal.SIGTERM) is signal.default_int_handler:
        heard[signal.SIGTERM] = signal.default_int_handler
    if threading.current_thread() is not threading.main_thread():
        heard = {}
    try:
        for number in heard:
            signal.signal(number, lambda _number, _frame: handler())
        yield
    finally:
        for number, old in heard.items():
            signal.signal(number, old)
