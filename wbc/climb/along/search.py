"""Which limb goes to which foothold when, while the body goes its way: the compiled search over spans and swings."""

from __future__ import annotations

import ctypes
import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.climb.along.body_track import BodyTrack
from wbc.climb.chain import address_of as _at, library
from wbc.climb.first import cheapest_first
from wbc.climb.motion import MotionOptions
from wbc.climb.scene import size_of
from wbc.climb.world import ClimbWorld
from wbc.validation import Array

#: First stances that are tried at most
STARTS = 300
#: Instants between samples of limbs that hold, as ``native/along.h`` has it
LOOKS = 3
#: Way of the body between samples at which spans are sought, as a share of the longest limb [1], or turn [rad], at most
COARSE = 0.05
#: Part of the time between instants in which joints may use their whole rate [1]
RATES = 0.9
#: Time of a swing at least [s]
LEAST = 0.5
#: Postures of a limb at a foothold
POSTURES = 2
#: A contact rises by this share of the shortest limb's reach
RISE = 1.0 / 20.0
#: Why standings are none, as ``native/along.h`` counts them
WHYS = ("not borne", "too slow", "no swing", "links touch")

#: Said where memory runs out
LACKING = "a search along a way"


@dataclass(frozen=True, eq=False)
class Standing:
    """All limbs hold, from an instant on.

    Attributes:
        limb: that swung before; -1 at the beginning. lift, now: instants at which it lifted and landed.
        places: of all limbs, as of :class:`ClimbWorld`.
    """

    limb: int
    lift: int
    now: int
    places: tuple[int, ...]


class AlongSearch:
    """A beam over standings, swing by swing: by the swings that each limb needs at least were it alone, and by the time
    that is left until limbs have to lift. A limb holds a place over a span of the way, with postures that continue each
    other. On a swing the contact is, at x from 0 to 1, at

        p(x) = p_from + e(x) (p_onto - p_from) + h(x) n(x),   e(x) = 10 x^3 - 15 x^4 + 6 x^5

    with n from one normal to the other and h a height with even accelerations, or at that height over there alone; and
    the angles are those nearest to a polynomial of fifth order from the angles and rates at which one span is left to
    those at which the other is come to. The contact's turn is free on the way.

    Args:
        world: climber and scene. track: way of the body. motion: lift, and shares of the joints' limits, of swings.
        margin: least slack of equilibrium of limbs that hold.
    """

    def __init__(self, world: ClimbWorld, track: BodyTrack, motion: MotionOptions, margin: float) -> None:
        self.world, self.track, self.end = world, track, len(track.instants) - 1
        robot, climber, speeds = world.climber.robot, world.climber, motion.speeds
        joints = [climber.joints(limb) for limb in range(len(climber.limbs))]
        instant = float(track.instants[1])
        ahead, turned = np.abs(track.twists[:, :3]).max(), np.abs(track.twists[:, 3:]).max()
        far = LOOKS * instant * max(float(ahead) / world.length, float(turned))
        every = min(max(1, int(COARSE / max(far, 1e-9))), (self.end - 1) // LOOKS + 1)
        steps = [RATES * instant * robot.limits.velocity[rows] for rows in joints]
        most = [
            part
            for rows in joints
            for part in (
                instant * speeds.share * robot.limits.velocity[rows],
                instant**2 * speeds.acceleration_share * robot.limits.acceleration[rows],
            )
        ]
        self._kept = (
            np.ascontiguousarray(world.touch), np.ascontiguousarray(track.places),
            np.array([motion.lift or RISE * size_of(climber), np.ceil(LEAST / instant), margin]), np.concatenate(steps),
            np.concatenate(most),
        )  # fmt: skip
        self._code = library()
        self._code.wbc_along.restype = ctypes.c_void_p
        rest, body, numbers, step, rates = map(_at, self._kept)
        self._search = ctypes.c_void_p(
            self._code.wbc_along(
                ctypes.byref(world.numbers), rest, self.end, body, every, numbers, step, rates, POSTURES
            )
        )
        if not self._search:
            raise MemoryError(LACKING)

    def __del__(self) -> None:
        if getattr(self, "_search", None):
            self._code.wbc_along_forget(self._search)

    def begun(self, limb: int, place: int, angles: Array) -> int:
        """Adds the span that begins with angles at the first instant; its row, or -1."""
        return _enough(self._code.wbc_along_begun(self._search, limb, place, _at(np.ascontiguousarray(angles))))

    def begin(self, start: tuple[int, ...] | None, width: int) -> None:
        """Begins anew.

        Args:
            start: spans of the limbs at the beginning; None: any. width: standings that are kept of each number of
                swings, at most.
        """
        spans = self.spans
        starts = list(self._starts(spans)) if start is None else [start]
        rows = np.array(starts, dtype=np.int32).reshape(-1, len(self.world.climber.limbs))
        _enough(self._code.wbc_along_begin(self._search, width, len(rows), _at(rows)))

    def run(self, most: int) -> tuple[list[Standing], Array] | None:
        """The standings of the way found, with the angles of all limbs at all instants ``(n, k)``; the next one after
        what was refused; None: there is none, or none within so many standings that are looked at.
        """
        angles = np.empty((self.end + 1, int(self.world.offsets[-1])))
        out = np.empty((self.end + 2, 3 + len(self.world.climber.limbs)), dtype=np.int32)
        count = _enough(self._code.wbc_along_way(self._search, ctypes.c_long(most), _at(angles), _at(out)))
        rows = out[:count].tolist()
        return ([Standing(row[0], row[1], row[2], tuple(row[3:])) for row in rows], angles) if count else None

    def refuse(self, number: int) -> None:
        """The swing that leads to one of the standings of the way found may not be so."""
        self._code.wbc_along_refuse(self._search, number)

    @property
    def furthest(self) -> float:
        """Part of the way to which all limbs could hold."""
        return float(self._told()[0]) / self.end

    @property
    def outcomes(self) -> Counter[str]:
        """What became of standings that are none."""
        return Counter({why: int(count) for why, count in zip(WHYS, self._told()[2:], strict=True) if count})

    @property
    def spans(self) -> NDArray[np.int32]:
        """Of all spans the limb, the place, the first and last instant, and how many swings the limb needs at least
        from there on, were it alone, -1 where it leads nowhere ``(n, 5)``.
        """
        out = np.empty((self._code.wbc_along_spans(self._search, None), 5), dtype=np.int32)
        self._code.wbc_along_spans(self._search, _at(out))
        return out

    def _told(self) -> NDArray[np.int64]:
        out = np.zeros(2 + len(WHYS), dtype=np.int64)
        self._code.wbc_along_told(self._search, _at(out))
        return out

    def _starts(self, spans: NDArray[np.int32]) -> Iterator[tuple[int, ...]]:
        """Spans of all limbs at the beginning, promising ones first."""
        choices = []
        for limb in range(len(self.world.climber.limbs)):
            rows = np.flatnonzero((spans[:, 0] == limb) & (spans[:, 2] == 0) & (spans[:, 4] >= 0))
            worth = spans[rows, 4] - 0.5 * spans[rows, 3] / max(self.end, 1)
            order = np.argsort(worth, kind="stable")
            choices.append([(float(worth[k]), int(rows[k])) for k in order])
        if not all(choices):
            return
        for starts in itertools.islice(cheapest_first(choices), STARTS):
            holds = self.world.hold[spans[starts, 1]].tolist()
            if len(set(holds)) == len(holds):
                yield tuple(starts)


def _enough(code: int) -> int:
    """What a call says unless it lacked memory."""
    if code == -2:
        raise MemoryError(LACKING)
    return code
