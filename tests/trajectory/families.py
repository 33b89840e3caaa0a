"""Random motions between two states, and a judge that evaluates laws itself."""

from __future__ import annotations

import numpy as np

from wbc.trajectory import jerk_limited

NAMES = ("random", "near rest", "mixed", "speeds only")


def drawn(name, rng, dof=3):
    """Arguments of ``jerk_limited``: ruckig's own random inputs, states 1e-13 to 1e-8 from their target, one joint far
    from its target beside two that are near, and states in their target but for speed and acceleration.
    """
    if name == "random":
        start, target = rng.normal(size=(2, 3, dof)) * np.array([4.0, 0.8, 0.8])[:, None]
        jerk = rng.uniform(0.08, 16.0, dof)
        push = rng.uniform(0.08, 16.0, dof) + np.maximum(np.abs(start[2]), np.abs(target[2]))
        speed = rng.uniform(0.08, 16.0, dof) + np.maximum(np.abs(start[1]), np.abs(target[1]))
        speed += np.maximum(start[2] ** 2, target[2] ** 2) / (2.0 * jerk)
    else:
        size = 10.0 ** rng.uniform(-13.0, -8.0)
        start = rng.normal(size=(3, dof)) * np.array([1.0, 10.0 * size, 100.0 * size])[:, None]
        target = np.zeros((3, dof))
        target[0] = start[0] + (name != "speeds only") * size * rng.normal(size=dof)
        target[0, 0] += (name == "mixed") * rng.normal()
        speed, push, jerk = np.full(dof, 5.0), np.full(dof, 10.0), np.full(dof, 150.0)
    return {
        "start": start[0],
        "start_velocity": start[1],
        "start_acceleration": start[2],
        "target": target[0],
        "target_velocity": target[1],
        "target_acceleration": target[2],
        "velocity": speed,
        "acceleration": push,
        "jerk": jerk,
    }


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
