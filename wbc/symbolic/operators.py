"""CasADi's operators between SX without their search for a type.

``a + b`` asks first whether both are numbers or DM, by attributes that an SX does not have: 18 us for two 3x3 matrices,
of which the sum itself takes 3 us. ``SX.binary``, which makes the same expression, takes nothing but SX.

Every other function of CasADi asks of an SX whether it is an array, a sparse matrix of scipy, and of what shape, by
Python functions that take a fifth of its time; here they are shorter.
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


# Not in CasADi's stub
_from_array, _from_csc = vars(ca)["DM_from_array"], vars(ca)["DM_from_csc"]
_size = vars(ca)["_casadi"].GenSX_size


def _array(value: object, check_only: bool = True) -> object:
    """What CasADi makes a DM of an array from."""
    return type(value) is not ca.SX and _from_array(value, check_only)


def _sparse(value: object, check_only: bool = True) -> object:
    """What CasADi makes a DM of a sparse matrix from."""
    return type(value) is not ca.SX and _from_csc(value, check_only)


#: Where CasADi asks, and quick answers; the shape of one call of C, where CasADi's has two of Python and two of C
_ANSWERS = ((ca.SX, "shape", property(_size)), (ca, "DM_from_array", _array), (ca, "DM_from_csc", _sparse))
#: What is there outside of :func:`quick_operators`
_outside = tuple((place, name, vars(place)[name]) for place, name, _ in _ANSWERS)


def _answer(quick: bool) -> None:
    for place, name, answer in _ANSWERS if quick else _outside:
        setattr(place, name, answer)


@contextmanager
def quick_operators() -> Iterator[None]:
    """Within, + - * / of SX are quick, and all else a little, in all threads; the expressions are the same."""
    with _lock:
        _within[0] += 1
        for name, operator in _QUICK.items():
            setattr(ca.SX, name, operator)
        _answer(True)
    try:
        yield
    finally:
        with _lock:
            _within[0] -= 1
            if not _within[0]:
                for name in _QUICK:
                    delattr(ca.SX, name)
                _answer(False)
