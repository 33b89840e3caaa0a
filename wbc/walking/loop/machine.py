"""A walking machine as its control loop sees it: joints that a plant moves, and a body that the held hands place."""

from __future__ import annotations

from collections.abc import Mapping
from math import dist

import numpy as np
from numpy.typing import NDArray

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.simulation import Connection, GripKind, GrippingPlant, LoadedPlant, MovingPlant, Plant, WatchedPlant
from wbc.validation import Array
from wbc.walking.arms.fits import check_fits
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.closed_chain import ClosedChain
from wbc.walking.loop.stack import hold_kind
from wbc.walking.planner.grips.rolls import allowed_x

#: What a body is off where the hands have it, when others hold than before, is taken back in [s]
EASING = 0.2
#: A lag is taken of about the last [s], and where the squares of the joints' commanded accelerations add up to more
#: than this [rad^2/s^4]
REMEMBERED, SEEN = 2.0, 10.0


class Machine:
    """Where the joints are is what the plant reads; where the body is follows from the holds of the closed hands
    (:class:`ClosedChain`), as no sensor of the machine measures it. What a plant says of the body does not count.
    A plant that can grasp (:class:`wbc.simulation.GrippingPlant`) is told which hands close and open.

    Args:
        dt: control period [s]. plant: what moves; None: a :class:`wbc.simulation.KinematicPlant`.

    Attributes:
        q: configuration, the body's pose in the structure. v: last command. rates: of the joints, means over the last
            period, and the body's velocity as the plant has it.
        time: [s]. held: row of the arm -> row of the hold.
        left: row of the arm -> places of the holds that an open hand has left, or was to go to, last, until it is no
            longer near them [m].
        lag: by how much the joints are later than what they are commanded, as far as that shows [s].
        fixed: fewer hands hold than the body needs, and have since the beginning: it is declared fixed.
        structure, chain: the holds that are there, and the hands on them.

    Raises:
        RangeError: the walker's data are not those of its robot. What :class:`wbc.simulation.Connection` raises of a
            plant that does not fit.
    """

    def __init__(self, walker: Walker, structure: Structure, dt: float, plant: Plant | None = None) -> None:
        check_fits(walker)
        self.walker, self.structure, self.dt = walker, structure, dt
        self.chain = ClosedChain(walker, structure, round(EASING / dt))
        self._connection = Connection(plant, walker.robot, dt)
        self._broken: set[int] = set()
        self._grips: GrippingPlant | None = plant if isinstance(plant, GrippingPlant) else None
        self._moving: MovingPlant | None = plant if isinstance(plant, MovingPlant) else None
        self._watched: WatchedPlant | None = plant if isinstance(plant, WatchedPlant) else None
        self._loaded: LoadedPlant | None = plant if isinstance(plant, LoadedPlant) else None
        self.q = np.array(walker.robot.neutral)
        self.v = self.rates = np.zeros(walker.robot.nv)
        self.time, self.fixed = 0.0, False
        self.lag, self._late = 0.0, np.zeros(2)
        self.held: dict[int, int] = {}
        self.left: dict[int, list[Array]] = {}

    def begin(self, q: Array, held: Mapping[int, int], time: float = 0.0, v: Array | None = None) -> None:
        """In a configuration, with some hands closed on holds, and the rates of the last command; None: at rest.

        Raises:
            PlantError: the plant is not there, or has no valid reading. RangeError: as of :class:`ClosedChain`.
        """
        self.held, self.q = dict(held), q.copy()
        if v is not None:
            self.v = v.copy()
        self.fixed = len(self.held) < self.walker.min_holds
        self._place(q[7:])
        state = self._connection.reset(self.q, time)
        if v is not None and self._moving is not None:
            self._moving.move(v)
        self.time = state.time
        if (state.q[7:] != self.q[7:]).any():
            self._place(state.q[7:])
        for arm in self.held:
            self._grasp(arm)

    def move(self, v: Array) -> float:
        """One period with desired rates ``[nv]``; the worst slip of a held hand after it [m].

        Raises:
            PlantError: the plant has no valid reading; it was commanded to rest.
        """
        before, self.v = self.v, v.copy()
        if self.fixed:
            self.v[:6] = 0.0
        state = self._connection.drive(self.v)
        self.rates, self.time = state.v, state.time
        if state.v.tobytes() != self.v.tobytes():
            # It did something else than was commanded: what lasts for a period is its mean
            self.rates[6:] = (state.q[7:] - self.q[7:]) / self.dt
            self._watch(before)
        places = self.chain.origins
        slip = self._place(state.q[7:])
        for arm, left in self.left.items():
            if left:
                self.left[arm] = [hold for hold in left if not self._leaves(hold, places[arm], self.chain.origins[arm])]
        return slip

    def _leaves(self, hold: Array, before: Array, now: Array) -> bool:
        """Whether a hand goes away from a hold that it is not near any more; one that still comes has to stop first.

        Args:
            hold: its place. before, now: places of the hand [m].
        """
        far = dist(now, hold)
        return far > self.walker.arm_data.exempt_distance and far >= dist(before, hold)

    def _watch(self, before: Array) -> None:
        """Of commands u and rates v of all joints the lag is sum (u - v) du / dt over sum (du / dt)^2, of late."""
        change = (self.v[6:] - before[6:]) / self.dt
        self._late *= 1.0 - self.dt / REMEMBERED
        self._late += (self.v[6:] - self.rates[6:]) @ change, change @ change
        if self._late[1] > SEEN:
            self.lag = max(float(self._late[0] / self._late[1]), 0.0)

    def rest(self) -> None:
        """Command rest; time does not go on."""
        self.v = np.zeros(len(self.v))
        self._connection.rest()

    def close(self, arm: int, hold: int) -> None:
        """A hand holds a hold (its row)."""
        self.held[arm] = hold
        self._grasp(arm)
        self.fixed = self.fixed and len(self.held) < self.walker.min_holds

    def may_open(self, arm: int) -> bool:
        """Whether the other hands bear the robot without this one, as far as the plant knows."""
        return self._loaded is None or arm in self._broken or self._loaded.holds_without(self.walker.arms[arm].hand)

    def open(self, arm: int) -> None:
        """A hand holds nothing."""
        if self._grips is not None and arm not in self._broken:
            self._grips.release(self.walker.arms[arm].hand)
        self._broken.discard(arm)
        self.left[arm] = [self.structure.positions[self.held.pop(arm)]]

    def lost(self) -> list[int]:
        """Rows of holds that have broken off under a closed hand; the hand is to be opened."""
        if self._grips is None:
            return []
        names = self._grips.lost()
        arms = [arm for arm in self.held if self.walker.arms[arm].hand in names]
        self._broken.update(arms)
        return [self.held[arm] for arm in arms]

    def failing(self) -> str:
        """What the plant says of itself that has failed; "": nothing."""
        return "" if self._watched is None else self._watched.failing()

    @property
    def lasting(self) -> Array:
        """Rates with which it goes on when commands end ``[nv]``: none where the plant does as it is commanded, those
        of the last period where its bodies have masses.
        """
        return np.zeros(len(self.v)) if self._moving is None else self.rates.copy()

    def hand(self, arm: int) -> tuple[Array, Array, Array]:
        """Origin [m], z axis and x axis of a hand in the structure."""
        return self.chain.origins[arm], self.chain.axes[arm], self.chain.x_axes[arm]

    def renumber(self, rest: Structure, rows: NDArray[np.int64]) -> None:
        """Go on with a structure that has lost holds.

        Args:
            rows: of the present holds in the new structure, -1 for those that are gone; hands hold none of these.
        """
        self.structure, self.chain = rest, self.chain.on(rest)
        self.held = {arm: int(rows[hold]) for arm, hold in self.held.items()}

    def _grasp(self, arm: int) -> None:
        """Say to the plant what a hand holds, and at which of the allowed rolls."""
        if self._grips is None:
            return
        structure, hold, (_, axis, x) = self.structure, self.held[arm], self.hand(arm)
        z = structure.axes[hold]
        if not structure.free_rolls[hold]:
            x = allowed_x(structure, hold, x, axis)
        x = x - (x @ z) * z
        x = x / np.linalg.norm(x)
        pose = pin.SE3(np.column_stack([x, np.cross(z, x), z]), structure.positions[hold])
        self._grips.grasp(self.walker.arms[arm].hand, pose, GripKind(hold_kind(structure, hold)))

    def _place(self, joints: Array) -> float:
        """The joints are there; the body where the hands have it, or where it was if it is fixed."""
        if not self.fixed:
            self.q, slip = self.chain.settle(self.q, self.held, joints)
            return slip
        self.q = np.concatenate([self.q[:7], joints])
        self.chain.place(self.q)
        return self.chain.slip(self.held)
