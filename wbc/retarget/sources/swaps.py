"""Markers and joints that change places for some frames, found by the continuity of their motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from wbc.retarget.clip import Array, intervals, listed

#: Points jump where they move further than this from where their motion leads [m]
JUMP = 0.05
#: A swap explains the motion where it leaves at most this share of the jumps
EXPLAINED = 0.35
#: Swaps that are named in a note
SWAPS_NAMED = 4


def mend_swaps(points: Array, names: list[str], rate: float) -> tuple[Array, list[str]]:
    """The points with their names as they are in most frames [frames, joints, 3], and what was mended.

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
        return points, []
    swaps = [
        (start, f"{names[joint]} and {names[other]} from {start / rate:.2f} to {stop / rate:.2f} s")
        for joint in range(count)
        for start, stop in intervals(wrong[:, joint])
        if (other := int(orders[start, joint])) > joint or orders[start, other] != joint
    ]
    said = listed([text for _, text in sorted(swaps)], SWAPS_NAMED, "; ")
    return np.take_along_axis(points, orders[:, :, None], axis=1), [f"swapped, now mended: {said}"]


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
