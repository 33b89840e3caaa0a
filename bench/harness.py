"""What every run says about itself, and how samples are summed up."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bench.pool import cores

#: Contender that ratios are taken to
OURS = "wbc"
#: What stands beside it
PEERS = ("pink + daqp", "mink + daqp", "placo")
#: Environment variables that change how fast numeric code runs
SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "PYTHONOPTIMIZE", "PYTHONMALLOC")


def statistics(nanoseconds: Sequence[float]) -> dict[str, float]:
    """Median, 99 %, 99.9 % and largest [us]."""
    values = np.array(nanoseconds) / 1e3
    median, p99, p999 = np.percentile(values, [50.0, 99.0, 99.9])
    return {"median": float(median), "p99": float(p99), "p99.9": float(p999), "max": float(values.max())}


def processor() -> str:
    """Name of the processor's model."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    return next((line.split(":")[1].strip() for line in lines if "model name" in line), platform.machine())


def machine() -> dict[str, str]:
    """Where the figures come from, without naming the machine."""
    load_average = Path("/proc/loadavg").read_text().split()[0]
    return {
        "processor": processor(),
        "python": platform.python_version(),
        "cores": cores()[1],
        "load": f"{load_average} (1 minute average before the run)",
        "garbage collector": "on, as Python starts it",
        "threads": ", ".join(f"{name} {os.environ.get(name, 'not set')}" for name in SETTINGS),
    }
