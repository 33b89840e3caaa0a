"""What lower and upper limits of a quantity share: their values, inputs that may move, and margins."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import BoundsError, NotFiniteError, ShapeError
from wbc.tasks.base import Input, Row, Values

#: Values of a limit: one for all rows or one a row; None: no rows of it.
LimitValues = float | tuple[float, ...] | None

#: The infinity that means no limit, by which limit it is
NO_LIMIT = {"lower": -math.inf, "upper": math.inf}

#: Bounds beyond this are taken as infinite where a margin is faded
BEYOND = 1e20


def checked_limits(owner: str, lower: Any, upper: Any, count: int | None = None) -> tuple[LimitValues, LimitValues]:
    """Both limits as floats or tuples; ``count``: how many numbers one has, where that is known.

    Raises:
        ShapeError: no numbers, or neither limit. NotFiniteError: NaN, or the wrong infinity.
        BoundsError: lower > upper.
    """
    limits = [_checked(f"{owner}.{name}", name, value, count) for name, value in (("lower", lower), ("upper", upper))]
    low, high = limits
    if low is None and high is None:
        raise ShapeError(f"{owner}.lower", None, "expected a lower or an upper limit, or both")
    if low is not None and high is not None:
        if isinstance(low, tuple) and isinstance(high, tuple) and len(low) != len(high):
            raise ShapeError(f"{owner}.upper", upper, f"lower has {len(low)} numbers")
        for k, (a, b) in enumerate(np.broadcast(low, high)):
            if a > b:
                raise BoundsError(f"{owner}.lower", lower, f"above upper = {b:g} in entry {k}")
    return low, high


def _checked(field: str, name: str, value: Any, count: int | None) -> LimitValues:
    if value is None:
        return None
    numbers = validation.real_array(field, value, finite=False)
    if numbers.ndim > 1 or numbers.size == 0 or (count is not None and numbers.shape not in ((), (count,))):
        raise ShapeError(field, value, f"expected one number or {count or 'one a row'}")
    if not (np.isfinite(numbers) | (numbers == NO_LIMIT[name])).all():
        raise NotFiniteError(field, value, f"expected finite numbers, or {NO_LIMIT[name]:g} for no limit")
    return tuple(numbers.tolist()) if numbers.ndim else float(numbers)


def limit_inputs(lower: LimitValues, upper: LimitValues, units: Iterable[str]) -> tuple[Input, ...]:
    """``lower``, ``lower_rate``, ``upper``, ``upper_rate``, of the limits there are; a number a row."""
    each = tuple(units)
    unit, count = ", ".join(dict.fromkeys(each)), len(each)
    per_second = ", ".join(f"{u or '1'}/s" for u in dict.fromkeys(each))
    out: list[Input] = []
    for name, value in (("lower", lower), ("upper", upper)):
        if value is None:
            continue
        below = "upper" if name == "lower" and upper is not None else None
        start, rate = np.broadcast_to(np.array(value, dtype=np.float64), count).copy(), f"{name}_rate"
        none = NO_LIMIT[name]
        out.append(Input(name, unit=unit, size=count, default=start, rate=rate, infinite=none, each=True, below=below))
        out.append(Input(rate, unit=per_second, size=count, default=np.zeros(count), each=True))
    return tuple(out)


def limit_rows(lower: LimitValues, upper: LimitValues, rows: Iterable[Row]) -> tuple[Row, ...]:
    """``label.lower`` of every row, then ``label.upper``, of the limits there are."""
    each = tuple(rows)
    given = [name for name, value in (("lower", lower), ("upper", upper)) if value is not None]
    return tuple(Row(f"{row.label}.{name}", row.unit) for name in given for row in each)


def limit_margins(value: ca.SX, inputs: Values, factor: ca.SX | None = None) -> ca.SX:
    """(value - lower, upper - value), of the limits there are.

    With a factor f a margin h becomes f h + (1 - f) c: where f falls to 0 it is the constant c > 0, whose derivative is
    zero, so the limit is off. c is half of upper - lower, or 1 where there is no other limit.
    """
    count = value.numel()
    lower, upper = (inputs.get(name) for name in ("lower", "upper"))
    if factor is None:
        plain = ([] if lower is None else [value - lower]) + ([] if upper is None else [upper - value])
        return ca.SX(ca.vertcat(*plain))
    low = -ca.SX.inf(count) if lower is None else lower
    high = ca.SX.inf(count) if upper is None else upper
    margins: list[ca.SX] = []
    for limit, sign in ((lower, 1.0), (upper, -1.0)):
        if limit is None:
            continue
        for k in range(count):
            limited, closed = ca.fabs(limit[k]) < BEYOND, high[k] - low[k] < BEYOND
            # An infinite number never meets a factor of 0
            end = ca.if_else(limited, limit[k], 0.0)
            middle = ca.if_else(closed, (high[k] - low[k]) / 2, 1.0)
            faded = factor[k] * sign * (value[k] - end) + (1 - factor[k]) * middle
            margins.append(ca.if_else(limited, faded, ca.inf))
    return ca.vertcat(*margins)
