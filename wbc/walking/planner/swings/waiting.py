"""Swings in which the hand waits: off its hold to a point that moves with the body, and from there onto the next hold.

A hand whose next hold comes into reach long after it had to leave the last one cannot swing all the time: the
body would carry the arm past it. It is drawn in at once, rides with the body, and goes on as late as it can.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from wbc.robots import BodyLimb, Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.table import Grips, Ints
from wbc.walking.planner.swings.curve import Curves, Pivots, between
from wbc.walking.planner.swings.joints import Guide, guide_between
from wbc.walking.planner.swings.least_time import Speeds, speeds

#: Part of the guided joints' change that is made while the hand waits: with more, a hand turns onto its next axis too
#: early, with less, too late, where it is near the surface. It comes down so many times slower than it could, upright
#: when it is near the surface. Of 200 sampled swings over a trench 119 to 127 are possible with 0.5
#: to 0.8 and 1 to 2; what they change is how the hand comes down under feedback
HALFWAY, SLOWLY = 0.65, 1.5
#: How often a curve is made, each time with the body where the last law has it; how long it takes at first [s]
PASSES, GUESS = 4, 1.0


@dataclass(frozen=True, eq=False)
class WaitRequests:
    """Swings of arms between grips, ``[m]`` each, that may move from sample ``begin`` of the body to sample ``end``."""

    arms: Ints
    source: Ints
    target: Ints
    begin: Array
    end: Array


@dataclass(frozen=True, eq=False)
class Half:
    """m hands that go from their holds, or onto them, over n points.

    Attributes:
        curve: of the hands. samples: of the body ``[m, n]``. guide: of the guided joints. law: the least times.
    """

    curve: Curves
    samples: Array
    guide: Guide
    law: Speeds


@dataclass(frozen=True, eq=False)
class Waiting:
    """m swings that wait.

    Attributes:
        away, onto: off the holds, and onto the next ones.
        samples: of the bodies while the hands ride ``[m, n]``. places: positions of the hands then ``[m, n, 3]`` [m].
        angles: of the joints in all three parts ``[m, 3 n, joints]`` [rad].
        possible: within reach and limits, and in time ``[m]``.
    """

    away: Half
    onto: Half
    samples: Array
    places: Array
    angles: Array
    possible: NDArray[np.bool_]

    @property
    def duration(self) -> Array:
        """Without the wait ``[m]`` [s]."""
        out: Array = self.away.law.duration + SLOWLY * self.onto.law.duration
        return out


def waiting(
    walker: Walker, structure: Structure, path: BodyPath, grips: Grips, asked: WaitRequests, place: int, n: int
) -> Waiting:
    """Swings that wait at one of :attr:`wbc.robots.BodyLimb.waiting`, at n points of each of their three parts."""
    limb = limb_of(walker)
    away, onto = (_half(walker, structure, path, grips, asked, place, n, leaves) for leaves in (True, False))
    first, last = away.samples[:, -1], onto.samples[:, 0]
    samples = first[:, None] + np.linspace(0.0, 1.0, n) * np.maximum(last - first, 0.0)[:, None]
    frames = _frames(walker, path, asked, samples)
    places = frames[..., :3, :3] @ _place(limb, place) + frames[..., :3, 3]
    guide = guide_between(limb, grips, asked.source, asked.target, n, (HALFWAY, HALFWAY))
    angles, possible = limb.follow(frames, places, guide(samples), walker.margins)
    possible &= away.law.possible & onto.law.possible & (first <= last)
    whole = np.concatenate([away.law.angles, angles, onto.law.angles], axis=1)
    return Waiting(away, onto, samples, places, whole, possible)


def _half(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    grips: Grips,
    asked: WaitRequests,
    place: int,
    n: int,
    leaves: bool,
) -> Half:
    """From the holds, or onto them."""
    arms, limb = asked.arms, limb_of(walker)
    hold = grips.hold[asked.source if leaves else asked.target]
    parts = (0.0, HALFWAY) if leaves else (HALFWAY, 1.0)
    guide = guide_between(limb, grips, asked.source, asked.target, n, parts)
    time = np.repeat(np.linspace(0.0, GUESS, n)[None], len(arms), axis=0)
    for _ in range(PASSES):
        since = time if leaves else time - time[:, -1:]
        samples = (asked.begin if leaves else asked.end)[:, None] + since / path.spacing
        air = _frames(walker, path, asked, samples[:, -1 if leaves else 0])
        there, axis = air[:, :3, :3] @ _place(limb, place) + air[:, :3, 3], air[:, :3, 2]
        held = structure.positions[hold], structure.axes[hold]
        ends, axes = ((h, a) if leaves else (a, h) for h, a in zip(held, (there, axis), strict=True))
        first = grips.posture(asked.source, asked.begin.astype(np.int64))[:, 0]
        last = grips.posture(asked.target, asked.end.astype(np.int64))[:, 0]
        angle = limb.waiting[place][0]
        turn = angle - first if leaves else last - angle
        pivots = Pivots(_frames(walker, path, asked, samples.mean(axis=1)), turn)
        free = np.repeat([[not leaves, leaves]], len(arms), axis=0)
        curve = between(walker, structure, ends, axes, free, pivots)
        law = speeds(walker, arms, path, curve, samples, guide)
        time = law.time if leaves else SLOWLY * law.time
    return Half(curve, samples, guide, law)


def _place(limb: BodyLimb, place: int) -> Array:
    """Where a hand waits, in its arm's frame [m]."""
    angle, radius, height = limb.waiting[place]
    return np.array([radius * cos(angle), radius * sin(angle), height])


def _frames(walker: Walker, path: BodyPath, asked: WaitRequests, samples: Array) -> Array:
    """Of the arms' bases at samples of the path ``[m]`` or ``[m, n]``: ``[..., 4, 4]``."""
    bases = np.array([arm.base.homogeneous for arm in walker.arms])[asked.arms]
    out: Array = path.blended(samples) @ (bases if samples.ndim == 1 else bases[:, None])
    return out
