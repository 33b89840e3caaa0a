"""Points that a file lacks, filled in so that bones keep their lengths."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from wbc.retarget.clip import Array, intervals, listed

#: Gaps that are named in a note, the longest first
GAPS_NAMED = 3


def fill_gaps(points: Array, parents: list[int], names: list[str], rate: float) -> tuple[Array, list[str]]:
    """Points without NaN [frames, joints, 3], and what was filled.

    A root is filled along a curve through the frames in which it was seen; any other joint by its offset from its
    parent, of the bone's length, and a joint without a parent beside others by its offset from their middle. Before the
    first and after the last time that it was seen a joint keeps its offset. Joints that were never seen stay NaN.
    """
    lost = np.asarray(~np.isfinite(points).all(axis=2))
    if not lost.any():
        return points, []
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
    return out, [f"filled {len(gaps)} gap{'s' if len(gaps) > 1 else ''}: {listed(said, GAPS_NAMED)}"] if gaps else []


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
