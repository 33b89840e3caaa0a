"""How a process that answers commands line by line begins."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence


def begin(core: Sequence[str]) -> None:
    """Stay on a core, where one is given, and keep standard output for answers.

    Packages print to standard output at will: what they print goes to standard error, and ``sys.stdout`` to where
    standard output went.
    """
    if core:
        os.sched_setaffinity(0, {int(core[0])})
    answers = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = os.fdopen(answers, "w")
