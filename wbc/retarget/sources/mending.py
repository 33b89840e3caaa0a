"""Points that a file lacks, filled in so that bones keep their lengths, and names that change places, put right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator
from scipy.optimize import linear_sum_assignment

from wbc.retarget.clip import Array, intervals, listed

#: Points jump where they move further than this from where their motion leads [m]
JUMP = 0.05
#: A swap explains the motion where it leaves at most this share of the jumps
EXPLAINED = 0.35


def fill_gaps(
    points: Array, parents: Sequence[int], names: Sequence[str], rate: float, notes: list[str] | None = None
) -> Array:
    """Points without NaN [frames, joints, 3]; what was filled is noted. Joints that were never seen stay NaN.

    A root is filled along a curve through the frames in which it was seen; any other joint by its offset from its
    parent, of the bone's length, and a joint without a parent beside others by its offset from their middle.
    """
    lost = np.asarray(~np.isfinite(points).all(axis=2))
    if not lost.any():
        return points
    out = np.where(lost[:, :, None], np.nan, points)
    # Of joints that are all seen, or of all as they are along curves of their own
    whole = np.flatnonzero(~lost.any(axis=0)).tolist() or np.flatnonzero(~lost.all(axis=0)).tolist()
    middle = np.mean([between(out[:, joint]) for joint in whole], axis=0)
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
        if not free:
            length = np.nanmedian(np.linalg.norm(step, axis=1))
            filled *= length / np.maximum(np.linalg.norm(filled, axis=1, keepdims=True), 1e-9)
        out[gone, joint] = (base + filled)[gone]
    gaps.sort(reverse=True)
    said = [f"{name} for {count / rate:.3g} s from {start / rate:.2f} s" for count, start, name in gaps]
    if gaps and notes is not None:
        notes.append(f"filled {len(gaps)} gap{'s' if len(gaps) > 1 else ''}: {listed(said)}")
    return out


def between(values: Array) -> Array:
    """Values without NaN, along curves without corners, and constant at the ends [frames, numbers]."""
    good = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(good) < 3:
        return np.stack([np.interp(np.arange(len(values)), good, column[good]) for column in values.T], axis=1)
    inside = np.clip(np.arange(len(values)), good[0], good[-1])
    return np.asarray(Akima1DInterpolator(good, values[good])(inside))


def mend_swaps(points: Array, names: Sequence[str], rate: float, notes: list[str]) -> Array:
    """The points [frames, joints, 3] [m] with their names as they are in most frames; what was mended is noted.

    From one frame to the next the points that jump are given to the places that they are nearest to, where that
    explains the jumps; what most frames call a point is its name.
    """
    count = points.shape[1]
    order: NDArray[np.intp] = np.arange(count)
    orders = np.tile(order, (len(points), 1))
    predicted, before = np.where(np.isfinite(points[0]), points[0], np.inf), points[0].copy()
    for frame in range(1, len(points)):
        now = points[frame, order]
        off = np.linalg.norm(now - predicted, axis=1)
        jumped = np.flatnonzero(np.nan_to_num(off, nan=0.0) > JUMP)
        if len(jumped) > 1 and np.isfinite(predicted[jumped]).all():
            far = np.linalg.norm(predicted[jumped, None] - now[None, jumped], axis=2)
            places, stands = linear_sum_assignment(far)
            moved = places != stands
            if far[places, stands][moved].sum() <= EXPLAINED * off[jumped][moved].sum():
                order[jumped] = order[jumped[stands]]
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
    frames, moved = np.flatnonzero(wrong.any(axis=1)) / rate, np.flatnonzero(wrong.any(axis=0))
    said = listed([names[joint] for joint in moved.tolist()])
    notes.append(f"swapped between {frames[0]:.2f} and {frames[-1]:.2f} s, now mended: {said}")
    return np.take_along_axis(points, orders[:, :, None], axis=1)
