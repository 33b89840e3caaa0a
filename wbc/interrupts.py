"""Ctrl-C (SIGINT), and ``kill`` (SIGTERM), which asks the same of a command that does not hear Ctrl-C.

A shell without job control, such as a script, has what it starts in the background ignore SIGINT, since a Ctrl-C at the
terminal is meant for what runs in the foreground. Nothing here makes such a process listen to it again.

An exception that a handler raises can be lost. CasADi drops all exceptions while it converts arguments and goes on, and
Python prints those of finalizers and goes on. Handlers that are installed here raise theirs later, in the frame that
called CasADi or in which the finalizer ran.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

#: Module in whose functions, and in what they call, exceptions are dropped
_DROPPING = "casadi.casadi"
#: Frames in which a handler is yet to be called
_waiting: list[FrameType] = []


def obey_interrupts() -> None:
    """From now on SIGINT and SIGTERM raise KeyboardInterrupt in the main thread, where it is not lost. For whole
    commands only: a library must leave to its program how that ends.

    Signals that are ignored or have another handler are left alone.
    """
    for number, default in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
        if signal.getsignal(number) is default:
            signal.signal(number, _interrupt)
    if sys.unraisablehook is sys.__unraisablehook__:
        sys.unraisablehook = _unraisable


@contextmanager
def interrupts(handler: Callable[[], None]) -> Iterator[None]:
    """Within it ``handler`` is called in place of a KeyboardInterrupt, for each signal that would raise one.

    SIGINT stays ignored where it is, and SIGTERM goes on doing what it does where no :func:`obey_interrupts` was.
    Elsewhere than in the main thread no signal arrives.
    """
    heard = {signal.SIGINT: signal.getsignal(signal.SIGINT)} if callable(signal.getsignal(signal.SIGINT)) else {}
    if signal.getsignal(signal.SIGTERM) is _interrupt:
        heard[signal.SIGTERM] = _interrupt
    if threading.current_thread() is not threading.main_thread():
        heard = {}
    try:
        for number in heard:
            signal.signal(number, lambda _number, frame: _answer(frame, handler))
        yield
    finally:
        for number, old in heard.items():
            signal.signal(number, old)


def _raise() -> None:
    raise KeyboardInterrupt


def _interrupt(_number: int, frame: FrameType | None) -> None:
    _answer(frame, _raise)


def _unraisable(what: sys.UnraisableHookArgs) -> None:
    """Raise again an interrupt that came in a finalizer; Python prints everything else."""
    if not issubclass(what.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(what)
    # No frame: the process ends anyhow
    elif (frame := sys._getframe().f_back) is not None:
        _answer_in(_outside(frame) or frame, _raise)


def _outside(frame: FrameType | None) -> FrameType | None:
    """The frame that called the outermost one of CasADi; None: there is none of it."""
    caller = None
    while frame is not None:
        if frame.f_globals.get("__name__") == _DROPPING:
            caller = frame.f_back
        frame = frame.f_back
    return caller


def _answer(frame: FrameType | None, handler: Callable[[], None]) -> None:
    """Call a handler now, or as soon as CasADi has returned."""
    if (caller := _outside(frame)) is None:
        handler()
    else:
        _answer_in(caller, handler)


def _answer_in(frame: FrameType, handler: Callable[[], None]) -> None:
    """Call a handler before the next line of a frame, which gets what it raises; once for signals that come at once."""
    if frame in _waiting:
        return
    before = sys.gettrace(), frame.f_trace

    def trace(current: FrameType, _event: str, _argument: Any) -> None:
        if current is frame:
            _waiting.remove(frame)
            frame.f_trace = before[1]
            sys.settrace(before[0])
            handler()

    _waiting.append(frame)
    frame.f_trace = trace
    sys.settrace(trace)
