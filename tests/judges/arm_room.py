"""Room about the capsules of arms: beyond radii and clearance."""

from __future__ import annotations

from itertools import combinations
from math import pi

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.geometry import segment_distances
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.holds.structure import Structure

Flags = NDArray[np.bool_]
Ints = NDArray[np.int64]

#: Named points O N S E W H of an arm; links: neck O-N, upper arm S-E, forearm E-W, hand W-H
NECK, UPPER, FOREARM, HAND = (0, 1), (2, 3), (3, 4), (4, 5)
#: The links that move against the body, neck apart
MOVING = (UPPER, FOREARM, HAND)


def room_alone(walker: Walker, points: Array, outside: Array, structure: Structure) -> Array:
    """Least distance of an arm from itself, the body, the other arms' necks and the surface, less what it needs [m].

    A hand that holds is exempt from the surface.

    Args:
        points: named points of arm 1 in the body's frame ``[n, 6, 3]``. outside: the same in the structure's frame.
    """
    data = walker.arm_data
    radii = {
        NECK: data.neck_radius,
        UPPER: data.upper_arm_radius,
        FOREARM: data.forearm_radius,
        HAND: data.hand_radius,
    }
    clearance, thickness = data.clearance, data.body_half_thickness
    out = np.full(len(points), np.inf)
    for one, other in ((NECK, FOREARM), (NECK, HAND), (UPPER, HAND)):
        least = radii[one] + radii[other] + clearance
        gap = segment_distances(*(points[:, k] for k in (*one, *other))) - least
        out = np.minimum(out, gap)
    corners = [np.array(arm.base.translation) for arm in walker.arms]
    sides = [*combinations(corners, 2), (np.zeros(3), np.zeros(3))]
    for link in MOVING:
        ends = points[:, link[0]], points[:, link[1]]
        if link != UPPER:  # too short to come down to the body
            for a, b in sides:
                out = np.minimum(out, segment_distances(*ends, a, b) - radii[link] - thickness - clearance)
        for corner in corners[1:]:
            top = corner + np.array([0.0, 0.0, data.neck_length])
            out = np.minimum(out, segment_distances(*ends, corner, top) - radii[link] - radii[NECK] - clearance)
        if link != HAND:
            seen = outside[:, link[0]], outside[:, link[1]]
            out = np.minimum(out, structure.segment_clearance(*seen) - radii[link] - clearance)
    return out


def clear_between(walker: Walker, points: Array, one: Ints, other: Ints) -> Flags:
    """Whether arm 1 keeps the clearance from the next arm; necks stand apart.

    Args:
        points: named points of arm 1 in the body's frame ``[n, 6, 3]``. one, other: rows of it for the two arms, the
            second at the heading at which arm 1 stands as the next arm does: its points are turned by 120 degrees here.
    """
    data = walker.arm_data
    radii = data.upper_arm_radius, data.forearm_radius, data.hand_radius
    lengths = data.upper_arm_length, data.forearm_length, data.hand_length
    turned = points @ pin.utils.rotate("z", 2 * pi / 3).T
    out = np.ones(len(one), dtype=bool)
    for i, a in enumerate(MOVING):
        for j, b in enumerate(MOVING):
            least = radii[i] + radii[j] + data.clearance
            # Balls about both segments decide most pairs
            middle, its = points[:, a].mean(axis=1), turned[:, b].mean(axis=1)
            square = np.zeros(len(one))
            for axis in range(3):
                square += (middle[:, axis][one] - its[:, axis][other]) ** 2
            near = np.nonzero(out & (square < (least + (lengths[i] + lengths[j]) / 2) ** 2))[0]
            ends = [points[one[near], k] for k in a] + [turned[other[near], k] for k in b]
            out[near] = segment_distances(*ends) >= least
    return out
