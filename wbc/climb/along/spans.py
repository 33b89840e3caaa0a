"""Over which part of the body's way each limb can hold each foothold, and how."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wbc.climb.along.body_track import BodyTrack
from wbc.climb.chain import library
from wbc.climb.stance import FREE_LIMB
from wbc.climb.world import ClimbWorld
from wbc.validation import Array

#: Way of the body between coarse instants, as a share of the longest limb [1], or turn [rad], at most
COARSE = 0.05
#: Coarse instants are so many instants apart at least
FEWEST = 4
#: Samples of a limb's table from which postures are sought at a foothold
TRIES = 6
#: Part of the time between instants in which joints may use their whole rate [1]
RATES = 0.9


@dataclass(frozen=True, eq=False)
class LimbSpans:
    """Stretches of the body's way over which a limb holds a place with postures that continue each other.

    Attributes:
        place: of each its place, as of :class:`ClimbWorld` ``(n)``.
        first, last: coarse instants between which it lasts ``(n)``.
        angles: at the coarse instants ``(n, coarse, k)``, NaN elsewhere.
    """

    place: NDArray[np.intp]
    first: NDArray[np.intp]
    last: NDArray[np.intp]
    angles: Array


class SpanTable:
    """All spans of a climber in a world along a track.

    Args:
        world: climber and scene. track: way of the body. postures: of a limb at a foothold, at most.

    Attributes:
        coarse: numbers of the coarse instants. limbs: the spans of each.
        begins, ends: of each limb the first and last instants of its spans.
    """

    def __init__(self, world: ClimbWorld, track: BodyTrack, postures: int = 1) -> None:
        self.world, self.track, self._postures = world, track, postures
        self._instant = float(track.instants[1])
        count = len(track.instants)
        ahead, turned = np.abs(track.twists[:, :3]).max(), np.abs(track.twists[:, 3:]).max()
        far = self._instant * max(float(ahead) / world.length, float(turned))
        every = max(FEWEST, int(COARSE / max(far, 1e-9)))
        self.coarse = np.unique(np.append(np.arange(0, count - 1, min(every, count - 1)), count - 1))
        self._fine: dict[tuple[int, int], Array] = {}
        self._near: dict[tuple[int, int], tuple[int, Array]] = {}
        every_one = np.arange(count)
        self._interval = np.searchsorted(self.coarse, every_one, side="right") - 1
        ends = np.minimum(self._interval + 1, len(self.coarse) - 1)
        self._part = (every_one - self.coarse[self._interval]) / np.maximum(
            self.coarse[ends] - self.coarse[self._interval], 1
        )
        self.limbs = [self._spans(limb) for limb in range(len(world.climber.limbs))]
        self.begins = [self.coarse[spans.first] for spans in self.limbs]
        self.ends = [self.coarse[spans.last] for spans in self.limbs]

    @cached_property
    def steps(self) -> list[Array]:
        """Of each limb how far joints may move in an instant [m, rad]."""
        limits, climber = self.world.climber.robot.limits, self.world.climber
        time = RATES * self._instant
        return [time * limits.velocity[climber.joints(limb)] for limb in range(len(climber.limbs))]

    def wanted(self, place: Array, instants: NDArray[np.intp] | slice) -> Array:
        """A pose in the world ``(12)`` in the axes of the body at some instants ``(n, 12)``."""
        rotation, position = self._body
        turn = np.swapaxes(rotation[instants], 1, 2)
        out = np.empty((len(turn), 12))
        out[:, :9] = (turn @ place[:9].reshape(3, 3)).reshape(-1, 9)
        out[:, 9:] = np.einsum("nij,nj->ni", turn, place[9:] - position[instants])
        return out

    def near(self, limb: int, row: int) -> tuple[int, Array]:
        """The first instant of a span, and angles at all its instants ``(n, k)``: cubics through those at the coarse
        ones.
        """
        if (limb, row) not in self._near:
            spans, coarse = self.limbs[limb], self.coarse
            if spans.first[row] == spans.last[row]:
                return int(coarse[spans.first[row]]), spans.angles[row, spans.first[row]][None]
            first, last = int(spans.first[row]), int(spans.last[row])
            angles, at = spans.angles[row, first : last + 1], coarse[first : last + 1]
            slopes = np.gradient(angles, at, axis=0, edge_order=2 if len(at) > 2 else 1)
            inside = slice(int(at[0]), int(at[-1]))
            interval, part = self._interval[inside], self._part[inside, None]
            k, span = interval - first, np.diff(at)[interval - first, None]
            a, b = angles[k], angles[k + 1]
            step = b - a
            u, v = span * slopes[k] - step, step - span * slopes[k + 1]
            some = a + part * step + part * (1.0 - part) * ((1.0 - part) * u + part * v)
            self._near[limb, row] = int(at[0]), np.vstack([some, angles[-1:]])
        return self._near[limb, row]

    def cut(self, limb: int, row: int) -> None:
        """Leave out of a span what :meth:`held` has not, and the shorter part beside it."""
        begin, end = int(self.begins[limb][row]), int(self.ends[limb][row])
        gaps = begin + np.flatnonzero(np.isnan(self.held(limb, row, begin, end)).any(axis=1))
        parts = np.concatenate([[begin - 1], gaps, [end + 1]])
        longest = int(np.argmax(np.diff(parts)))
        self.begins[limb][row], self.ends[limb][row] = parts[longest] + 1, parts[longest + 1] - 1

    @cached_property
    def _body(self) -> tuple[Array, Array]:
        return self.track.places[:, :9].reshape(-1, 3, 3), self.track.places[:, 9:]

    def held(self, limb: int, row: int, first: int, last: int) -> Array:
        """Angles of a span at all instants from one to another ``(n, k)``, from those of :meth:`near` on; NaN where it
        does not last, or joints would jump.
        """
        if (limb, row) not in self._fine:
            begin, near = self.near(limb, row)
            wanted = self.wanted(self.world.places[self.limbs[limb].place[row]], slice(begin, begin + len(near)))
            some, count = np.empty_like(near), np.zeros(len(near), dtype=np.int32)
            library().wbc_postures(
                ctypes.byref(self.world.limbs.numbers[limb]), ctypes.c_long(len(near)), _at(wanted),
                _at(np.ascontiguousarray(near)), 1, _at(some), _at(count),
            )  # fmt: skip
            # Twice the rate: the coarse instants keep it on the mean
            jumps = (np.abs(np.diff(some, axis=0)) > 2.0 * self.steps[limb]).any(axis=1)
            some[(count < 1) | np.append(jumps, False)] = np.nan
            out = np.full((len(self.track.instants), near.shape[1]), np.nan)
            out[begin : begin + len(near)] = some
            self._fine[limb, row] = out
        return self._fine[limb, row][first : last + 1]

    def _spans(self, limb: int) -> LimbSpans:
        world = self.world
        numbers, count = world.limbs.numbers[limb], len(self.coarse)
        k = int(numbers.angles)
        reach = float(numbers.length)
        rotation, position = self._body
        rotation, position = rotation[self.coarse], position[self.coarse]
        root = position + rotation @ world.limbs.root(limb)
        rest = position + rotation @ world.touch[limb, 9:]
        most = self.steps[limb] * float(np.diff(self.coarse).max(initial=1))
        places = np.flatnonzero(world.cone_of[limb] >= 0)
        at = world.places[places][:, 9:]
        near = np.linalg.norm(at[:, None] - root, axis=2) <= reach
        away = np.where(near, np.linalg.norm(at[:, None] - rest, axis=2), np.inf)
        found: list[tuple[int, int, int, Array]] = []
        for place, within, distance in zip(places.tolist(), near, away, strict=True):
            if not within.any():
                continue
            wanted = self.wanted(world.places[place], self.coarse)
            sought = self._sought(limb, place, wanted, int(np.argmin(distance)), most)
            found += [entry for entry in sought if entry[2] > entry[1]]
        angles = np.full((len(found), count, k), np.nan)
        for row, (_, first, last, some) in enumerate(found):
            angles[row, first : last + 1] = some
        columns = np.array([entry[:3] for entry in found], dtype=np.intp).reshape(-1, 3).T
        return LimbSpans(columns[0], columns[1], columns[2], angles)

    def _sought(
        self, limb: int, place: int, wanted: Array, at: int, step: Array, *, start: Array | None = None
    ) -> list[tuple[int, int, int, Array]]:
        """Spans at a place that last over a coarse instant: place, first and last one, and angles between."""
        count, k = len(wanted), int(self.world.limbs.numbers[limb].angles)
        rows = np.empty((self._postures, count, k))
        first, last = np.zeros(self._postures, dtype=np.int32), np.zeros(self._postures, dtype=np.int32)
        many = library().wbc_hold_spans(
            ctypes.byref(self.world.limbs.numbers[limb]), count, _at(wanted), at,
            None if start is None else _at(start), TRIES, self._postures, _at(np.ascontiguousarray(step)), _at(rows),
            _at(first), _at(last),
        )  # fmt: skip
        return [
            self._clear(limb, place, int(first[j]), rows[j, first[j] : last[j] + 1], start is not None)
            for j in range(many)
        ]

    def _clear(self, limb: int, place: int, first: int, angles: Array, begun: bool) -> tuple[int, int, int, Array]:
        """The longest part of a span, or that with which it begins, in which the limb is clear of all but others."""
        some = slice(first, first + len(angles))
        bodies, contact = self.track.places[self.coarse[some]], np.full(len(angles), place, dtype=np.int32)
        marks = self.world.alone(limb, self.world.pieces(limb, angles), bodies, contact, np.zeros(len(angles)))
        marks |= self._trunk[some]
        ends = np.flatnonzero(np.concatenate([[True], marks, [True]]))
        longest = 0 if begun else int(np.argmax(np.diff(ends)))
        low, high = int(ends[longest]), max(int(ends[longest + 1]) - 1, int(ends[longest]) + begun)
        return place, first + low, first + high - 1, angles[low:high].copy()

    @cached_property
    def _trunk(self) -> NDArray[np.bool_]:
        """At which coarse instants the body touches the scene."""
        pieces = self.world.pieces(-1, np.empty((len(self.coarse), 0)))
        none = np.full(len(self.coarse), FREE_LIMB, dtype=np.int32)
        return self.world.alone(-1, pieces, self.track.places[self.coarse], none, np.zeros(len(none)))

    def begun(self, limb: int, place: int, angles: Array) -> int:
        """Adds the span that begins with angles at the first instant; its row."""
        wanted = self.wanted(self.world.places[place], self.coarse)
        step = self.steps[limb] * float(np.diff(self.coarse).max(initial=1))
        found = self._sought(limb, place, wanted, 0, step, start=np.ascontiguousarray(angles))
        if not found:
            return -1
        spans, (_, first, last, some) = self.limbs[limb], found[0]
        row = np.full((1, *spans.angles.shape[1:]), np.nan)
        row[0, first : last + 1] = some
        self.limbs[limb] = LimbSpans(
            np.append(spans.place, place), np.append(spans.first, first), np.append(spans.last, last),
            np.concatenate([spans.angles, row]),
        )  # fmt: skip
        self.begins[limb] = np.append(self.begins[limb], self.coarse[first])
        self.ends[limb] = np.append(self.ends[limb], self.coarse[last])
        return len(spans.place)


def _at(array: NDArray[np.generic]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
