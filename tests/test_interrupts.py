"""Ctrl-C and ``kill`` in the process of the tests, and in commands that a shell has started in the background."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from tests.processes import IN_BACKGROUND
from wbc.interrupts import interrupts, obey_interrupts
from wbc.track import load


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    before = [(number, signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM)]
    hook, sys.unraisablehook = sys.unraisablehook, sys.__unraisablehook__
    yield
    sys.unraisablehook = hook
    for number, handler in before:
        signal.signal(number, handler)


def test_both_are_handled_by_a_command() -> None:
    obey_interrupts()
    came: list[int] = []
    with interrupts(lambda: came.append(1)):
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGTERM)
    assert came == [1, 1]
    for number in (signal.SIGINT, signal.SIGTERM):
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)


def test_a_library_leaves_kill_to_its_program() -> None:
    with interrupts(lambda: None):
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    came: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: came.append(number))
    obey_interrupts()
    with interrupts(lambda: None):
        os.kill(os.getpid(), signal.SIGTERM)
    assert came == [signal.SIGTERM]


def test_what_is_ignored_stays_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    obey_interrupts()
    with interrupts(lambda: pytest.fail("an ignored signal was handled")):
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGINT) is signal.getsignal(signal.SIGTERM) is signal.SIG_IGN


def test_other_threads_change_nothing() -> None:
    before, seen = signal.getsignal(signal.SIGINT), []

    def within() -> None:
        with interrupts(lambda: None):
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=within)
    thread.start()
    thread.join()
    assert seen == [before]


class Signalling(np.ndarray):
    """An array that sends a signal to the process whenever CasADi looks whether it holds numbers."""

    def astype(self, *given: Any, **named: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        return super().astype(*given, **named)


@pytest.fixture(scope="module")
def doubled() -> ca.Function:
    x = ca.SX.sym("x", 2)
    return ca.Function("doubled", [x], [2.0 * x])


def test_casadi_drops_no_interrupt(doubled: ca.Function) -> None:
    obey_interrupts()
    values: list[ca.DM] = []

    def twice() -> None:
        values.append(doubled(np.ones(2).view(Signalling)))
        values.append(ca.DM())

    with pytest.raises(KeyboardInterrupt):
        twice()
    # In the frame that called, before its next line
    assert [value.full().tolist() for value in values] == [[[2.0], [2.0]]]


def test_a_handler_is_called_once_casadi_has_returned(doubled: ca.Function) -> None:
    within, traced = list[bool](), sys.gettrace()

    def handler() -> None:
        within.append(any(frame.f_globals["__name__"] == "casadi.casadi" for frame, _ in traceback.walk_stack(None)))

    with interrupts(handler):
        values = [doubled(np.ones(2).view(Signalling)) for _ in range(3)]
    assert len(within) >= 3
    assert not any(within)
    assert sys.gettrace() is traced
    assert all(np.array_equal(value.full(), [[2.0], [2.0]]) for value in values)


class Finalized:
    def __del__(self) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        # The signal is handled before this returns
        time.sleep(0.0)


def test_a_finalizer_drops_no_interrupt(capsys: pytest.CaptureFixture[str]) -> None:
    obey_interrupts()
    alive = [Finalized()]

    def emptied() -> None:
        alive.clear()
        pytest.fail("the interrupt is lost")

    with pytest.raises(KeyboardInterrupt):
        emptied()
    assert capsys.readouterr().err == ""


def test_other_errors_of_finalizers_are_still_printed(capsys: pytest.CaptureFixture[str]) -> None:
    obey_interrupts()

    class Broken:
        def __del__(self) -> None:
            raise ValueError("of a finalizer")

    Broken()
    assert "ValueError: of a finalizer" in capsys.readouterr().err


def test_no_interrupt_of_many_is_lost_in_casadi(doubled: ca.Function) -> None:
    """Without :func:`obey_interrupts` more than half of them are."""
    obey_interrupts()
    before = signal.signal(signal.SIGALRM, signal.getsignal(signal.SIGINT))
    q, heard, rng = np.ones(2), 0, np.random.default_rng(0)
    try:
        for after in rng.uniform(1e-4, 1e-3, 300).tolist():
            try:
                signal.setitimer(signal.ITIMER_REAL, after)
                until = time.process_time() + 10.0
                while time.process_time() < until:
                    doubled(q)
            except KeyboardInterrupt:
                heard += 1
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert heard == 300


#: The demo, which sends signals to itself at two of its ticks
BACKGROUND = """
import os, signal, sys
from wbc import cli
from wbc.cli import session

track = session.track

def signalled(plan, progress, stop, compiled, **given):
    def at(ticks):
        progress(ticks)
        if ticks in (9, 20):
            os.kill(os.getpid(), signal.SIGINT if ticks == 9 else signal.SIGTERM)
    return track(plan, at, stop, compiled, **given)

session.track = signalled
sys.argv[0] = "wbc"
cli.main()
"""


def test_a_command_in_the_background_goes_on_at_ctrl_c_and_ends_in_order_at_kill(tmp_path: Path) -> None:
    command = ["track", "demo", "--backend", "vm", "--rate", "50", "--no-plots", "--out", str(tmp_path)]
    done = subprocess.run(
        [*IN_BACKGROUND, sys.executable, "-c", BACKGROUND, *command],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 130, done.stderr
    assert "interrupted, 20 of 600 ticks" in done.stdout
    assert len(load(tmp_path)) == 20
