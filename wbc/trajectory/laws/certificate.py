"""How much of its limits a law uses, at the worst time, bounded from above.

For piecewise polynomial paths and timings each derivative of each joint is a polynomial between breaks. Its Bernstein
coefficients bound it, and are halved until the bound is within 1e-13 of a value that is taken: ``exact``. Else the law
is sampled, and what lies between two samples is bounded by their values and twice the largest slope that was seen:
``sampled``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.trajectory.laws.between import Highest, highest
from wbc.trajectory.laws.limits import MotionLimits
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.paths import bernstein
from wbc.trajectory.paths.path import Index, Path
from wbc.validation import Array

Kind = Literal["exact", "sampled", "unbounded"]

#: Quantity -> order of its derivative
ORDERS = {"position": 0, "velocity": 1, "acceleration": 2, "jerk": 3}

#: What `exact` calls satisfied
TOLERANCE = 1e-6

#: Intervals between samples of checks in each piece
SAMPLES = 8

#: Steps of a derivative at a break, relative to its limit, that are rounding
STEP = 1e-9


class Check(Protocol):
    """A quantity with limits that is known by its values alone: torques, the speed of a frame, contact forces.

    Attributes:
        name: its entry in the certificate.
        columns: numbers after which the ratios repeat with the other sign; the joint of :class:`Worst` counts them.
    """

    @property
    def name(self) -> str: ...

    @property
    def columns(self) -> int: ...

    def ratios(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """m x k numbers that are at most 1 where the limits are satisfied, at m states (m x n, or m x 4 x 4)."""
        ...


def all_checks(checks: Any) -> tuple[Check, ...]:
    """Checks as they were given.

    Raises:
        ShapeError: something that has no ``name``, ``columns`` and ``ratios``.
    """
    out = validation.items("checks", checks, "checks")
    for check in out:
        if isinstance(check, type) or not all(hasattr(check, part) for part in ("name", "columns", "ratios")):
            raise ShapeError("checks", check, "expected a check: name, columns and ratios")
    return out


@dataclass(frozen=True)
class Worst:
    """Where a quantity comes nearest to its limit, or goes farthest beyond it.

    Attributes:
        ratio: largest |quantity| / limit, bounded from above; for positions 1 + (how far beyond a limit) / half the
            range, or over the limit's own size (at least 1) where the range has no other end. inf for ``unbounded``.
        joint: its number. time: when [s].
        kind: ``exact``; ``sampled``; ``unbounded``: the quantity one order below jumps.
        between: share of the ratio that bounds what lies between samples, 0 for ``exact``.
        spacing: largest time between samples [s], 0 for ``exact``.
    """

    ratio: float
    joint: int
    time: float
    kind: Kind
    between: float = 0.0
    spacing: float = 0.0


@dataclass(frozen=True)
class LawCertificate:
    """Worst ratios by quantity: ``position``, ``velocity``, ``acceleration``, ``jerk``, and what else was requested.

    Quantities without a limit are not in it, but for jerk, which is in it as ``unbounded`` where accelerations jump.

    Attributes:
        worst: by quantity. limited: the quantities that have a limit.
    """

    worst: dict[str, Worst]
    limited: frozenset[str] = frozenset()

    @property
    def ratio(self) -> float:
        """The largest of all quantities with a limit; 0 where there is none."""
        return max((w.ratio for name, w in self.worst.items() if name in self.limited), default=0.0)

    @property
    def satisfied(self) -> bool:
        """Whether every limit is satisfied within 1e-6; where it was sampled, with what may lie between."""
        return self.ratio <= 1.0 + TOLERANCE

    def __str__(self) -> str:
        parts = []
        for name, w in self.worst.items():
            if w.kind == "unbounded":
                parts.append(f"{name}: unbounded")
                continue
            share = f" (+{w.between:.1e} between samples)" if w.kind == "sampled" else ""
            parts.append(f"{name} {w.ratio:.7f}{share} at {w.time:.4g} s, joint {w.joint}, {w.kind}")
        return "; ".join(parts) or "no limits"


@dataclass(frozen=True, eq=False)
class LawPieces:
    """Intervals of time on which a law is smooth, with the pieces of its timing and of its path."""

    start: Array
    span: Array
    timing: Index
    path: Index

    @classmethod
    def of(cls, path: Path, timing: Timing) -> LawPieces:
        """Breaks of the timing, and times at which s passes a knot."""
        inside = timing.crossings(path.knots[1:-1])
        times = np.unique(np.concatenate([timing.times, inside]))
        start, span = times[:-1], np.diff(times)
        middle = start + 0.5 * span
        pieces = timing.pieces_at(middle)
        return cls(start, span, pieces, path.pieces_at(timing.evaluate(middle, 0, pieces)))

    def at(self, path: Path, timing: Timing, order: int, u: Array) -> Array:
        """A derivative of the law at u in [0, 1] of every piece: pieces x samples x n."""
        count, samples = len(self.start), len(u)
        times = (self.start[:, None] + self.span[:, None] * u).ravel()
        on_timing, on_path = np.repeat(self.timing, samples), np.repeat(self.path, samples)
        s = [timing.evaluate(times, k, on_timing) for k in range(order + 1)]
        s[0] = np.clip(s[0], path.knots[on_path], path.knots[on_path + 1])
        out = chain(path, s, on_path, order)
        return out.reshape(count, samples, *out.shape[1:])

    def some(self, numbers: Index) -> LawPieces:
        """Those of some numbers."""
        return LawPieces(self.start[numbers], self.span[numbers], self.timing[numbers], self.path[numbers])

    def states(self, path: Path, timing: Timing, count: int = SAMPLES) -> list[Array]:
        """Position, velocity and acceleration at both ends and between, count + 1 times in every piece."""
        u = np.linspace(0.0, 1.0, count + 1)
        parts = [self.at(path, timing, order, u) for order in (0, 1, 2)]
        return [part.reshape(-1, *part.shape[2:]) for part in parts]


def chain(path: Path, s: list[Array], piece: Index, order: int) -> Array:
    """The derivative along time of path(s(t)), from s and its derivatives along time."""
    if order == 0:
        return path.evaluate(s[0], 0, piece)
    first = path.evaluate(s[0], 1, piece)
    if order == 1:
        return first * s[1][:, None]
    second = path.evaluate(s[0], 2, piece)
    if order == 2:
        return second * (s[1] ** 2)[:, None] + first * s[2][:, None]
    third = path.evaluate(s[0], 3, piece)
    return third * (s[1] ** 3)[:, None] + second * (3.0 * s[1] * s[2])[:, None] + first * s[3][:, None]


def certify(
    path: Path,
    timing: Timing,
    limits: MotionLimits,
    checks: Sequence[Check] = (),
    samples: int = 16,
    moving: tuple[bool, bool] = (False, False),
) -> LawCertificate:
    """Worst ratios of a law; ``samples``: of each piece, at first, where it is no polynomial or one of a degree above
    24; ``moving``: as of the law.
    """
    pieces = LawPieces.of(path, timing)
    worst: dict[str, Worst] = {}
    limited = set()
    for name, order in ORDERS.items():
        scaled = _scaled(name, limits, path)
        if scaled is not None:
            limited.add(name)
        if name == "jerk":
            jump = _jump(path, timing, pieces, limits, moving)
            if jump is not None:
                worst[name] = jump
                continue
        if scaled is None:
            continue
        if path.degree is not None and path.degree * timing.degree <= bernstein.HIGHEST:
            degree = max(path.degree * timing.degree - order, 0)
            values = scaled(pieces.at(path, timing, order, bernstein.nodes(degree)))
            worst[name] = _exact(pieces, bernstein.coefficients(values), path.dof)
        else:
            evaluate = _sampling(path, timing, pieces, order, scaled)
            worst[name] = _worst(pieces.start, pieces.span, highest(pieces.span, evaluate, samples), path.dof)
    for check in checks:
        limited.add(check.name)
        worst[check.name] = checked(path, timing, pieces, check)
    return LawCertificate(worst, frozenset(limited))


def _sampling(
    path: Path, timing: Timing, pieces: LawPieces, order: int, scaled: Callable[[Array], Array]
) -> Callable[[Index, int], Array]:
    """Numbers of pieces, and a count -> what is to be at most 1, at count + 1 points of each."""
    return lambda some, count: scaled(pieces.some(some).at(path, timing, order, np.linspace(0.0, 1.0, count + 1)))


def checked(path: Path, timing: Timing, pieces: LawPieces, check: Check) -> Worst:
    """The worst ratio of a quantity that is known by its values, at samples of each piece, more of them at need."""

    def evaluate(some: Index, count: int) -> Array:
        values = check.ratios(*pieces.some(some).states(path, timing, count))
        return values.reshape(len(some), count + 1, -1)

    return _worst(pieces.start, pieces.span, highest(pieces.span, evaluate, SAMPLES), check.columns)


def sampled(start: Array, span: Array, values: Array, joints: int) -> Worst:
    """The highest of samples (pieces x samples x numbers), evenly spaced over each piece, and a bound on what lies
    between; numbers repeat with the joints.
    """
    return _worst(start, span, highest(span, lambda some, count: values, values.shape[1] - 1, rounds=0), joints)


def _worst(start: Array, span: Array, top: Highest, joints: int) -> Worst:
    time = float(start[top.piece] + top.place * span[top.piece])
    return Worst(top.bound, top.column % joints, time, "sampled", top.bound - top.seen, top.spacing)


def _exact(pieces: LawPieces, c: Array, joints: int) -> Worst:
    count, size, columns = c.shape
    tolerance = max(bernstein.CLOSE, bernstein.rounding(size - 1))
    ratio, number, place = bernstein.largest(c.transpose(0, 2, 1).reshape(count * columns, size), tolerance)
    piece, column = divmod(number, columns)
    time = float(pieces.start[piece] + place * pieces.span[piece])
    return Worst(ratio, column % joints, time, "exact")


def _scaled(name: str, limits: MotionLimits, path: Path) -> Callable[[Array], Array] | None:
    """Values of a quantity -> numbers that are at most 1 where its limits are satisfied, both signs side by side."""
    if name != "position":
        limit = getattr(limits, name)
        return None if limit is None else lambda x: np.concatenate([x / limit, -x / limit], axis=-1)
    low, high = limits.lower, limits.upper
    if low is None or high is None or path.space == "poses":
        return None
    both = np.isfinite(low) & np.isfinite(high)
    size = np.maximum(np.where(np.isfinite(low), np.abs(low), 0.0), np.where(np.isfinite(high), np.abs(high), 0.0))
    half = np.where(both, 0.5 * (np.where(both, high, 1.0) - np.where(both, low, -1.0)), np.maximum(size, 1.0))

    def beyond(x: Array) -> Array:
        over = np.where(np.isfinite(high), x - np.where(np.isfinite(high), high, 0.0), -half)
        under = np.where(np.isfinite(low), np.where(np.isfinite(low), low, 0.0) - x, -half)
        return 1.0 + np.concatenate([over / half, under / half], axis=-1)

    return beyond


def _jump(
    path: Path, timing: Timing, pieces: LawPieces, limits: MotionLimits, moving: tuple[bool, bool]
) -> Worst | None:
    """The largest step of the acceleration at a break, its beginning and its end from and to rest included."""
    ends = pieces.at(path, timing, 2, np.array([0.0, 1.0]))
    if limits.acceleration is not None:
        scale: Array | float = limits.acceleration
    else:
        scale = max(float(np.abs(ends).max()), 1e-300)
    steps = np.concatenate([ends[:1, 0], ends[1:, 0] - ends[:-1, 1], -ends[-1:, 1]]) / scale
    size = np.abs(steps)
    size[0] *= not moving[0]
    size[-1] *= not moving[1]
    if not size.size or size.max() <= STEP:
        return None
    place, joint = (int(k) for k in np.unravel_index(int(size.argmax()), size.shape))
    time = pieces.start[place] if place < len(pieces.start) else timing.duration
    return Worst(np.inf, joint, float(time), "unbounded")
