"""Optimised ticks for tests that run thousands of them; the others compile without, see conftest.

The tick of a humanoid takes a third of the time at -O2, and a second and a half more to compile; the bits are the same
(tests/controller/test_optimised.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial

import pytest

from wbc.native import toolchain

_ask = toolchain.identity.__wrapped__


@contextmanager
def ticks(tick: str = "-O2", rows: str = "-O0") -> Iterator[None]:
    """Stacks that are compiled within get these flags for the hand-written cycle and for the rows."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "TICK_FLAGS", (tick,))
        patch.setattr(toolchain, "ROWS_FLAGS", (rows,))
        patch.setattr(toolchain, "identity", partial(_identity, tick, rows))
        yield


@cache
def _identity(tick: str, rows: str) -> str:
    """What names the compiler with these flags, asked of it once a process."""
    return str(_ask())
