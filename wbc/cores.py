"""How many processor cores this process may use."""

from __future__ import annotations

import os
import sys


def cores() -> int:
    """Those that it is bound to, where the system says, else all; at least 1."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
