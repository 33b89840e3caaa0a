"""Points that a file lacks, filled in so that bones keep their lengths, and names that change places, put right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator
from scipy.optimize import linear_sum_assignment

from wbc.retarget.clip import Array, intervals, listed

#: Gaps that are named in a note, the longest first
GAPS_NAMED = 3
#: Points jump where they move further than this from where their motion leads [m]
JUMP = 0.05
#: A swap explains the motion where it leaves at most this share of the jumps
EXPLAINED = 0.35
#: Swaps that are named in a note
SWAPS_NAMED = 4


def fill_gaps(
    points: Array, parents: Sequence[int], names: Sequence[str], rate: float, notes: list[str] | None = None
) -> Array:
    """Points without NaN [frames, joints, 3]; what was filled is noted.

    A root is filled along a curve through the frames in which it was seen; any other joint by its offset from its
    parent, of the bone's length, and a joint without a parent beside others by its offset from their middle. Before the
    first and after the last time that it was seen a joint keeps its offset. Joints that were never seen stay NaN.
    """
    lost = np.asarray(~np.isfinite(points).all(axis=2))
    if not lost.any():
        return points
    out = np.where(lost[:, :, None], np.nan, points)
    whole = [joint for joint in range(len(names)) if not lost[:, joint].any()]
    middle = out[:, whole].mean(axis=1) if whole else _centre(out)
    gaps: list[tuple[int, int, str]] = []
    for joint, parent in enumerate(parents):
        gone = lost[:, joint]
        if not gone.any() or gone.all():
            continue
        gaps += [(stop - start, start, names[joint]) for start, stop in intervals(gone)]
        free = parent < 0 or lost[:, parent].all()
        base = middle if free else out[:, parent]
        step = out[:, joint] - base
        filled = between(step)
        length = float(np.nanmedian(np.linalg.norm(step, axis=1)))
        size = np.linalg.norm(filled, axis=1, keepdims=True)
        if not free and length > 0.0:
            filled = np.where(size > 1e-9, filled * (length / np.maximum(size, 1e-9)), filled)
        out[gone, joint] = (base + filled)[gone]
    gaps.sort(reverse=True)
    said = [f"{name} for {count / rate:.3g} s from {start / rate:.2f} s" for count, start, name in gaps]
    if gaps and notes is not None:
        notes.append(f"filled {len(gaps)} gap{'s' if len(gaps) > 1 else ''}: {listed(said, GAPS_NAMED)}")
    return out


def _centre(points: Array) -> Array:
    """Middle of the points of each frame, without jumps where one is lost: that of the first frame, moved from frame to
    frame as what is seen in both [frames, 3].
    """
    some = np.flatnonzero(np.isfinite(points[:, :, 0]).any(axis=1))
    own = points[some]
    steps = np.diff(own, axis=0)
    both = np.isfinite(steps[:, :, :1])
    moved = np.where(both, steps, 0.0).sum(axis=1) / np.maximum(both.sum(axis=1), 1)
    middle = np.full((len(points), 3), np.nan)
    middle[some] = np.cumsum(np.concatenate([np.nanmean(own[:1], axis=1), moved]), axis=0)
    return between(middle)


def between(values: Array) -> Array:
    """Values without NaN, along curves without corners, and constant at the ends [frames, 3]."""
    good = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(good) < 3:
        frames = np.arange(len(values))
        return np.stack([np.interp(frames, good, values[good, axis]) for axis in range(3)], axis=1)
    inside = np.clip(np.arange(len(values)), good[0], good[-1])
    return np.asarray(Akima1DInterpolator(good, values[good])(inside))


def mend_swaps(points: Array, names: Sequence[str], rate: float, notes: list[str]) -> Array:
    """The points with their names as they are in most frames [frames, joints, 3]; what was mended is noted.

    From one frame to the next the points that jump are given to the places that they are nearest to, where that
    explains the jumps; what most frames call a point is its name.

    Args:
        points: in metres; NaN where one is lost.
    """
    count = points.shape[1]
    order: NDArray[np.intp] = np.arange(count)
    orders = np.tile(order, (len(points), 1)).astype(np.intp)
    predicted, before = np.where(np.isfinite(points[0]), points[0], np.inf), points[0].copy()
    for frame in range(1, len(points)):
        now = points[frame, order]
        off = np.linalg.norm(now - predicted, axis=1)
        jumped = np.flatnonzero(np.nan_to_num(off, nan=0.0) > JUMP)
        if len(jumped) > 1 and (fresh := _swapped(now, predicted, off, jumped)) is not None:
            order = order.copy()
            order[jumped] = order[jumped[fresh]]
            now = points[frame, order]
        orders[frame] = order
        good = np.isfinite(now[:, 0])
        step = np.where((good & np.isfinite(before[:, 0]))[:, None], now - before, 0.0)
        predicted = np.where(good[:, None], now + step, predicted)
        before = now
    # The name of a point is what it is called in most frames
    most = np.array([np.bincount(orders[:, joint], minlength=count).argmax() for joint in range(count)])
    if len(set(most.tolist())) == count:
        orders = orders[:, np.argsort(most)]
    wrong = orders != np.arange(count)
    if not wrong.any():
        return points
    swaps = [
        (start, f"{names[joint]} and {names[other]} from {start / rate:.2f} to {stop / rate:.2f} s")
        for joint in range(count)
        for start, stop in intervals(wrong[:, joint])
        if (other := int(orders[start, joint])) > joint or orders[start, other] != joint
    ]
    said = listed([text for _, text in sorted(swaps)], SWAPS_NAMED, "; ")
    notes.append(f"swapped, now mended: {said}")
    return np.take_along_axis(points, orders[:, :, None], axis=1)


def _swapped(now: Array, predicted: Array, off: Array, jumped: NDArray[np.intp]) -> NDArray[np.intp] | None:
    """Which of the jumped points stands in the place of each; None where no swap explains the jumps."""
    if not np.isfinite(predicted[jumped, 0]).all():
        return None
    far = np.linalg.norm(predicted[jumped, None] - now[None, jumped], axis=2)
    places, stands = linear_sum_assignment(far)
    moved = places != stands
    if not moved.any() or far[places, stands][moved].sum() > EXPLAINED * off[jumped][moved].sum():
        return None
    return np.asarray(stands)
