"""How far a driven body may be from where its command has it: lower or higher, aside, tilted."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.validation import Array

#: A displacement changes as fast as this [m/s, rad/s]
SPEEDS = np.array([0.05, 0.05, 0.05, 0.05, 0.05])
#: Parts of a displacement: across and along the body's x and y axes and its z axis [m], and turns about x and y [rad]
PARTS = len(SPEEDS)


def displacement(way: Array, lower: float, aside: float, roll: float, pitch: float) -> Array:
    """A displacement ``[5]`` of a body that goes along ``way`` ``[2]`` in its own x and y axes; any way counts as x if
    it has no length.

    Args:
        lower, aside: [m], aside is to the left of the way seen along z. roll, pitch: about the way and across it [rad].
    """
    length = float(np.linalg.norm(way))
    ahead = way / length if length > 1e-9 else np.array([1.0, 0.0])
    left = np.array([-ahead[1], ahead[0]])
    return np.concatenate([aside * left, [lower], roll * ahead + pitch * left])


def displaced(pose: Array, by: Array) -> Array:
    """A pose ``[4, 4]`` with a displacement in its own axes."""
    out: Array = pose @ _matrix(by) if by.any() else pose
    return out


def undisplaced(pose: Array, by: Array) -> Array:
    """The pose ``[4, 4]`` that has become this one by a displacement."""
    out: Array = pose @ np.linalg.inv(_matrix(by)) if by.any() else pose
    return out


def towards(begin: Array, wanted: Array, count: int, spacing: float) -> Array:
    """Displacements ``[count, 5]`` after each of some steps, from one to another as fast as :data:`SPEEDS`."""
    steps = np.arange(1, count + 1)[:, None] * SPEEDS * spacing
    out: Array = begin + np.clip(wanted - begin, -steps, steps)
    return out


def _matrix(by: Array) -> Array:
    turn = pin.exp3(np.array([by[3], by[4], 0.0]))
    return np.asarray(pin.SE3(turn, by[:3].copy()).homogeneous)
