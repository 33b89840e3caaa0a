"""The viewer's process stands aside: it never takes the core of the loop, and its waking never interrupts a tick."""

from __future__ import annotations

import contextlib
import os
import pathlib
import sys

#: Below the loop where both want one core
NICE = 5
#: Fields of ``/proc/PID/task/TID/stat`` behind the name: which core a thread ran on last
CORE = 36


def step_aside() -> None:
    """Before there are threads, which inherit it: a batch process, which on waking interrupts nobody."""
    os.nice(NICE)
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


class CoreLeft:
    """Leaves the core of a loop's thread to it, wherever the kernel moves that thread.

    A tick that finds its core's caches as it left them takes up to a third less than one behind a process that drew a
    scene there; and a loop that wakes where somebody is at work waits for the end of a slice, a millisecond or more.

    Args:
        process: of the loop.
    """

    def __init__(self, process: int) -> None:
        self._tasks = pathlib.Path(f"/proc/{process}/task")
        # Elsewhere nobody says on which core a thread runs
        self._all = os.sched_getaffinity(0) if sys.platform == "linux" else set[int]()
        self._left = -1

    def look(self, thread: int) -> None:
        """Keep off the core that a thread of the loop ran on last; with one core there is nothing to leave."""
        if sys.platform != "linux":
            return
        with contextlib.suppress(OSError, ValueError, IndexError):
            stat = (self._tasks / str(thread) / "stat").read_text(encoding="ascii", errors="replace")
            core = int(stat.rpartition(")")[2].split()[CORE])
            rest = self._all - {core}
            if core == self._left or not rest:
                return
            for task in os.listdir("/proc/self/task"):
                os.sched_setaffinity(int(task), rest)
            self._left = core
