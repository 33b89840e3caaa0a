"""Cycles and instructions of a program, as perf counts them or, where it cannot, instructions as valgrind does."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

#: Names of what is counted
Counts = dict[str, float]


def perf(command: Sequence[str], folder: Path) -> Counts | None:
    """Cycles and instructions in user space by ``perf stat``; None where it is missing or has no counters."""
    if shutil.which("perf") is None:
        return None
    given = ["perf", "stat", "-x,", "-e", "cycles:u,instructions:u", *command]
    done = subprocess.run(given, cwd=folder, capture_output=True, text=True, check=False)
    lines = re.findall(r"^(\d+),[^,]*,(cycles|instructions):u", done.stderr, re.MULTILINE)
    found = {name: float(count) for count, name in lines}
    return found if done.returncode == 0 and len(found) == 2 else None


def valgrind(command: Sequence[str], folder: Path) -> Counts | None:
    """Instructions by ``valgrind --tool=cachegrind``; None where it is missing or cannot run the program."""
    if shutil.which("valgrind") is None:
        return None
    given = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null", *command]
    done = subprocess.run(given, cwd=folder, capture_output=True, text=True, check=False)
    found = re.search(r"I\s+refs:\s+([\d,]+)", done.stderr)
    return {"instructions": float(found[1].replace(",", ""))} if done.returncode == 0 and found else None


COUNTERS: dict[str, Callable[[Sequence[str], Path], Counts | None]] = {"perf stat": perf, "valgrind": valgrind}


def per_pass(program: str, path: str, folder: Path, passes: int) -> tuple[str, Counts]:
    """Which counter there is, and what a pass adds: runs of one round and of ``1 + passes`` rounds are compared.

    A round has two passes. ("none", {}) where nothing counts.
    """
    for name, count in COUNTERS.items():
        few, many = (count([program, path, str(rounds)], folder) for rounds in (1, 1 + passes))
        if few is not None and many is not None:
            return name, {what: (many[what] - few[what]) / (2.0 * passes) for what in few}
    return "none", {}
