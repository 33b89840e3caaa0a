"""Ctrl-C and ``kill`` in the process of the tests, and in commands that a shell has started in the background."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes import IN_BACKGROUND
from wbc.interrupts import interrupts, obey_kill
from wbc.track import load


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    before = [(number, signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM)]
    yield
    for number, handler in before:
        signal.signal(number, handler)


def test_both_are_handled_by_a_command() -> None:
    obey_kill()
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
    obey_kill()
    with interrupts(lambda: None):
        os.kill(os.getpid(), signal.SIGTERM)
    assert came == [signal.SIGTERM]


def test_what_is_ignored_stays_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    obey_kill()
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
