"""Swings in which the hand waits: off its hold to a place that goes with the body, and from there onto the next hold.

A hand whose next hold comes into reach long after it had to leave the last one cannot be on its way all the time: the
body would carry the arm past it. It is drawn in at once, rides with the body, and goes on as late as it can.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.table import Grips, Ints
from wbc.walking.planner.swings.curve import Curves, Pivots, between
from wbc.walking.planner.swings.joints import Wrists, grip_wrists, joint_paths
from wbc.walking.planner.swings.least_time import Speeds, speeds

#: Where hands wait: about the axis of joint 1 from the arm's x axis [rad]. The first that is clear is taken
PARKS = (0.0, radians(40.0), radians(-40.0))
#: How far from that axis, and how far below the arm's base [m]: hands of a body 44 in up are then clear
RADIUS, DEPTH = 20.0 * 0.0254, 36.0 * 0.0254
#: Part of the wrist's way that it has made while the hand waits: with more, a hand turns onto its next axis too early,
#: with less, too late, where it is near the surface
HALFWAY = 0.65
#: It comes down so many times slower than it could, upright when it is near the surface
SLOWLY = 1.5
#: How often a way is made, each time with the body where the last law has it; how long it takes at first [s]
PASSES, GUESS = 4, 1.0


@dataclass(frozen=True, eq=False)
class Asked:
    """Swings of arms between grips, ``[m]`` each, that may move from sample ``begin`` of the body to sample ``end``."""

    arms: Ints
    source: Ints
    target: Ints
    begin: Array
    end: Array


@dataclass(frozen=True, eq=False)
class Half:
    """The ways of m hands from their holds, or onto them, over n points.

    Attributes:
        way: curves. samples: of the body ``[m, n]``. wrists: of joints 4 and 5. law: the least times.
    """

    way: Curves
    samples: Array
    wrists: Wrists
    law: Speeds


@dataclass(frozen=True, eq=False)
class Parked:
    """m swings that wait.

    Attributes:
        away, onto: the two ways.
        samples: of the bodies while the hands ride ``[m, n]``. places: where the hands are then ``[m, n, 3]`` [m].
        angles: of joints 1 to 5 or 6 in all three parts ``[m, 3 n, 5 or 6]`` [rad].
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


def parked(
    walker: Walker, structure: Structure, path: BodyPath, grips: Grips, asked: Asked, park: int, n: int
) -> Parked:
    """Swings that wait at ``PARKS[park]``, at n points of each of their three parts."""
    away, onto = (_half(walker, structure, path, grips, asked, park, n, leaves) for leaves in (True, False))
    first, last = away.samples[:, -1], onto.samples[:, 0]
    samples = first[:, None] + np.linspace(0.0, 1.0, n) * np.maximum(last - first, 0.0)[:, None]
    frames = _frames(walker, path, asked, samples)
    places = frames[..., :3, :3] @ _park(park) + frames[..., :3, 3]
    wrists = grip_wrists(grips, asked.source, asked.target, n, (HALFWAY, HALFWAY))
    kinematics = ArmKinematics(walker.data)  # type: ignore[arg-type]
    angles, possible = joint_paths(kinematics, frames, places, wrists(samples))
    possible &= away.law.possible & onto.law.possible & (first <= last)
    whole = np.concatenate([away.law.angles, angles, onto.law.angles], axis=1)
    return Parked(away, onto, samples, places, whole, possible)


def _half(
    walker: Walker, structure: Structure, path: BodyPath, grips: Grips, asked: Asked, park: int, n: int, leaves: bool
) -> Half:
    """The ways from the holds, or onto them."""
    arms, kinematics = asked.arms, ArmKinematics(walker.data)  # type: ignore[arg-type]
    hold = grips.hold[asked.source if leaves else asked.target]
    wrists = grip_wrists(grips, asked.source, asked.target, n, (0.0, HALFWAY) if leaves else (HALFWAY, 1.0))
    time = np.repeat(np.linspace(0.0, GUESS, n)[None], len(arms), axis=0)
    for _ in range(PASSES):
        since = time if leaves else time - time[:, -1:]
        samples = (asked.begin if leaves else asked.end)[:, None] + since / path.spacing
        air = _frames(walker, path, asked, samples[:, -1 if leaves else 0])
        place, axis = air[:, :3, :3] @ _park(park) + air[:, :3, 3], air[:, :3, 2]
        held = structure.positions[hold], structure.axes[hold]
        ends, axes = ((h, a) if leaves else (a, h) for h, a in zip(held, (place, axis), strict=True))
        first = grips.posture(asked.source, asked.begin.astype(np.int64))[:, 0]
        last = grips.posture(asked.target, asked.end.astype(np.int64))[:, 0]
        turn = PARKS[park] - first if leaves else last - PARKS[park]
        pivots = Pivots(_frames(walker, path, asked, samples.mean(axis=1)), turn)
        free = np.repeat([[not leaves, leaves]], len(arms), axis=0)
        way = between(structure, ends, axes, free, pivots, walker.data)  # type: ignore[arg-type]
        law = speeds(kinematics, walker, arms, path, way, samples, wrists)
        time = law.time if leaves else SLOWLY * law.time
    return Half(way, samples, wrists, law)


def _park(park: int) -> Array:
    """Where a hand waits, in its arm's frame [m]."""
    at = PARKS[park]
    return np.array([RADIUS * cos(at), RADIUS * sin(at), DEPTH])


def _frames(walker: Walker, path: BodyPath, asked: Asked, samples: Array) -> Array:
    """Of the arms' bases at samples of the path ``[m]`` or ``[m, n]``: ``[..., 4, 4]``."""
    bases = np.array([arm.base.homogeneous for arm in walker.arms])[asked.arms]
    out: Array = path.blended(samples) @ (bases if samples.ndim == 1 else bases[:, None])
    return out
