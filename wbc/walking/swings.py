"""Durations of the swings of one plan: an estimate for many at once, and the least time along the way of each."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.grips import Grips, Ints
from wbc.walking.structure import Structure
from wbc.walking.swing_curve import Curves, curves
from wbc.walking.swing_speed import FASTEST, speeds

#: Points of a way: enough for the search, and for carrying it out
COARSE, FINE = 25, 97
#: Time to settle on the hold before the hand closes, besides the latch twice [s]
SETTLE = 0.2
#: Joints 4 and 5 turn to their posture on the next hold during the swing: at this part of their rates, plus [s]
WRIST_PART, WRIST_TIME = 0.9, 0.25
#: A swing is longer where theta5 changes its sign: near 0 the wrist turns without moving the hand's axis [s]
FLIP_TIME = 0.7
#: Part of a swing in which the wrist turns: the hand's axis counts near both holds
WRIST_SHARE = 0.75


class Asked(Protocol):
    """What of a move its swing depends on."""

    @property
    def arm(self) -> int: ...
    @property
    def source(self) -> int: ...
    @property
    def target(self) -> int: ...
    @property
    def lift(self) -> int: ...
    @property
    def land(self) -> int: ...


class Swings:
    """Durations of swings between grips over one path; what was computed is kept."""

    def __init__(self, walker: Walker, structure: Structure, path: BodyPath, grips: Grips) -> None:
        self.walker, self.structure, self.path, self.grips = walker, structure, path, grips
        self.height = walker.data.lift_height  # type: ignore[union-attr]
        self.free = walker.data.exempt_distance  # type: ignore[union-attr]
        self.extra = 2 * walker.data.latch_time + SETTLE  # type: ignore[union-attr]
        self._rates = np.array(walker.data.joint_rates)  # type: ignore[union-attr]
        self._known: dict[tuple[int, int, int, int, int], float | None] = {}

    def estimate(self, source: int, targets: Ints) -> Array:
        """Times no swing is shorter than, latches and settling included [s]: by way and fastest hand."""
        places, grips = self.structure.positions, self.grips
        way = np.linalg.norm(places[grips.hold[targets]] - places[grips.hold[source]], axis=1) + self.height
        out: Array = way / FASTEST + self.extra
        return out

    def prepare(self, moves: Iterable[Asked]) -> None:
        """Compute the durations of moves together."""
        todo = list({_name(m): m for m in moves if _name(m) not in self._known}.values())
        if todo:
            self._compute(todo)

    def duration(self, move: Asked) -> float | None:
        """Of a swing, latches and settling included [s]; None where it is not possible."""
        if _name(move) not in self._known:
            self.prepare([move])
        return self._known[_name(move)]

    def curve(self, moves: list[Asked]) -> Curves:
        """Ways of the hands of moves."""
        holds = self.grips.hold
        begin, end = (holds[[getattr(m, name) for m in moves]] for name in ("source", "target"))
        return curves(self.structure, begin, end, self.height, self.free)

    def _compute(self, moves: list[Asked]) -> None:
        way, arms = self.curve(moves), np.array([m.arm for m in moves], dtype=np.int64)
        lift, land = (np.array([getattr(m, name) for m in moves], dtype=float) for name in ("lift", "land"))
        part = np.linspace(0.0, 1.0, COARSE)
        for _ in range(2):
            found = speeds(self.walker, arms, self.path, way, lift[:, None] + (land - lift)[:, None] * part)
            # The body moves on for as long as the swing takes, or is stopped before the landing sample
            land = np.minimum(lift + found.duration / self.path.spacing, len(self.path) - 1.0)
        wrist, flips = self._wrist(moves)
        time = np.maximum(found.duration + FLIP_TIME * flips, wrist / WRIST_SHARE) + self.extra
        for move, seconds, possible in zip(moves, time.tolist(), found.possible.tolist(), strict=True):
            self._known[_name(move)] = seconds if possible else None

    def _wrist(self, moves: list[Asked]) -> tuple[Array, NDArray[np.bool_]]:
        """Time that joints 4 and 5 need from one posture to the other [s], and whether theta5 changes its sign."""
        columns = [
            np.array([getattr(m, name) for m in moves], dtype=np.int64) for name in ("source", "lift", "target", "land")
        ]
        source, target = self.grips.posture(columns[0], columns[1]), self.grips.posture(columns[2], columns[3])
        time: Array = (np.abs(source - target) / self._rates)[:, 3:5].max(axis=1) / WRIST_PART + WRIST_TIME
        return time, source[:, 4] * target[:, 4] < 0.0


def _name(move: Asked) -> tuple[int, int, int, int, int]:
    return move.arm, move.source, move.target, move.lift, move.land
