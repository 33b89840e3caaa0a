"""Random motions between two states, and what laws do with them, judged from their polynomials alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.trajectory import Law, PolynomialPath
from wbc.validation import Array

#: ruckig's own random inputs; states within 1e-13 to 1e-8 of their target; one joint far from its target beside others
#: that are near; states in their target but for velocity and acceleration
FAMILIES = ("random", "near rest", "one joint far", "speeds only")
DOF = 3


def drawn(name: str, rng: np.random.Generator) -> dict[str, Array]:
    """Arguments of ``jerk_limited`` for 3 joints, every end state being within the limits."""
    if name == "random":
        start, target = rng.normal(size=(2, 3, DOF)) * np.array([4.0, 0.8, 0.8])[:, None]
        speed, push, jerk = rng.uniform(0.08, 16.0, (3, DOF))
        push += np.maximum(np.abs(start[2]), np.abs(target[2]))
        speed += np.maximum(np.abs(start[1]), np.abs(target[1]))
        speed += np.maximum(start[2] ** 2, target[2] ** 2) / (2.0 * jerk)
    else:
        size = 10.0 ** rng.uniform(-13.0, -8.0)
        start = rng.normal(size=(3, DOF)) * np.array([1.0, 10.0 * size, 100.0 * size])[:, None]
        target = np.zeros((3, DOF))
        target[0] = start[0] + (name != "speeds only") * size * rng.normal(size=DOF)
        target[0, 0] += (name == "one joint far") * rng.normal()
        speed, push, jerk = np.full(DOF, 5.0), np.full(DOF, 10.0), np.full(DOF, 150.0)
    names = [end + part for end in ("start", "target") for part in ("", "_velocity", "_acceleration")]
    out = dict(zip(names, np.concatenate([start, target]), strict=True))
    return out | {"velocity": speed, "acceleration": push, "jerk": jerk}


def judged(laws: Sequence[Law], asked: Sequence[dict[str, Array]]) -> tuple[Array, Array]:
    """(excess over a limit as a share, error of a state at an end or at a break) of each law.

    Cubics of time: velocities peak at ends or where the acceleration vanishes, accelerations at ends.
    """
    parts, spans, count = [], [], []
    for law in laws:
        assert isinstance(law.path, PolynomialPath)
        parts.append(law.path.coefficients)
        spans.append(np.diff(law.path.knots))
        count.append(len(spans[-1]))
    # Laws that stand are of degree 0
    c = np.concatenate([np.concatenate([np.zeros((4 - len(p), *p.shape[1:])), p]) for p in parts], axis=1)
    span = np.concatenate(spans)[:, None]
    owner = np.repeat(np.arange(len(laws)), count)
    limit = [np.array([a[k] for a in asked])[owner] for k in ("velocity", "acceleration", "jerk")]
    with np.errstate(divide="ignore", invalid="ignore"):
        top = np.clip(np.nan_to_num(-c[1] / (3.0 * c[0]), nan=0.0, posinf=0.0, neginf=0.0), 0.0, span)
    states = [_at(c, u) for u in (0.0 * span, top, span)]
    shares = [np.abs(6.0 * c[0]) / limit[2]]
    shares += [np.abs(s[1]) / limit[0] for s in states] + [np.abs(s[2]) / limit[1] for s in states]
    last = np.cumsum(count) - 1
    first = last - np.array(count) + 1
    inner = np.setdiff1d(np.arange(len(owner)), last)
    excess, error = np.maximum.reduceat(np.max(shares, axis=(0, 2)), first) - 1.0, np.zeros(len(laws))
    for k, suffix in enumerate(("", "_velocity", "_acceleration")):
        begin, end = states[0][k], states[2][k]
        for name, found in (("start", begin[first]), ("target", end[last])):
            error = np.maximum(error, np.abs(found - np.array([a[name + suffix] for a in asked])).max(axis=1))
        np.maximum.at(error, owner[inner], np.abs(end[inner] - begin[inner + 1]).max(axis=1))
    return excess, error


def misses(laws: Sequence[Law], asked: Sequence[dict[str, Array]]) -> tuple[float, float]:
    """The largest of both over all laws."""
    excess, error = judged(laws, asked)
    return float(excess.max()), float(error.max())


def _at(c: Array, u: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of cubics."""
    position = c[3] + u * (c[2] + u * (c[1] + u * c[0]))
    return position, c[2] + u * (2.0 * c[1] + 3.0 * c[0] * u), 2.0 * c[1] + 6.0 * c[0] * u
