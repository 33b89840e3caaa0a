"""Whether a body can pass among obstacles over a plane at all, whatever its arms do: exhaustively, by boxes of poses.

A box stands for all poses in it: it is open where the body, smaller by as much as any of its points moves from the
middle to the corners of the box, keeps its clearance there. Where no chain of open boxes leads from start to goal, no
motion of the upright body does.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, sqrt

import numpy as np
import pinocchio as pin
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking import PlaneSurface, Structure
from wbc.walking.planner.around import NONE_MET, around

#: Sides of a box along the plane and of its height [m], and of its heading [rad]
SIDE, TURN = 0.04, pi / 36
#: Heights over the plane [m], what a plan may take and a little more; how far the body's middle may be from all holds
LOW, HIGH, BESIDE = 1.09, 1.40, 0.6


@dataclass(frozen=True)
class Passage:
    """What was found.

    Attributes:
        kind: ``impossible``: proven; ``undecided``: the body alone can pass, or this is no plane.
        around: names of the obstacles that close the boxes about those that the start leads to.
    """

    kind: str
    around: tuple[str, ...] = ()


def passage(walker: Walker, structure: Structure, start: Array, goal: Array) -> Passage:
    """Between two poses of the body ``[4, 4]``, upright on a plane at the same height, among obstacles."""
    surface = structure.surface
    if not isinstance(surface, PlaneSurface) or not structure.obstacles:
        return Passage("undecided")
    inverse = surface.pose.inverse()
    first, last = (inverse * pin.SE3(pose) for pose in (start, goal))
    places = structure.positions @ inverse.rotation.T + inverse.translation
    low, high = places.min(axis=0)[:2] - BESIDE, places.max(axis=0)[:2] + BESIDE
    # A body of n arms looks the same when it is turned by one of them
    count = round(2 * pi / len(walker.arms) / TURN)
    axes = [np.arange(low[0], high[0] + SIDE, SIDE), np.arange(low[1], high[1] + SIDE, SIDE)]
    axes += [np.arange(LOW, HIGH + SIDE, SIDE), np.arange(count) * TURN]
    turns = np.array([_turned(first, float(angle)) for angle in axes[3]])
    there, shape = around(walker, structure), tuple(map(len, axes))
    met = np.empty(shape, dtype=np.int64)
    smaller = -(sqrt(3.0) * SIDE / 2 + _radius(walker) * TURN / 2)
    plane = np.stack(np.meshgrid(axes[1], axes[2], axes[3], indexing="ij"), axis=-1).reshape(-1, 3)
    poses = np.repeat(np.eye(4)[None], len(plane), axis=0)
    poses[:, :3, :3] = np.tile(turns, (shape[1] * shape[2], 1, 1))
    poses[:, 1:3, 3] = plane[:, :2]
    for k, x in enumerate(axes[0].tolist()):
        poses[:, 0, 3] = x
        met[k] = there.bodies(surface.pose.homogeneous @ poses, smaller).reshape(shape[1:])
    labels = _labels(met == NONE_MET)
    ends = [_box(axes, first, pose) for pose in (first, last)]
    if labels[ends[0]] and labels[ends[0]] == labels[ends[1]]:
        return Passage("undecided")
    mine = labels == labels[ends[0]] if labels[ends[0]] else np.zeros(shape, dtype=bool)
    beside = np.unique(met[ndimage.binary_dilation(mine) & (met != NONE_MET)] if mine.any() else met[ends[0]])
    return Passage("impossible", tuple(there.names[int(k)] for k in beside))


def _turned(pose: pin.SE3, angle: float) -> Array:
    about = np.array([[cos(angle), -sin(angle), 0.0], [sin(angle), cos(angle), 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(pose.rotation @ about)


def _radius(walker: Walker) -> float:
    """Of the body and its necks about its z axis, with room [m]."""
    data = walker.arm_data
    return float(data.shoulder_radius + max(data.neck_radius, data.body_half_thickness) + 0.03)


def _box(axes: list[Array], first: pin.SE3, pose: pin.SE3) -> tuple[int, ...]:
    """The box that a pose is in."""
    off = first.rotation.T @ pose.rotation
    heading = round(float(np.arctan2(off[1, 0], off[0, 0])) / TURN) % len(axes[3])
    return *(int(np.argmin(np.abs(axis - at))) for axis, at in zip(axes, pose.translation, strict=False)), heading


def _labels(free: np.ndarray) -> np.ndarray:
    """Numbers of connected sets of boxes that share faces, from 1 on; after the last heading comes the first."""
    labels, count = ndimage.label(free)
    one, other = labels[..., -1].ravel(), labels[..., 0].ravel()
    both = (one > 0) & (other > 0)
    graph = coo_array((np.ones(int(both.sum())), (one[both], other[both])), shape=(count + 1, count + 1))
    joined = connected_components(graph, directed=False)[1]
    out = np.where(labels > 0, joined[labels] + 1, 0)
    return np.asarray(out)
