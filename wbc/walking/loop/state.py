"""What a walk is made of from tick to tick: hands, swings, ticks and events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from wbc.multibody import pin
from wbc.validation import Array
from wbc.walking.planner.swings.law import Aim, SwingLaw

Hand = Literal["closed", "opening", "open", "closing"]
#: Of joints 4 to 6
Wrist = tuple[float, float, float]
What = Literal["lift", "land", "failed", "vanished", "replanned", "refused"]


#: Pace of a hand after a pause; its accelerations are as the square of it
AFTER_PAUSE = 0.75


class Manual(NamedTuple):
    """A hand that is moved by hand commands and not by the plan: its arm's row, its state, its hold's row or -1."""

    arm: int
    state: Hand
    hold: int


class Axes(NamedTuple):
    """z axis of a hand and its rate [1/s], its x axis and the rate of that; None where the roll does not count."""

    z: Array
    z_rate: Array
    x: Array | None
    x_rate: Array | None


@dataclass(eq=False)
class Swinging:
    """A swinging hand.

    Attributes:
        arm: its row. hold: row of the hold that it goes to. grip: which it is to be.
        law: the aims. clock: time on the law [s]. aim: the one at that time.
        pace: part of full speed. latch: time until the latch is through [s].
        place, axis, x_axis: of the hand one tick before and its z and x axes, for speeds. earlier: z axis two ticks
            before; None: not known.
        x: the x axis that the hand has on its hold; None if it may roll there.
        first_wrist: joints 4 to 6 of a hand that was in the air when it was sent [rad]; None: those of the grip that it
            leaves. wrist: joints 4 to 6 as they are to be now [rad].
        shift: added to what the hand follows on its hold [m].
        counted: it is a move of the plan, not one of an earlier plan, or one that brings a free hand to it.
        came: when it came to its hold, and its place, z axis and x axis then; None: it is not there.
        rests: ticks in which it has been at rest on its hold. steady: so many it has to be before it closes.
        waits: the body stands until the hand has landed.
        pauses: hand and body come to rest where they are, and then it goes on. paused: how often they have.
        part: of full speed that its joints allow while the body goes as it does now.
        dropped: it does not go to its hold any more, but comes to rest on its law.
    """

    arm: int
    hold: int
    grip: int
    law: SwingLaw
    latch: float
    counted: bool = True
    rests: int = 0
    steady: int = 1
    came: tuple[float, tuple[Array, Array, Array]] | None = None
    waits: bool = False
    pauses: bool = False
    paused: int = 0
    part: float = 1.0
    dropped: bool = False
    clock: float = 0.0
    pace: float = 1.0
    state: Hand = "opening"
    tries: int = 0
    place: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.zeros(3))
    earlier: Array | None = None
    x_axis: Array = field(default_factory=lambda: np.zeros(3))
    x: Array | None = None
    shift: Array = field(default_factory=lambda: np.zeros(3))
    first_wrist: Wrist | None = None
    wrist: Wrist = (0.0, 0.0, 0.0)
    aim: Aim = field(init=False)

    def __post_init__(self) -> None:
        self.aim = self.law.at(self.clock)

    @property
    def most(self) -> float:
        """The pace that it may have: a hand that goes on from a pause speeds up, and the body with it, on a law that
        was made for joints near their accelerations, so it leaves them some.
        """
        return min(self.part, AFTER_PAUSE if self.paused else 1.0)

    def open_on(self, dt: float) -> None:
        """The latch of an opening hand goes on for a tick [s]; when it is through, the hand is open."""
        self.latch -= dt
        if self.latch <= 1e-9:
            self.state = "open"


@dataclass(frozen=True, eq=False)
class State:
    """Where a walk begins that does not begin on the holds of its plan.

    Attributes:
        q: configuration. held: row of the arm -> row of the hold. time: [s].
        opening: row of an arm that opens, and of the hold that it leaves; None: none does.
        v: velocity ``[nv]`` that everything has; a walk comes to rest from it first. None: at rest.
    """

    q: Array
    held: Mapping[int, int]
    time: float = 0.0
    opening: tuple[int, int] | None = None
    v: Array | None = None


@dataclass(eq=False, slots=True)
class Tick:
    """What happened in one tick; arrays are the tick's own.

    Attributes:
        time: [s]. path_time: u [s]. q: configuration after it. v: what the controller returned. rates: what the plant
            made of it in this period; a kinematic one the same.
        hands: state of each hand. holds: row of the hold that each hand is at or goes to, -1 for none.
        target: pose that the body was to have: position [m] and quaternion x, y, z, w.
        body_error: its distance from it [m].
        slip: of the worst held hand [m].
        status: of the controller. cost: of the controller's tick [s].
        fixed: the body is declared fixed: fewer hands hold than it needs, and have since the beginning.
    """

    time: float
    path_time: float
    q: Array
    v: Array
    rates: Array
    hands: tuple[Hand, ...]
    holds: tuple[int, ...]
    target: Array
    body_error: float
    slip: float
    status: str
    cost: float
    fixed: bool = False

    @property
    def command(self) -> pin.SE3:
        """:attr:`target` as a pose."""
        return pin.XYZQUATToSE3(self.target)


@dataclass(frozen=True)
class Event:
    """A hand that was lifted, has landed or failed to grasp; holds that vanished; a new plan.

    Attributes:
        time: [s]. what: which of these. arm, hold: names; "" for none. path_time: u [s].
    """

    time: float
    what: What
    arm: str
    hold: str
    path_time: float
