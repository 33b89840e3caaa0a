"""A law: position, velocity and acceleration at every time, and a certificate of the limits it satisfies."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import ContinuityError, LawFileError, RangeError, ShapeError, WbcError
from wbc.trajectory.laws import files
from wbc.trajectory.laws.certificate import Check, LawCertificate, all_checks, certify, chain
from wbc.trajectory.laws.limits import MotionLimits
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.paths.path import Index, JoinedPath, Path, Space
from wbc.validation import Array

#: Two laws that follow each other meet within this in position [rad or m] and velocity [per s]
MEETING = 1e-8


class State(NamedTuple):
    """A law at one time, or at m times: ``position, velocity, acceleration = law.at(t)``.

    Attributes:
        position: n (m x n) joint coordinates [rad or m], or a pose 4 x 4 (m x 4 x 4).
        velocity: n (m x n) [per s]; of a pose: linear velocity of its origin and angular velocity, world axes, 6.
        acceleration: their derivative along time [per s^2].
    """

    position: Array
    velocity: Array
    acceleration: Array


class Law:
    """A path and its timing: q(t) = path(s(t)).

        dq/dt = path' ds/dt,        d2q/dt2 = path'' (ds/dt)^2 + path' d2s/dt2

    Before 0 and after ``duration`` the law stands still where it begins and ends.

    Args:
        path: positions over s. timing: s over time.
        limits: what :attr:`certificate` is about; none by default.
        checks: further quantities that it is about (torques, the speed of a frame); they go with the law.
        moving: whether another motion leads to the beginning, and goes on from the end: an acceleration there is then
            no step.

    Raises:
        ShapeError: limits of another number of joints. RangeError: the timing leaves the path.
    """

    def __init__(
        self,
        path: Path,
        timing: Timing,
        limits: MotionLimits | None = None,
        checks: Sequence[Check] = (),
        moving: tuple[bool, bool] = (False, False),
    ) -> None:
        self.path = validation.instance("law.path", path, Path, "a Path")
        self.timing = validation.instance("law.timing", timing, Timing, "a Timing")
        self.checks, self.moving = all_checks(checks), _two_flags("law.moving", moving)
        self.limits = MotionLimits.given(limits, path.dof)
        _check_within(path, timing)

    @property
    def duration(self) -> float:
        """[s]."""
        return self.timing.duration

    @property
    def dof(self) -> int:
        """Numbers of a velocity: n joints, or 6."""
        return self.path.dof

    @property
    def space(self) -> Space:
        """``joints`` or ``poses``."""
        return self.path.space

    def at(self, t: Any) -> State:
        """Position, velocity and acceleration at a time or at an array of times [s].

        Raises:
            ShapeError, NotFiniteError: not numbers, or not finite.
        """
        times = validation.ordinary_array("t", t)
        flat = np.clip(np.atleast_1d(times).ravel(), 0.0, self.duration)
        parts = [self._derivative(flat, order) for order in (0, 1, 2)]
        outside = (np.atleast_1d(times).ravel() < 0.0) | (np.atleast_1d(times).ravel() > self.duration)
        for part in parts[1:]:
            part[outside] = 0.0
        return State(*(part.reshape(*times.shape, *part.shape[1:]) for part in parts))

    def jerk(self, t: Any) -> Array:
        """Derivative of the acceleration, where it has one [per s^3]."""
        times = validation.ordinary_array("t", t)
        flat = np.clip(np.atleast_1d(times).ravel(), 0.0, self.duration)
        return self._derivative(flat, 3).reshape(*times.shape, self.dof)

    def _derivative(self, times: Array, order: int) -> Array:
        piece = self.timing.pieces_at(times)
        s = [self.timing.evaluate(times, k, piece) for k in range(order + 1)]
        s[0] = np.clip(s[0], self.path.knots[0], self.path.knots[-1])
        return chain(self.path, s, self._path_pieces(times, s), order)

    def _path_pieces(self, times: Array, s: list[Array]) -> Index:
        """Pieces of the path: where s stands on a knot, the one that it comes from at the end and goes to before it."""
        pieces = self.path.pieces_at(s[0])
        last = times >= self.duration
        speed = s[1] if len(s) > 1 else self.timing.evaluate(times, 1)
        # At rest, the acceleration says where it goes, or where it came from
        speed = np.where(speed == 0.0, np.where(last, -1.0, 1.0) * self.timing.evaluate(times, 2), speed)
        back = (speed < 0.0) ^ (last & (speed != 0.0))
        return np.where(back, self.path.pieces_before(s[0], pieces), pieces)

    @cached_property
    def certificate(self) -> LawCertificate:
        """How much of :attr:`limits` and of :attr:`checks` the law uses at worst."""
        return certify(self.path, self.timing, self.limits, self.checks, moving=self.moving)

    def with_limits(self, limits: MotionLimits) -> Law:
        """The same law, to be compared with other limits."""
        return Law(self.path, self.timing, limits, self.checks, self.moving)

    def scaled(self, factor: float) -> Law:
        """The same positions in ``factor`` times the time.

        Raises:
            RangeError: not positive.
        """
        factor = validation.scalar("factor", factor, low=0.0, open_low=True)
        return Law(self.path, self.timing.scaled(factor), self.limits, self.checks, self.moving)

    def reversed(self) -> Law:
        """From the end to the beginning."""
        return Law(self.path, self.timing.reversed(), self.limits, self.checks, self.moving[::-1])

    def sliced(self, start: float, end: float) -> Law:
        """The part from one time to a later one, whose time counts from 0.

        Raises:
            RangeError: outside [0, duration], or no time between them.
        """
        timing = self.timing.sliced(start, end)
        moving = (start > 0.0 or self.moving[0], end < self.duration or self.moving[1])
        return Law(self.path, timing, self.limits, self.checks, moving)

    def then(self, other: Law) -> Law:
        """This law, and another from where this one ends, in position and in velocity.

        Raises:
            ShapeError: of another kind. ContinuityError: they do not meet.
        """
        path = JoinedPath(self.path, validation.instance("other", other, Law, "a Law").path)
        here, there = self.at(self.duration), other.at(0.0)
        for name in ("position", "velocity"):
            off = float(np.abs(getattr(here, name) - getattr(there, name)).max())
            if off > MEETING:
                raise ContinuityError(
                    f"law.{name}", off, f"the laws do not meet: they differ in {name} by more than {MEETING}"
                )
        moving = (self.moving[0], other.moving[1])
        return Law(path, self.timing.then(other.timing, path.shift), self.limits, self.checks, moving)

    def save(self, file: str | os.PathLike[str]) -> None:
        """Into a file, from which ``wbc.trajectory.load`` makes the same law; ``checks`` are not stored.

        Raises:
            LawFileError: the file cannot be written, or the path is of a kind that files do not hold.
        """
        files.save(files.Saved(self.path, self.timing, self.limits, self.moving), file)


def load(file: str | os.PathLike[str], checks: Sequence[Check] = ()) -> Law:
    """The law in a file that :meth:`Law.save` wrote: the same numbers, and so the same states and certificate.

    Args:
        checks: further quantities for its certificate, which files do not hold.

    Raises:
        LawFileError: no such file, not of a law, damaged, or of another format.
    """
    checks = all_checks(checks)
    saved = files.read(file)
    try:
        return Law(saved.path, saved.timing, saved.limits, checks, saved.moving)
    except WbcError as error:
        raise LawFileError("file", str(file), f"damaged: {error}") from error


def _two_flags(field: str, value: Any) -> tuple[bool, bool]:
    flags = [validation.flag(field, each) for each in validation.items(field, value, "two flags")]
    if len(flags) != 2:
        raise ShapeError(field, value, "expected two flags")
    return flags[0], flags[1]


def _check_within(path: Path, timing: Timing) -> None:
    """Every piece of a timing stays on one stretch of a path without gaps."""
    starts = path.knots[np.concatenate([[0], path.gaps + 1])]
    ends = path.knots[np.concatenate([path.gaps, [-1]])]
    tolerance = 1e-9 * (1.0 + np.abs(path.knots[[0, -1]]).max())
    low, high = timing.ranges(lambda low, high: _within(starts, ends, tolerance, low, high))
    bad = np.flatnonzero(~_within(starts, ends, tolerance, low, high))
    if bad.size:
        reached = (float(low[bad[0]]), float(high[bad[0]]))
        stretches = " or ".join(f"{a:g} to {b:g}" for a, b in zip(starts, ends, strict=True))
        raise RangeError("law.timing", reached, f"s must stay within the path, {stretches}")


def _within(starts: Array, ends: Array, tolerance: float, low: Array, high: Array) -> NDArray[np.bool_]:
    stretch = np.clip(np.searchsorted(starts, 0.5 * (low + high), side="right") - 1, 0, None)
    return np.asarray((low >= starts[stretch] - tolerance) & (high <= ends[stretch] + tolerance))
