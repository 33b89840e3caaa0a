"""Which printed norms the published runs do not match, and why."""

from __future__ import annotations

import math

import numpy as np

from wbc.published.ikor import CourseRun, printed

#: A printed norm is matched within so much; the noise floor of the print is 2e-4
NEAR = 1e-3


def unmatched(run: CourseRun, trajectory: str, config: str) -> list[tuple[int, float, float, float, str]]:
    """Printed norms that are off by more than :data:`NEAR`: step, printed, measured, ln(measured / printed), and why.

    ``misread``: both rows beside it match, which no motion would do, as feedback shows a step on. ``given back``: with
    those beside them such rows add up to nothing, as if targets were off a little and the feedback took it back; the
    report says nothing of it. ``numbered n on``: after n rows that are lost it matches n steps earlier.
    ``unexplained``: all else.
    """
    found = printed()[trajectory, config]
    steps = found.steps.astype(int)
    off = np.log(run.norms[steps - 1] / found.fsp)
    far, out = np.abs(off) > NEAR, list[tuple[int, float, float, float, str]]()
    for k in np.flatnonzero(far):
        first, last = k, k
        while first > 0 and far[first - 1]:
            first -= 1
        while last + 1 < len(far) and far[last + 1]:
            last += 1
        lost = int(steps[first] - steps[first - 1]) - 1 if first else 0
        earlier = abs(math.log(run.norms[steps[k] - 1 - lost] / found.fsp[k]))
        why = "unexplained"
        if first == last:
            why = "misread"
        elif abs(np.nansum(off[max(first - 1, 0) : last + 2])) < NEAR:
            why = "given back"
        elif lost and earlier < NEAR:
            why = f"numbered {lost} on"
        out.append((int(steps[k]), float(found.fsp[k]), float(run.norms[steps[k] - 1]), float(off[k]), why))
    return out
