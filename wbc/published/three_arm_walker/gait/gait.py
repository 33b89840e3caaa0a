"""The free gait: which arm goes where, and when. Units: inch, radian, second; margins in grid units.

Three states of the walker, seen from the cycle:

    all hold     the arm with the least margin may go, if its margin is not above the threshold, to the hold where its
                 margin is largest, if that is larger than now; else nobody goes
    one in air   it tracks its swing; once arrived it grasps, and in the same cycle all hold
    late         more than 1 s overdue: a new hold, with the present velocity, in every cycle until there is one

Two arms always hold. Only the arm with the least margin is looked at; a hold that another arm has may be chosen; where
no hold is found the body goes on all the same. Source: M. R. Patterson's thesis, 5.3.2, 6.1, Fig. 9, listing ARMS.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wbc.published.three_arm_walker.gait.holds import handholds
from wbc.published.three_arm_walker.gait.margin import margins
from wbc.published.three_arm_walker.machine.calibration import Variant, WalkerCalibration
from wbc.published.three_arm_walker.machine.grid import RADIUS, Place, Terrain, frame
from wbc.published.three_arm_walker.machine.motion import RATE, BodyMotion, has_arrived, tracking_command
from wbc.published.three_arm_walker.machine.plant import CycleCommand, WalkerPose
from wbc.published.three_arm_walker.machine.reach import ARMS, Shoulders, View
from wbc.validation import Array

#: How long after its expected end a swing is given up [s]
LATE = 1.0

#: Decimals to which margins [grid units] are compared: ties, common on a symmetric body, go to the first and not to
#: rounding
TIE = 9
#: Radius of the via points [in]
APPROACH = RADIUS + 3.0


def swing_poses(hand: Array, old: Place | None, new: Place) -> list[Array]:
    """The hand's pose, and those that it is to pass; ``old`` is None where it is in the air already."""
    lifted = [] if old is None else [frame(*old, APPROACH)]
    return [hand, *lifted, frame(*new, APPROACH), frame(*new)]


@dataclass(frozen=True)
class Lift:
    """An arm (1 to 3) that leaves a hold for another, or in the air turns to another.

    Attributes:
        time: of the gait [s]. margin_before: None in the air. duration: of the swing [s].
    """

    time: float
    arm: int
    old: Place
    new: Place
    margin_before: float | None
    margin_after: float
    duration: float


@dataclass
class Gait:
    """ARMS, and what the arms are doing.

    Args:
        shoulders, terrain, calibration: what it walks with, and on. threshold: of the margins [grid units].
        margin: as listed, or with the outer circle only as in the text.

    Attributes:
        places: of each arm, held or targeted. supporting: 3. cycle: of :meth:`step`.
        lifts, replans: both of :class:`Lift`. late: times at which a swing was given up [s].
        least: margin, each time that all hold.
        blocked: the joint that kept an ideally tracked hand from its motion. arrived: whether it is at the end.
    """

    shoulders: Shoulders
    terrain: Terrain
    calibration: WalkerCalibration
    threshold: float = 1.0
    margin: Variant = "listing"
    places: list[Place | None] = field(default_factory=lambda: [None] * ARMS)
    supporting: list[bool] = field(default_factory=lambda: [False] * ARMS)
    cycle: int = 0
    lifts: list[Lift] = field(default_factory=list)
    replans: list[Lift] = field(default_factory=list)
    late: list[float] = field(default_factory=list)
    least: list[float] = field(default_factory=list)
    blocked: int | None = None
    arrived: bool = False
    _motion: BodyMotion | None = None
    _since: int = 0

    @property
    def time(self) -> float:
        """TIME [s]."""
        return self.cycle / RATE

    @property
    def in_air(self) -> int | None:
        """The first arm, 0 to 2, that does not hold."""
        return None if all(self.supporting) else self.supporting.index(False)

    def restart(self) -> None:
        """TIME back to 0, and nothing recorded."""
        self.cycle = 0
        for record in (self.lifts, self.replans, self.late, self.least):
            record.clear()

    def step(self, plant: WalkerPose, twist: Array) -> CycleCommand:
        """One cycle, with the body's twist in fixed axes [in/s, rad/s]; the clock is not moved on."""
        arm = self.in_air
        if arm is not None:
            if self._overdue:
                self.late.append(self.time)
                self.plan(arm, plant, twist, None)
                return self.order()
            command = self.track(arm, plant)
            if not self.supporting[arm]:
                return self.order(arm, command)
        if all(self.supporting):
            self._consider(plant, twist)
        return self.order()

    def order(self, arm: int | None = None, command: Array | None = None) -> CycleCommand:
        """What goes to the arms."""
        return CycleCommand(tuple(self.supporting), arm, command)

    def track(self, arm: int, plant: WalkerPose) -> Array:
        """The hand's twist on its way; once it has arrived it holds."""
        if self._motion is None:
            return np.zeros(6)
        elapsed = self.cycle - self._since
        self.blocked = plant.place(arm, self._motion.at(elapsed)[0])
        hand = plant.hands[arm]
        command = tracking_command(self._motion, elapsed, hand)
        # Ideal tracking is exact: a hand that is off its motion is out of reach, however near
        self.arrived = self.blocked is None and has_arrived(self._motion, elapsed, hand, command, self.calibration)
        self.supporting[arm] = self.arrived and self.places[arm] is not None
        return command

    def start(self, arm: int, motion: BodyMotion | None, place: Place | None) -> None:
        """An arm lets go and follows a motion from now on, to a place or to none."""
        self.blocked, self.arrived = None, False
        self._motion, self._since = motion, self.cycle
        self.places[arm], self.supporting[arm] = place, False

    def swing(self, arm: int, plant: WalkerPose, place: Place) -> BodyMotion:
        """The motion from where a hand is to a place."""
        old = self.places[arm] if self.supporting[arm] else None
        return BodyMotion(swing_poses(plant.hands[arm], old, place), self.calibration)

    def plan(self, arm: int, plant: WalkerPose, twist: Array, least: float | None) -> bool:
        """Send an arm to the hold where its margin is largest, if it exceeds ``least``; whether it goes."""
        view = View(self.shoulders, plant.body)
        hand = view.place(plant.hands[arm][:3, 3])
        found = handholds(view, arm, hand, self.terrain, self.places[arm])
        if not len(found):
            return False
        values = margins(view, arm, twist, found, self.margin)
        best = int(np.round(values, TIE).argmax())
        if least is not None and not values[best] > least:
            return False
        new, old = (int(found[best, 0]), int(found[best, 1])), self.places[arm] or (0, 0)
        motion = self.swing(arm, plant, new)
        lift = Lift(self.time, arm + 1, old, new, least, float(values[best]), motion.duration)
        (self.replans if least is None else self.lifts).append(lift)
        self.start(arm, motion, new)
        return True

    def held_margins(self, plant: WalkerPose, twist: Array) -> Array:
        """Margins of the three arms at the places they have [grid units]."""
        view = View(self.shoulders, plant.body)
        places = np.array([place or (0, 0) for place in self.places], dtype=float)
        return margins(view, np.arange(ARMS), twist, places, self.margin)

    def _consider(self, plant: WalkerPose, twist: Array) -> None:
        """All hold: lift, or stay."""
        values = self.held_margins(plant, twist)
        worst = int(np.round(values, TIE).argmin())
        self.least.append(float(values[worst]))
        if values[worst] <= self.threshold:
            self.plan(worst, plant, twist, float(values[worst]))

    @property
    def _overdue(self) -> bool:
        if self._motion is None:
            return False
        return bool((self.cycle - self._since) / RATE - self._motion.duration >= LATE)
