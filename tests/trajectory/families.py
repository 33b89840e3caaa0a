"""A judge of laws between two states that evaluates them itself."""

from __future__ import annotations

import numpy as np

from wbc.trajectory import jerk_limited


def judged(family):
    """(laws, excess over the limits as a share, error at the ends and at the joins), a number each for every member.

    Largest sizes of velocity, acceleration and jerk of the cubics, taken at their ends and where they are extreme.
    """
    laws = [jerk_limited(**arguments) for arguments in family]
    count = [law.path.coefficients.shape[1] for law in laws]
    c = np.concatenate([law.path.coefficients for law in laws], axis=1)
    span = np.concatenate([np.diff(law.path.knots) for law in laws])[:, None]
    owner = np.repeat(np.arange(len(laws)), count)
    limit = {k: np.array([a[k] for a in family])[owner] for k in ("velocity", "acceleration", "jerk")}
    first = np.concatenate([[0], np.cumsum(count)])[:-1]
    ends = [c[3] + span * (c[2] + span * (c[1] + span * c[0]))]
    ends += [c[2] + span * (2.0 * c[1] + 3.0 * c[0] * span), 2.0 * c[1] + 6.0 * c[0] * span]
    begins = [c[3], c[2], 2.0 * c[1]]
    with np.errstate(divide="ignore", invalid="ignore"):
        top = np.clip(np.nan_to_num(-c[1] / (3.0 * c[0]), nan=0.0, posinf=0.0, neginf=0.0), 0.0, span)
    speed = np.max([np.abs(c[2] + u * (2.0 * c[1] + 3.0 * c[0] * u)) for u in (0.0 * span, top, span)], axis=0)
    push = np.maximum(np.abs(begins[2]), np.abs(ends[2]))
    used = [speed / limit["velocity"], push / limit["acceleration"], np.abs(6.0 * c[0]) / limit["jerk"]]
    excess = np.maximum.reduceat(np.max(used, axis=(0, 2)), first) - 1.0
    off = np.zeros(len(laws))
    last = first + count - 1
    inner = np.setdiff1d(np.arange(len(owner)), last)
    for suffix, begin, end in zip(("", "_velocity", "_acceleration"), begins, ends, strict=True):
        for name, got in (("start", begin[first]), ("target", end[last])):
            wanted = np.array([a[name + suffix] for a in family])
            off = np.maximum(off, np.abs(got - wanted).max(axis=1))
        np.maximum.at(off, owner[inner], np.abs(end[inner] - begin[inner + 1]).max(axis=1))
    return laws, excess, off
