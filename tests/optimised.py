"""Optimised ticks for tests that run thousands of them; the others compile without, see conftest.

At -Og a tick takes 0.2 s more to compile than at -O0, at -O2 1.1 s more, which a few thousand ticks do not earn back;
the bits are the same (tests/controller/test_optimised.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial

import pytest

from wbc.native import toolchain

_ask = toolchain.identity.__wrapped__
#: The flags for the tick of each context that the process is in
_within: list[str] = []


def busy() -> bool:
    """Stacks that are compiled now will run thousands of ticks."""
    return bool(_within)


@contextmanager
def ticks(tick: str = "-Og", rows: str = "-O0") -> Iterator[None]:
    """Stacks that are compiled within get these flags for the hand-written cycle and for the rows."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "TICK_FLAGS", (tick,))
        patch.setattr(toolchain, "ROWS_FLAGS", (rows,))
        patch.setattr(toolchain, "identity", partial(_identity, tick, rows))
        _within.append(tick)
        try:
            yield
        finally:
            _within.pop()


@cache
def _identity(tick: str, rows: str) -> str:
    """What names the compiler with these flags, asked of it once a process."""
    return str(_ask())
