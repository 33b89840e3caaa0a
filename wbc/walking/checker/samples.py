"""Ticks of a log and samples between them, in blocks that fit into memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array
from wbc.walking.checker.holds import rotations
from wbc.walking.log.log import CLOSED, WalkLog

#: Ticks of a block
BLOCK = 400


@dataclass(frozen=True, eq=False)
class Samples:
    """s samples: each tick k and, up to the next, samples at which the joints are interpolated linearly.

    Attributes:
        tick: [s] the tick whose hands and holds count. t: [s] s. q: [s, m] rad.
        starts: where ticks are among the samples; the samples up to the next belong to a tick.
        hold: [s, a] rows of the holds' table. held: [s, a] whether the hand is closed on a hold that is there.
        position, rotation: [s, 3] and [s, 3, 3], the body as logged, interpolated.
    """

    tick: NDArray[np.int64]
    t: Array
    q: Array
    starts: NDArray[np.int64]
    hold: NDArray[np.int64]
    held: NDArray[np.bool_]
    position: Array
    rotation: Array

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def anchor(self) -> NDArray[np.int64]:
        """Place in ``starts`` of every sample's tick, [s]."""
        return np.searchsorted(self.starts, np.arange(len(self)), side="right") - 1


def holding(log: WalkLog) -> NDArray[np.bool_]:
    """[n, a] whether a hand is closed on a hold that is there."""
    return np.asarray((log.hand_state == CLOSED) & log.present(log.hand_hold, log.t[:, None]))


def blocks(log: WalkLog, between: int) -> Iterator[Samples]:
    """The log in blocks, each tick in one of them, with ``between`` samples after every tick but the last."""
    held, count = holding(log), len(log)
    fractions = np.arange(between + 1) / (between + 1)
    for first in range(0, count, BLOCK):
        ticks = np.arange(first, min(first + BLOCK, count))
        tick, part = np.repeat(ticks, between + 1), np.tile(fractions, len(ticks))
        # The last tick has nothing after it
        keep = (tick < count - 1) | (part == 0.0)
        tick, part = tick[keep], part[keep, None]
        after = np.minimum(tick + 1, count - 1)

        pose = log.pose_body_in_structure
        low, high = pose[tick, 3:], pose[after, 3:]
        # q and -q are one rotation: the nearer of the two
        high = np.where((low * high).sum(axis=1, keepdims=True) < 0.0, -high, high)
        yield Samples(
            tick,
            _mixed(log.t[:, None], tick, after, part)[:, 0],
            _mixed(log.q, tick, after, part),
            np.flatnonzero(part[:, 0] == 0.0),
            log.hand_hold[tick],
            held[tick],
            _mixed(pose[:, :3], tick, after, part),
            rotations(low * (1.0 - part) + high * part),
        )


def _mixed(values: Array, low: NDArray[np.int64], high: NDArray[np.int64], part: Array) -> Array:
    return np.asarray(values[low] * (1.0 - part) + values[high] * part)
