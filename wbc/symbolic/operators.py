"""CasADi's operators between SX without their search for a type.

``a + b`` asks first whether both are numbers or DM, by attributes that an SX does not have: 18 us for two 3x3 matrices,
of which the sum itself takes 3 us. ``SX.binary``, which makes the same expression, takes nothing but SX.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import casadi as ca

Operator = Callable[[ca.SX, object], ca.SX]

_CODES = {"add": ca.OP_ADD, "sub": ca.OP_SUB, "mul": ca.OP_MUL, "truediv": ca.OP_DIV}
_lock, _within = threading.Lock(), [0]


def _between(name: str, code: int) -> Operator:
    """An operator that is quick where both are SX, or one is a number."""
    slow: Operator = getattr(ca.SX, name)
    binary, reflected = ca.SX.binary, name.startswith("__r")

    def operator(x: ca.SX, y: object) -> ca.SX:
        if isinstance(y, (ca.SX, float, int)):
            return binary(code, y, x) if reflected else binary(code, x, y)
        return slow(x, y)

    return operator


_QUICK = {
    f"__{side}{name}__": _between(f"__{side}{name}__", code) for name, code in _CODES.items() for side in ("", "r", "i")
}


@contextmanager
def quick_operators() -> Iterator[None]:
    """Within, + - * / of SX are quick, in all threads; the expressions are the same."""
    with _lock:
        _within[0] += 1
        for name, operator in _QUICK.items():
            setattr(ca.SX, name, operator)
    try:
        yield
    finally:
        with _lock:
            _within[0] -= 1
            for name in _QUICK if not _within[0] else ():
                delattr(ca.SX, name)
