"""How a limb goes from one foothold to another while the body goes on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.climb.along.spans import SpanTable
from wbc.multibody import pin
from wbc.rotations import exponential
from wbc.validation import Array

#: Part of a swing in which a contact comes to its height [1]
RISING = 0.4
#: Part of a swing in which it goes down from there [1]
SINKING = 0.6
#: Time of a swing at least [s]
LEAST = 0.5
#: Steps in which a contact is lifted to find how joints lift it
STEPS = 5
#: How much higher than over its footholds a contact is half-way, as a share of its way
ARCH = 0.04
#: Instants that a step of these may take, as joints' rates go
STEP_ROOM = 40.0


@dataclass(frozen=True)
class SwingLimits:
    """What swings keep.

    Attributes:
        height: of contacts over what they leave and land on [m].
        rate: share of the joints' velocities. acceleration: share of their accelerations.
    """

    height: float
    rate: float
    acceleration: float


class Swings:
    """Swings of a climber along a track. At x from 0 to 1 the angles are

        q(x) + a b(x) + c b(1 - x)

    with q of fifth order from the angles and rates at which one span is left to those at which the other is come to,
    a and c what lifts the contact there along its normal, and b a bump with even accelerations.

    Args:
        table: spans of its limbs. limits: of the swings.
    """

    def __init__(self, table: SpanTable, limits: SwingLimits) -> None:
        self.table, self.limits = table, limits
        robot, climber = table.world.climber.robot, table.world.climber
        joints = [climber.joints(limb) for limb in range(len(climber.limbs))]
        self._rates = [limits.rate * robot.limits.velocity[rows] for rows in joints]
        self._pulls = [limits.acceleration * robot.limits.acceleration[rows] for rows in joints]
        self._instant = float(table.track.instants[1])
        self._known: dict[tuple[int, tuple[int, int], int, int, bool], Array | None] = {}
        self._lifts: dict[tuple[int, int, int], Array | None] = {}
        #: Joints turn about so far as a contact is lifted: by the height over a quarter of the limb
        self._lifted = [4.0 * limits.height / float(row.length) for row in table.world.limbs.numbers]

    def shortest(self, limb: int, moved: Array) -> Array:
        """About how long swings take whose joints move so far ``(n, k)`` [instants]."""
        size = np.abs(moved)
        even = (1.875 * size / self._rates[limb]).max(axis=-1)
        quick = np.sqrt((5.0 * size + 4.0 / RISING**2 * self._lifted[limb]) / self._pulls[limb]).max(axis=-1)
        return np.asarray(np.maximum(np.maximum(even, quick), LEAST) / self._instant)

    def swung(self, limb: int, rows: tuple[int, int], lift: int, land: int, straight: bool) -> Array | None:
        """Angles at the instants from lift to land ``(n, k)``; None where the limb cannot lift or land so.

        Args:
            rows: of the spans that it leaves and comes to. straight: whether its contact goes straight over, or its
                joints go evenly.
        """
        key = limb, rows, lift, land, straight
        if key not in self._known:
            some = (self._straight if straight else self._even)(limb, rows, lift, land)
            self._known[key] = some if some is not None and np.isfinite(some).all() else None
        return self._known[key]

    def _straight(self, limb: int, rows: tuple[int, int], lift: int, land: int) -> Array | None:
        table, count = self.table, land - lift
        first, last = (table.world.places[table.limbs[limb].place[row]] for row in rows)
        x = np.linspace(0.0, 1.0, count + 1)
        even = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        a, b = first[[2, 5, 8]], last[[2, 5, 8]]
        turn = np.cross(a, b)
        sine = float(np.linalg.norm(turn))
        turn *= np.arctan2(sine, a @ b) / max(sine, 1e-9)
        far = float(np.linalg.norm(last[9:] - first[9:]))
        over = self.limits.height + ARCH * far
        lifted = np.minimum(_rise(x / RISING), _rise((1.0 - x) / RISING))
        way = np.empty((count + 1, 12))
        turns = exponential(even[:, None] * turn)
        way[:, :9] = (turns @ first[:9].reshape(3, 3)).reshape(-1, 9)
        way[:, 9:] = first[9:] + even[:, None] * (last[9:] - first[9:]) + over * lifted[:, None] * way[:, [2, 5, 8]]
        bodies = table.track.places[lift : land + 1]
        rotation = np.swapaxes(bodies[:, :9].reshape(-1, 3, 3), 1, 2)
        way[:, :9] = (rotation @ way[:, :9].reshape(-1, 3, 3)).reshape(-1, 9)
        way[:, 9:] = np.einsum("nij,nj->ni", rotation, way[:, 9:] - bodies[:, 9:])
        begin, end = table.held(limb, rows[0], lift, lift)[0], table.held(limb, rows[1], land, land)[0]
        out = table.followed(limb, way, begin, 4.0)
        if out is None:
            return None
        # What is free in the pose may have come to another posture
        left = end - out[-1]
        out = out + even[:, None] * left
        moved = table.world.limbs.touch(limb, out[count // 2][None])[0] - way[count // 2]
        if np.abs(moved[9:]).max() > 0.3 * self.limits.height or self._beyond(limb, out):
            return None
        out[0], out[-1] = begin, end
        return np.asarray(out)

    def _beyond(self, limb: int, angles: Array) -> bool:
        lower, upper = self.table.world.limbs.lower[limb], self.table.world.limbs.upper[limb]
        return bool((angles < lower).any() or (angles > upper).any())

    def _even(self, limb: int, rows: tuple[int, int], lift: int, land: int) -> Array | None:
        count = land - lift
        raised, lowered = self._lift(limb, rows[0], lift), self._lift(limb, rows[1], land)
        if raised is None or lowered is None:
            return None
        begin, end = self._ended(limb, rows[0], lift, -1), self._ended(limb, rows[1], land, 1)
        x = np.linspace(0.0, 1.0, count + 1)[:, None]
        first, last = (begin[1] - begin[0]) * count, (end[1] - end[0]) * count
        a, b = begin[1], end[0]
        even = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        early = x - 6.0 * x**3 + 8.0 * x**4 - 3.0 * x**5
        late = -4.0 * x**3 + 7.0 * x**4 - 3.0 * x**5
        out = a + (b - a) * even + first * early + last * late + raised * _bump(x) + lowered * _bump(1.0 - x)
        out += self._over(limb, rows, lift, out) * 16.0 * (x * (1.0 - x)) ** 2
        out[0], out[-1] = a, b
        return None if self._beyond(limb, out) else out

    def _over(self, limb: int, rows: tuple[int, int], lift: int, angles: Array) -> Array:
        """What brings the contact over the middle of its way, half-way ``(k)``; 0 where that is not found."""
        table = self.table
        middle = len(angles) // 2
        first, last = (table.world.places[table.limbs[limb].place[row]] for row in rows)
        normal = first[[2, 5, 8]] + last[[2, 5, 8]]
        far, long = float(np.linalg.norm(first[9:] - last[9:])), float(np.linalg.norm(normal))
        if long < 1e-6:
            return np.zeros(angles.shape[1])
        instant = lift + middle
        body = table.track.places[instant]
        rotation = body[:9].reshape(3, 3)
        normal = rotation.T @ normal / long
        goal = rotation.T @ (0.5 * (first[9:] + last[9:]) - body[9:]) + (self.limits.height + ARCH * far) * normal
        now = table.world.limbs.touch(limb, angles[middle][None])[0]
        # The contact's axis goes to the normal the shortest way
        axis = now[[2, 5, 8]]
        turn = np.cross(axis, normal)
        sine = float(np.linalg.norm(turn))
        turn *= np.arctan2(sine, axis @ normal) / max(sine, 1e-9)
        # Over the middle of its way, or where that is too near to the body over where it is
        over = now[9:] + ((goal - now[9:]) @ normal) * normal
        for place in (goal, over):
            x = np.linspace(0.0, 1.0, STEPS + 1)[:, None]
            way = np.empty((STEPS + 1, 12))
            way[:, 9:] = (1.0 - x) * now[9:] + x * place
            for row, part in zip(way, x[:, 0], strict=True):
                row[:9] = (pin.exp3(part * turn) @ now[:9].reshape(3, 3)).ravel()
            some = table.followed(limb, way, angles[middle], STEP_ROOM)
            if some is not None:
                return np.asarray(some[-1] - angles[middle])
        return np.zeros(angles.shape[1])

    def used(self, limb: int, angles: Array) -> float:
        """How many times longer a swing has to be for the limits of its joints, about."""
        rates = np.abs(np.diff(angles, axis=0)) / self._instant / self._rates[limb]
        pulls = np.abs(np.diff(angles, 2, axis=0)) / self._instant**2 / self._pulls[limb]
        return float(max(rates.max(initial=0.0), np.sqrt(pulls.max(initial=0.0))))

    def _ended(self, limb: int, row: int, instant: int, way: int) -> Array:
        """Angles of a span at an instant and at the one before it or after it ``(2, k)``, in the order of time."""
        first, last = (max(instant - 1, 0), instant) if way < 0 else (instant, instant + 1)
        some = self.table.held(limb, row, first, last)
        return some if len(some) == 2 else np.repeat(some, 2, axis=0)

    def _lift(self, limb: int, row: int, instant: int) -> Array | None:
        """What a contact's lift adds to the angles ``(k)``."""
        key = limb, row, instant
        if key not in self._lifts:
            table = self.table
            angles = table.held(limb, row, instant, instant)[0]
            place = table.world.places[table.limbs[limb].place[row]]
            wanted = np.tile(table.wanted(place, np.array([instant])), (STEPS + 1, 1))
            rise = np.linspace(0.0, self.limits.height, STEPS + 1)
            wanted[:, 9:] += rise[:, None] * wanted[:, [2, 5, 8]]
            some = table.followed(limb, wanted, angles, STEP_ROOM)
            self._lifts[key] = None if some is None else some[-1] - angles
        return self._lifts[key]


def _bump(x: Array) -> Array:
    """From 0 to 1 and back, with even accelerations; 1 at ``RISING``."""
    return np.asarray(_rise(x / RISING) * (1.0 - _rise((x - RISING) / SINKING)))


def _rise(x: Array) -> Array:
    x = np.clip(x, 0.0, 1.0)
    return np.where(x < 0.5, 2.0 * x**2, 1.0 - 2.0 * (1.0 - x) ** 2)
