"""Which hand can hold what from where: postures of a limb on holds, for many poses of its base at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.robots import BodyLimb
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.tilt import leaning

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

#: Samples of a path may lie apart so far in the first look for holds in reach [m]
LOOSE = 0.1


@dataclass(frozen=True, eq=False)
class Held:
    """k pairs of a hold and a pose of the base from which a hand on it is within reach, hold by hold, pose by pose.

    Attributes:
        hold, pose: rows ``[k]``. axes: of the hands, in the base ``[k, 3]``. wrists: in the base ``[k, 3]`` [m].
        reach: see :meth:`wbc.robots.BodyLimb.wrist_reach` ``[k]`` [m].
        q: postures ``[k, branches, n]`` [rad]. solved: whether they are some ``[k, branches]``.
        margins: ``[k, branches, limits]`` [rad]; infinite of joint n, which turns the hand about its own axis: it is
            free, or see :mod:`wbc.walking.planner.grips.rolls`.
    """

    hold: Ints
    pose: Ints
    axes: Array
    wrists: Array
    reach: Array
    q: Array
    solved: Flags
    margins: Array

    def within(self, angle: float) -> Flags:
        """Whether postures are some, and so far within all limits [rad] ``[k, branches]``."""
        columns = (self.margins[..., k] > angle for k in range(self.margins.shape[-1]))
        return np.asarray(self.solved & np.logical_and.reduce([*columns]))


def held(
    limb: BodyLimb,
    structure: Structure,
    frames: Array,
    among: Ints,
    *,
    reach: float,
    facing: float,
    lean_for: float | None = None,
) -> Held:
    """Hands on some holds (their rows) from poses of the base in the structure ``[n, 4, 4]``.

    Args:
        reach: that is left at least [m]. facing: least cosine between the approach and the base's z axis.
        lean_for: reach that hands lean for on holds that let them [m]; None: they do not lean.
    """
    # In the arm's frame, hold by hold and pose by pose ``[holds, poses, 3]``
    turn, count, pivot = frames[:, :3, :3], len(frames), limb.pivot
    flat = turn.transpose(1, 0, 2).reshape(3, -1)
    points = (structure.positions[among] @ flat).reshape(-1, count, 3)
    points -= np.einsum("nj,nji->ni", frames[:, :3, 3], turn)
    axes = (structure.axes[among] @ flat).reshape(-1, count, 3)
    x, y, z = (points[..., k] - pivot[k] for k in range(3))
    near = (axes[..., 2] > facing) & (x * x + y * y + z * z < limb.hand_span**2)
    points, axes, (holds, poses) = points[near], axes[near], np.nonzero(near)
    holds = among[holds]
    if lean_for is not None:
        axes = leaning(limb, points, axes, structure.tilts[holds], lean_for)
    wrists = limb.wrist_of(points, axes)
    left = limb.wrist_reach(wrists)
    rows = left > reach
    points, axes, wrists = points[rows], axes[rows], wrists[rows]
    holds, poses, left = holds[rows], poses[rows], left[rows]
    q, solved = _postures(limb, structure, holds, points, axes, turn[poses])
    margins = limb.margins(q)
    margins[..., len(limb.position_limits) - 1] = np.inf
    return Held(holds, poses, axes, wrists, left, q, solved, margins)


def near_holds(limb: BodyLimb, structure: Structure, frames: Array) -> Ints:
    """Rows of the holds that a limb may reach from some poses of its base along a path ``[n, 4, 4]``."""
    # From where the arm begins to move
    pivots = frames[:, :3, 3] + frames[:, :3, :3] @ limb.pivot
    # Samples that are LOOSE apart stand for those between them
    far = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(pivots, axis=0), axis=1))])
    some = np.unique(np.searchsorted(far, np.arange(0.0, far[-1] + LOOSE, LOOSE), side="right") - 1)
    # |p - c|^2 = |p|^2 + (|c|^2 - 2 c p), about a centre, so that nothing is lost to rounding
    centre = pivots.mean(axis=0)
    holds, bases = structure.positions - centre, pivots[some] - centre
    nearest = ((bases**2).sum(axis=1)[:, None] - 2.0 * bases @ holds.T).min(axis=0)
    return np.nonzero((holds**2).sum(axis=1) + nearest < (limb.hand_span + LOOSE) ** 2)[0]


def _postures(
    limb: BodyLimb, structure: Structure, holds: Ints, points: Array, axes: Array, turn: Array
) -> tuple[Array, Flags]:
    """Postures of all branches, and whether they are some; ``turn`` are rotations of the base."""
    free = np.array(structure.free_rolls)[holds]
    if free.all():
        return limb.held(points, axes)
    references = np.einsum("nji,nj->ni", turn, structure.references[holds])
    q, solved = limb.held(points, axes, references)
    q[free, :, -1] = 0.0
    return q, solved
