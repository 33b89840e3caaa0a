"""What the arms of a body reach, in the plane of the grid. Units: inch, radian; distances in the plane in grid units.

The reach of an arm is taken as a circle round its base in the (T, A) plane; its radius is the outward tangential one,
the tightest, of an arm of length 2 ES whose wrist lies on the cylinder of radius 100 + HW:

    C = |(100 + H - NO, R)|,    cos(ra) = ((100 + HW)^2 + C^2 - (2 ES)^2) / (2 C (100 + HW))
    radius = (atan(R / (100 + H - NO)) + ra - asin(R / (100 + HW))) (100 + HW) / 9.25

with R the shoulder radius and H the height of the body. Points are brought into the plane along the body's normal.
Source: M. R. Patterson's thesis, 5.3.1 and the listings EXIST and HDHOLD; TACALC, not listed, is a reconstruction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.errors import RangeError
from wbc.published.three_arm_walker.machine.arm import ES, HW, NO, SN
from wbc.published.three_arm_walker.machine.grid import PITCH, RADIUS, coordinates, rotation
from wbc.validation import Array

ARMS = 3

#: Radius of the wrists of gripping hands [in]
WRISTS = RADIUS + HW

#: Nearest to its base that an arm holds [grid units]
INNER = (SN + 2.0) / PITCH


def reach_radius(shoulder_radius: float, height: float) -> float:
    """Radius of the circle that an arm reaches [grid units].

    Raises:
        RangeError: an arm at this height reaches no hold.
    """
    drop = RADIUS + height - NO
    far = np.hypot(drop, shoulder_radius)
    cosine = (WRISTS**2 + far**2 - (2.0 * ES) ** 2) / (2.0 * far * WRISTS)
    if not abs(cosine) <= 1.0 or shoulder_radius >= WRISTS:
        raise RangeError(
            "height", height, f"no arm with its base {shoulder_radius:g} in off centre reaches a hold [in]"
        )
    angle = np.arctan(shoulder_radius / drop) + np.arccos(cosine) - np.arcsin(shoulder_radius / WRISTS)
    return float(angle * WRISTS / PITCH)


def project(body: Array, points: Array) -> Array:
    """TACALC: (T, A) of points m x 3, moved along the body's z axis onto the cylinder of the wrists.

    A point whose line misses that cylinder is taken at its own angle.
    """
    direction = body[:3, 2]
    a = float(direction[:2] @ direction[:2])
    if a < 1e-9:
        return coordinates(points)
    half = points[:, :2] @ direction[:2]
    root = half**2 - a * (np.einsum("mi,mi->m", points[:, :2], points[:, :2]) - WRISTS**2)
    reach = np.sqrt(np.maximum(root, 0.0))
    roots = np.stack([-half - reach, -half + reach]) / a
    distance = np.where(np.abs(roots[0]) <= np.abs(roots[1]), roots[0], roots[1])
    return coordinates(points + np.where(root < 0.0, 0.0, distance)[:, None] * direction)


@dataclass(frozen=True)
class Shoulders:
    """Three arm bases on a body, at 0, 120 and 240 degrees about its z axis, their x axes pointing outward.

    Attributes:
        radius: R [in]. height: of the body's origin above the cylinder [in].
    """

    radius: float
    height: float

    @cached_property
    def frames(self) -> Array:
        """In the frame of the body, 3 x 4 x 4."""
        out = np.tile(np.eye(4), (ARMS, 1, 1))
        for k in range(ARMS):
            out[k, :3, :3] = rotation(0.0, 0.0, 2.0 * np.pi * k / ARMS)
        out[:, :3, 3] = self.radius * out[:, :3, 0]
        return out

    @cached_property
    def reach(self) -> float:
        """[grid units]."""
        return reach_radius(self.radius, self.height)


class View:
    """A body over the grid.

    Attributes:
        body: 4 x 4. shoulders: of the body.
        offsets, points: of the arm bases from the body's origin and in the fixed frame, 3 x 3 [in].
        bases: (T, A) of the arm bases, 3 x 2. centre: (T, A) of the body.
    """

    def __init__(self, shoulders: Shoulders, body: Array) -> None:
        self.shoulders, self.body = shoulders, body
        self.offsets = shoulders.frames[:, :3, 3] @ body[:3, :3].T
        self.points = self.offsets + body[:3, 3]
        places = project(body, np.vstack([self.points, body[:3, 3]]))
        self.bases, self.centre = places[:ARMS], places[ARMS]

    def place(self, point: Array) -> Array:
        """(T, A) of one point."""
        return np.asarray(project(self.body, point[None])[0])
