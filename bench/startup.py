"""What a process costs before its first tick: import, compilation, memory. Each in a fresh process."""

from __future__ import annotations

import os
import statistics
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

from bench.pool import ROOT, Worker, user_environment

#: Package -> what a user imports
IMPORTS = {"wbc": "wbc", "pink": "pink", "mink": "mink", "placo": "placo"}
REPEATS = 3


def import_seconds(python: str, module: str) -> float:
    """Wall time of ``import module`` in a fresh interpreter, files cached, the median of three [s]."""
    code = f"import time; t = time.perf_counter(); import {module}; print(time.perf_counter() - t)"
    _output(python, code)
    return statistics.median(float(_output(python, code)) for _ in range(REPEATS))


def peak_memory(python: str, contender: str, folder: Path, core: int | None, ticks: int) -> int:
    """Peak resident memory of a process that runs one problem for ``ticks`` ticks [bytes]."""
    with Worker(python, contender, folder, core) as worker:
        worker.ask("time", ticks=ticks)
        return int(worker.ask("memory")["peak"])


def compile_seconds(python: str, contender: str, folder: Path) -> dict[str, float]:
    """Wall and processor time of ``stack.compile()`` with an empty cache, then, in a second process, a full one [s]."""
    with tempfile.TemporaryDirectory(prefix="wbc-bench-") as cache:
        environment: Mapping[str, str] = {"XDG_CACHE_HOME": cache}
        out = {}
        for kind in ("first", "cached"):
            with Worker(python, contender, folder, None, environment) as worker:
                out[kind] = float(worker.ready["facts"]["compile"])
                out[f"{kind} cpu"] = float(worker.ready["facts"]["compile cpu"])
        return out


def settings() -> dict[str, str]:
    """Environment variables that change how fast numeric code runs, as the workers see them."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "PYTHONOPTIMIZE", "PYTHONMALLOC")
    return {name: os.environ.get(name, "not set") for name in names}


def _output(python: str, code: str) -> str:
    """What a fresh interpreter prints, started outside the repository."""
    command = [python, "-c", code]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=ROOT.anchor, env=user_environment()
    ).stdout
