"""A process that answers commands: one JSON object a line in, one out."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

Object = dict[str, Any]


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


def serve(answer: Callable[[Object], Object], ready: Object) -> None:
    """Say what is ready, then answer commands until standard input ends."""
    print(json.dumps(ready), flush=True)
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), flush=True)
