"""What functions of time take between samples: bounds from the slopes that were seen, with more samples at need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc.trajectory.paths.path import Index
from wbc.validation import Array

#: Rounds of more samples
ROUNDS = 2
#: Factor of the samples of a round
TIMES = 8

#: What may lie between samples, above the highest of them, without a look at more samples
CLOSE = 2e-4


@dataclass(frozen=True)
class Highest:
    """The highest value: a bound of it, the highest sample, where that is, and the largest time between samples."""

    bound: float
    seen: float
    piece: int
    place: float
    column: int
    spacing: float


def slopes(span: Array, values: Array) -> Array:
    """Largest slopes between neighbours among samples (pieces x samples x numbers), pieces x numbers, in terms of the
    place in a piece over its span.
    """
    return np.asarray(np.abs(np.diff(values, axis=1)).max(axis=1) * (values.shape[1] - 1) / span[:, None])


def bounds(span: Array, values: Array, steepest: Array) -> Array:
    """Bounds of pieces, pieces x numbers, from samples evenly spaced over each.

    Between two neighbours f rises above the larger by at most (L h - |f1 - f0|) / 2 for a Lipschitz constant L; for L
    stands twice the ``steepest`` slope that was seen (pieces x numbers).
    """
    reach = 2.0 * (steepest * span[:, None] / (values.shape[1] - 1))[:, None]
    over = np.maximum(values[:, 1:], values[:, :-1]) + 0.5 * (reach - np.abs(np.diff(values, axis=1)))
    return np.asarray(over.max(axis=1))


def around(steepest: Array) -> Array:
    """The largest of each piece and of those beside it."""
    out = steepest.copy()
    out[1:] = np.maximum(out[1:], steepest[:-1])
    out[:-1] = np.maximum(out[:-1], steepest[1:])
    return out


def highest(span: Array, evaluate: Callable[[Index, int], Array], count: int, rounds: int = ROUNDS) -> Highest:
    """The highest value of functions over pieces of time.

    ``evaluate``: numbers of pieces, and a count -> samples at count + 1 points of each, pieces x points x numbers.
    Pieces in which more than :data:`CLOSE` above the highest sample may lie are sampled more densely.
    """
    pieces = np.arange(len(span))
    values = evaluate(pieces, count)
    steepest = around(slopes(span, values))
    bound = bounds(span, values, steepest)
    seen, piece, place, column = _top(values, pieces)
    spacing = np.full(len(span), count)
    for _ in range(rounds):
        pieces = np.flatnonzero(bound.max(axis=1) > seen + CLOSE)
        if not pieces.size:
            break
        count *= TIMES
        values = evaluate(pieces, count)
        steepest[pieces] = np.maximum(steepest[pieces], slopes(span[pieces], values))
        bound[pieces] = bounds(span[pieces], values, steepest[pieces])
        spacing[pieces] = count
        more = _top(values, pieces)
        if more[0] > seen:
            seen, piece, place, column = more
    return Highest(float(bound.max()), seen, piece, place, column, float((span / spacing).max()))


def _top(values: Array, pieces: Index) -> tuple[float, int, float, int]:
    row, sample, column = (int(k) for k in np.unravel_index(int(values.argmax()), values.shape))
    return float(values[row, sample, column]), int(pieces[row]), sample / (values.shape[1] - 1), column
