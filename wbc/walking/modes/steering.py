"""Where commanded rates lead a body: round and along the structure, turning; and displacements from there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import CylinderSurface, PlaneSurface

#: A displacement changes as fast as this [m/s, rad/s]
SPEEDS = np.array([0.05, 0.05, 0.05, 0.05, 0.05])
#: and its rate by this [m/s^2, rad/s^2]
EASILY = 0.2
#: Parts of a displacement: across and along the body's x and y axes and its z axis [m], and turns about x and y [rad]
PARTS = len(SPEEDS)
#: Columns of rates: speed of the body's origin round and along [m/s], spin about z into the structure [rad/s], and how
#: fast it comes nearer to the structure [m/s]
ROUND, ALONG, SPIN, NEARER = range(4)
#: Commands take hold as fast as this [m/s^2, m/s^2, rad/s^2]
ACCELERATIONS = np.array([0.25, 0.25, 0.25])


def displacement(direction: Array, lower: float, aside: float, roll: float, pitch: float) -> Array:
    """A displacement ``[5]`` of a body that goes in a direction ``[2]`` of its own x and y axes; one of no length
    counts as x.

    Args:
        lower, aside: [m], aside is to the left of the direction seen along z. roll, pitch: about it, across it [rad].
    """
    length = float(np.linalg.norm(direction))
    ahead = direction / length if length > 1e-9 else np.array([1.0, 0.0])
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


def towards(begin: Array, rate: Array, wanted: Array, spacing: float) -> Array:
    """Displacements ``[n, 5]`` after each of n steps, from one that changes at a rate [m/s, rad/s] to those that are
    wanted ``[n, 5]``, as fast as :data:`SPEEDS` and by accelerations of :data:`EASILY`.
    """
    out, here, now, change = np.empty((len(wanted), PARTS)), begin.copy(), rate.copy(), EASILY * spacing
    for k, aim in enumerate(wanted):
        left = aim - here
        # From so fast it comes to rest in whole steps
        most = np.sqrt((0.5 * change) ** 2 + 2.0 * EASILY * np.abs(left)) - 0.5 * change
        fit = np.sign(left) * np.minimum(most, SPEEDS)
        now += np.clip(fit - now, -change, change)
        here = here + now * spacing
        out[k] = here
    return out


def _matrix(by: Array) -> Array:
    turn = pin.exp3(np.array([by[3], by[4], 0.0]))
    return np.asarray(pin.SE3(turn, by[:3].copy()).homogeneous)


@dataclass(frozen=True, eq=False)
class Steering:
    """Directions of a structure. z goes into it; "along" is a direction of the structure, "round" is z x along.

    On a cylinder "along" is against the z axis of its surface, as A of the published one, and a body goes round its
    axis; over a plane, and where there is no surface, both are straight, and "along" is the x axis of the first pose.

    Attributes:
        axis: "along" ``[3]``. normal: z over a plane ``[3]``. origin: a point of the cylinder's axis, else None.
        height: to which the body returns: distance from the axis, else along ``-normal`` from the structure's
            origin [m].
    """

    axis: Array
    normal: Array
    origin: Array | None
    height: float

    @classmethod
    def on(cls, structure: Structure, pose: pin.SE3) -> Steering:
        """For a body that begins at a pose.

        Raises:
            ShapeError, RotationError: no pose.
        """
        first, surface = validation.pose("pose", pose), structure.surface
        if isinstance(surface, CylinderSurface):
            axis, origin = -surface.pose.rotation[:, 2], surface.pose.translation
            out = cls(axis.copy(), np.zeros(3), origin.copy(), 0.0)
            return cls(out.axis, out.normal, out.origin, out._far(first.translation))
        normal = -surface.pose.rotation[:, 2] if isinstance(surface, PlaneSurface) else first.rotation[:, 2]
        x = first.rotation[:, 0] - normal * float(normal @ first.rotation[:, 0])
        return cls(x / np.linalg.norm(x), normal.copy(), None, -float(normal @ first.translation))

    def ahead(self, pose: Array, rates: Array, spacing: float) -> Array:
        """Poses ``[n, 4, 4]`` that a body at ``pose`` has after each of n steps with rates ``[n, 4]``."""
        steps, out = rates * spacing, np.repeat(np.array(pose)[None], len(rates), axis=0)
        across, along, spin, nearer = np.cumsum(steps, axis=0).T
        # All turns are about the same two lines, one on either side
        out[:, :3, :3] = out[:, :3, :3] @ _turns(np.array([0.0, 0.0, 1.0]), spin)
        out[:, :3, 3] += along[:, None] * self.axis
        if self.origin is None:
            out[:, :3, 3] += across[:, None] * np.cross(self.normal, self.axis) + nearer[:, None] * self.normal
            return out
        off = self._across(np.array(pose)[:3, 3])
        far = float(np.linalg.norm(off)) - np.concatenate([[0.0], nearer])
        turns = _turns(self.axis, np.cumsum(steps[:, ROUND] / far[:-1]))
        out[:, :3, :3] = turns @ out[:, :3, :3]
        out[:, :3, 3] += (far[1:] / far[0])[:, None] * (turns @ off) - off
        return out

    def rates(self, first: Array, second: Array, spacing: float) -> Array:
        """The rates that lead from one pose to the next, ``[4]``; small steps."""
        shift = second[:3, 3] - first[:3, 3]
        along = float(self.axis @ shift)
        if self.origin is None:
            across, turn = float(np.cross(self.normal, self.axis) @ shift), np.eye(3)
        else:
            one, other = self._across(first[:3, 3]), self._across(second[:3, 3])
            angle = float(np.arctan2(self.axis @ np.cross(one, other), one @ other))
            turn, across = pin.exp3(self.axis * angle), angle * float(np.linalg.norm(one))
        spin = float(pin.log3((turn @ first[:3, :3]).T @ second[:3, :3])[2])
        nearer = self.lower(second) - self.lower(first)
        return np.array([across, along, spin, nearer]) / spacing

    def lower(self, pose: Array) -> float:
        """By how much a body is below its height [m]."""
        if self.origin is None:
            return self.height + float(self.normal @ pose[:3, 3])
        return self.height - self._far(pose[:3, 3])

    def ramp(self, begin: Array, command: Array, count: int, spacing: float) -> Array:
        """Rates ``[count, 4]`` from those that a body has, ``[4]``, to commanded ones ``[3]``, by
        :data:`ACCELERATIONS`; the height stays.
        """
        most, out = np.arange(1, count + 1)[:, None] * ACCELERATIONS * spacing, np.zeros((count, 4))
        out[:, :3] = begin[:3] + np.clip(command - begin[:3], -most, most)
        return out

    def _across(self, place: Array) -> Array:
        assert self.origin is not None
        off = place - self.origin
        return np.asarray(off - self.axis * float(self.axis @ off))

    def _far(self, place: Array) -> float:
        return float(np.linalg.norm(self._across(place)))


def _turns(axis: Array, angles: Array) -> Array:
    """Rotations about a unit vector ``[n, 3, 3]``: 1 + sin K + (1 - cos) K^2."""
    k = pin.skew(axis)
    out: Array = np.eye(3) + np.sin(angles)[:, None, None] * k + (1.0 - np.cos(angles))[:, None, None] * (k @ k)
    return out
