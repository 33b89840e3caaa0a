"""Values that no argument expects, and good values of which one part is spoiled."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

#: Makers, so that no call meets what another one changed
HOSTILE: tuple[Callable[[], Any], ...] = (
    lambda: None, lambda: True, lambda: 0, lambda: -1, lambda: 2**70, lambda: -(2**70), lambda: 0.5, lambda: -0.0,
    lambda: math.nan, lambda: math.inf, lambda: -math.inf, lambda: 1e308, lambda: -1e200, lambda: 1e200,
    lambda: 1e-320, lambda: 1e-200, lambda: 1j, lambda: "", lambda: "typo", lambda: "a\0b", lambda: "\ud800",
    lambda: "x" * 5000, lambda: "/", lambda: b"bytes", list, lambda: (), dict, lambda: {1, 2},
    lambda: [math.nan], lambda: [[1.0], [1.0, 2.0]], lambda: [[]], lambda: [None], lambda: ["typo"], lambda: [[1], "a"],
    lambda: {"typo": 1.0}, lambda: {1: math.nan}, lambda: {"typo": [math.nan]}, lambda: [object()],
    object, lambda: str, lambda: repr, lambda: lambda *_: 1.0, lambda: lambda *_: math.nan,
    lambda: np.zeros(0), lambda: np.zeros((3, 3, 3)), lambda: np.full(3, math.nan), lambda: np.array("text"),
    lambda: np.array([None]), lambda: np.array([1e200, -1e200, 1e200]), lambda: np.full(3, 1e-320),
    lambda: np.zeros(3, dtype=complex), lambda: np.datetime64("2020-01-01"), lambda: np.float32(1.0),
    lambda: np.int64(-3), lambda: range(3), lambda: iter([1.0]), lambda: slice(None), lambda: ...,
    lambda: pin.SE3(np.eye(3), np.full(3, math.nan)), lambda: pin.SE3(2.0 * np.eye(3), np.zeros(3)),
    lambda: pin.SE3(np.eye(3), np.full(3, 1e200)), pin.Model, lambda: (("a", "b"),),
    lambda: [("a", "b", "c")],
)  # fmt: skip

NUMBERS = (math.nan, math.inf, -math.inf, 1e308, -1e200, 1e200, 1e-320, -1.0, 0.0, 1e9)


def hostile(rng: np.random.Generator) -> Any:
    """Any of them."""
    return HOSTILE[rng.integers(len(HOSTILE))]()


def spoiled(value: Any, rng: np.random.Generator) -> Any:
    """A good value with one part that is wrong, or something else in its place."""
    if rng.random() < 0.4:
        return hostile(rng)
    if isinstance(value, bool | None):
        return hostile(rng)
    if isinstance(value, int | float):
        return rng.choice(NUMBERS) if rng.random() < 0.8 else [value]
    if isinstance(value, str):
        return [value + "x", value.upper(), value.encode(), [value], (value, value)][rng.integers(5)]
    if isinstance(value, np.ndarray):
        return _array(value, rng)
    if isinstance(value, tuple | list) and type(value) in (tuple, list):
        return type(value)(_list(list(value), rng))
    if isinstance(value, Mapping):
        return spoiled_entries(dict(value), rng)
    return hostile(rng)


def _array(value: np.ndarray, rng: np.random.Generator) -> Any:
    kind = rng.integers(6)
    if kind == 0:
        return value[..., None]
    if kind == 1:
        return value[:-1] if value.ndim else value[None]
    if kind == 2:
        return value.astype(object)
    if kind == 3:
        return np.concatenate([value, value]) if value.ndim else value * 1j
    out = np.array(value, dtype=float)
    if out.size:
        out.flat[rng.integers(out.size)] = rng.choice(NUMBERS)
    return out.tolist() if kind == 4 else out


def _list(value: list[Any], rng: np.random.Generator) -> list[Any]:
    kind = rng.integers(4)
    if not value or kind == 0:
        return [*value, hostile(rng)]
    if kind == 1:
        return value[:-1]
    if kind == 2:
        return value + value
    k = int(rng.integers(len(value)))
    return [*value[:k], spoiled(value[k], rng), *value[k + 1 :]]


def spoiled_entries(value: dict[Any, Any], rng: np.random.Generator) -> dict[Any, Any]:
    """A mapping with one entry that is wrong."""
    if not value or rng.random() < 0.3:
        return value | {["typo", 3, ("a", "b")][rng.integers(3)]: hostile(rng)}
    key = list(value)[rng.integers(len(value))]
    if rng.random() < 0.3:
        return {(3 if k is key else k): v for k, v in value.items()}
    return value | {key: spoiled(value[key], rng)}
