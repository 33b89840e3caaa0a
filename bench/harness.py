"""What every run says about itself, who takes part, and how samples are summed up."""

from __future__ import annotations

import json
import platform
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bench.pool import ROOT, cores

#: Contender that ratios are taken to
OURS = "wbc"
#: What stands beside it
PEERS = ("pink + daqp", "mink + daqp", "placo")
#: Where `make bench` installs the peers
PEERS_PYTHON = ROOT / ".venv-peers" / "bin" / "python"


def interpreter(path: str) -> str:
    """An option that names one, from every folder. Not resolved: a virtual environment's interpreter is a link."""
    return str(Path(path).absolute())


def pythons(peers_python: str | None, peers: Sequence[str] = PEERS) -> dict[str, str]:
    """Contender -> interpreter; without that of the peers they are left out."""
    return {OURS: sys.executable} | dict.fromkeys(peers if peers_python else (), str(peers_python))


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
    }


def versions(python: str, names: Sequence[str]) -> dict[str, str]:
    """Package -> version in the environment of an interpreter."""
    code = "import importlib.metadata as m, json, sys; print(json.dumps({n: m.version(n) for n in sys.argv[1:]}))"
    done = subprocess.run([python, "-c", code, *names], capture_output=True, text=True, check=True, cwd=ROOT.anchor)
    found: dict[str, str] = json.loads(done.stdout)
    return found
