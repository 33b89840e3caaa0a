"""The stack of a walking body: held hands exactly, the body's pose, the swinging hand, wrists and joint limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from wbc import tasks
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.controller.handle import InputGroup
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robots import Walker, WalkerArm
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.curvature import Curvature
from wbc.walking.loop.state import Axes
from wbc.walking.planner.grips.rolls import ANY, frame_on
from wbc.walking.planner.grips.tilt import LEAST_TILT, TILT_PART

HoldKind = Literal["pose", "position", "axis", "roll"]
#: Kind of ``tasks.Hold`` by (hand may roll, hand may tilt)
KINDS: dict[tuple[bool, bool], HoldKind] = {
    (True, False): "axis",
    (False, False): "pose",
    (True, True): "position",
    (False, True): "roll",
}
#: Where the position is in the numbers of a pose: behind the rotation
PLACE = slice(9, 12)
#: Gain of holds [1/s] is 1 / (HOLD_TICKS dt)
HOLD_TICKS = 5
#: A hand that rolls into its hold: weight, gain [1/s]
ROLL, ROLL_GAIN = 3.0, 12.0


def hold_kind(structure: Structure, hold: int) -> HoldKind:
    """How a hold (its row) is held: the kind of ``tasks.Hold``."""
    return KINDS[structure.free_rolls[hold], bool(structure.tilts[hold] >= LEAST_TILT)]


@dataclass(frozen=True)
class LedHold(tasks.Hold):
    """A hold whose target leads by what rates take it off within a period, see :class:`Curvature`: the tick does not
    make up for that a second time.
    """

    #: Made here, so it is not in the table of items
    abstract: ClassVar[bool] = True

    def residual(self, *_: Any) -> None:
        """None, see the class."""
        return None


class HoldItems:
    """For each arm one ``Hold`` of every kind that a structure needs, an ``AxisCone`` where hands may tilt, and an
    ``AxisAlign`` of the x axis that turns an open hand to a roll.

    Args:
        stack: to which they are added, before it is compiled.
    """

    def __init__(self, stack: Stack, walker: Walker, structure: Structure, dt: float) -> None:
        self._names, self.gain = [arm.name for arm in walker.arms], 1.0 / (HOLD_TICKS * dt)
        # Where closed hands hold [m], and that place in the stack
        self._at: dict[int, tuple[InputGroup, Array]] = {}
        self.kinds = sorted({hold_kind(structure, k) for k in range(len(structure))})
        self._tilts = bool({"position", "roll"} & set(self.kinds))
        self._rolls = bool({"pose", "roll"} & set(self.kinds))
        for arm in walker.arms:
            for kind in self.kinds:
                item = LedHold(arm.hand, kind=kind, gain=self.gain)
                stack.add(item, name=f"{arm.name} hold {kind}")
            if self._tilts:
                stack.add(tasks.AxisCone(arm.hand, half_angle=1.0), name=f"{arm.name} tilt")
            if self._rolls:
                stack.add(tasks.AxisAlign(arm.hand, axis=(1.0, 0.0, 0.0)), name=f"{arm.name} x axis", weight=ROLL)

    def of(self, controller: Controller) -> None:
        """Take the items of the compiled stack; nothing holds."""
        items: Any = controller
        self._holds = [{kind: items[f"{name} hold {kind}"] for kind in self.kinds} for name in self._names]
        self._cones = [items[f"{name} tilt"] for name in self._names] if self._tilts else []
        self._turned = [items[f"{name} x axis"] for name in self._names] if self._rolls else []
        self.gains = [(turned, ROLL_GAIN) for turned in self._turned]
        self.gains += [(hold, self.gain) for kinds in self._holds for hold in kinds.values()]
        self._targets = [
            {kind: InputGroup(core_of(controller), [(f"{name} hold {kind}", "target", PLACE)]) for kind in self.kinds}
            for name in self._names
        ]
        for arm in range(len(self._names)):
            self.release(arm)

    def hold(self, arm: int, structure: Structure, hold: int, roll: int) -> bool:
        """A hand closes on a hold (its row) at one of its rolls (its number); whether the hand may tilt.

        Raises:
            RangeError: a hold of a kind that the stack was not compiled for.
        """
        kind = hold_kind(structure, hold)
        if kind not in self.kinds:
            name, known = structure.ids[hold], ", ".join(self.kinds)
            raise RangeError(f"hold {name}", kind, f"the stack was compiled for holds of the kinds {known}")
        self.release(arm)
        item, tilts = self._holds[arm][kind], kind in ("position", "roll")
        frame = frame_on(structure, hold, roll)
        item.enabled, item.target = True, pin.SE3(frame)
        self._at[arm] = self._targets[arm][kind], frame[:3, 3]
        if tilts:
            cone = self._cones[arm]
            cone.enabled, cone.direction = True, structure.axes[hold]
            cone.half_angle = TILT_PART * structure.tilts[hold]
        return tilts

    def lead(self, arm: int, ahead: Array) -> None:
        """The target of a closed hand is ahead of its hold by so much [m]."""
        target, place = self._at[arm]
        target.write(place + ahead)

    def follow(self, arm: int, gain: float) -> None:
        """What a closed hand is off its hold is taken back with a gain [1/s]."""
        for item in self._holds[arm].values():
            item.gain = gain

    def release(self, arm: int) -> None:
        """A hand opens."""
        for item in self._holds[arm].values():
            item.enabled = False
        if self._cones:
            self._cones[arm].enabled = False
        self.turn(arm, None)

    def turn(self, arm: int, x: Array | None, rate: Array | None = None) -> None:
        """An open hand turns its x axis to a direction in the structure, which changes at a rate [1/s]; None: its roll
        does not count.
        """
        if not self._turned:
            return
        item = self._turned[arm]
        item.enabled = x is not None
        if x is not None:
            item.target, item.feedforward = x, np.zeros(3) if rate is None else rate


#: Control period [s]
DT = 0.01
#: Weights: the body comes before a swing, a swing before postures
BODY, SWING, AXIS, WRIST, UPRIGHT = 1e4, 10.0, 3.0, 1e-3, 100.0
#: Gains [1/s] of body, swinging hand, its axis and the wrists
BODY_GAIN, SWING_GAIN, AXIS_GAIN, WRIST_GAIN = 12.0, 25.0, 20.0, 12.0
#: What a hand is off its hold as it closes, and how it leans in it, is taken back by gains that grow within this time
#: [s]. All of it at once asks for more than the joints' accelerations, or moves a body whose hands are nearly on one
#: line by many times as much
RISING = 0.3
#: On joints that lag by T no gain is greater than this over T: an error then falls with hardly any overshoot, as from
#: 1/4 on it begins to swing
CRITICAL = 0.4
#: Until then the wrist follows its postures; near the next hold its axis counts
FREE_AXIS, FREE_WRIST, RESTING = 1e-6, 40.0, 0.1


class WalkStack:
    """A compiled stack with items for each arm that holds and for each that swings; the state of the hand switches.

    Args:
        collisions: keep the links clear of each other (compiles longer and costs time in every tick).
        backend: as of ``Stack.compile``.
    """

    def __init__(
        self, walker: Walker, structure: Structure, dt: float = DT, *, collisions: bool = True, backend: str = "auto"
    ) -> None:
        self.walker, self.structure, self.dt = walker, structure, dt
        stack = Stack(walker.robot, dt=dt, calm=False)
        stack.add(tasks.EndEffector("body"), name="body", weight=BODY)
        self._holds = HoldItems(stack, walker, structure, dt)
        for arm in walker.arms:
            stack.add(tasks.EndEffector(arm.hand, kind="position"), name=f"{arm.name} swing", weight=SWING)
            stack.add(tasks.AxisAlign(arm.hand), name=f"{arm.name} axis", weight=AXIS)
        stack.add(tasks.Posture(), name="posture", weight=WRIST)
        stack.add(tasks.JointLimits(), name="limits")
        if collisions:
            stack.add(tasks.SelfCollision(margin=walker.arm_data.clearance), name="links")
        self.stack = stack
        self.controller: Controller = stack.compile(backend=backend)
        self._posture = np.array(walker.robot.neutral)
        self._mask = np.full(walker.robot.nv - 6, RESTING)
        self._turning = np.zeros(walker.robot.nv)
        self._near = (-1, False)
        # Row of an arm that has closed of late -> part of the gains of its hold and its axis
        self._rising: dict[int, float] = {}
        self._curvature = Curvature(walker, dt)
        items: Any = self.controller
        self._body = InputGroup(core_of(self.controller), [("body", "target", None), ("body", "feedforward", None)])
        self._rest = items["posture"]
        self._holds.of(self.controller)
        self._swings, self._axes = ([items[f"{arm.name} {kind}"] for arm in walker.arms] for kind in ("swing", "axis"))
        self._gains: list[tuple[Any, float]] = [(items["body"], BODY_GAIN), (self._rest, WRIST_GAIN)]
        self._hands = [self._hand(arm) for arm in walker.arms]
        self._gains += [(swing, SWING_GAIN) for swing in self._swings] + [(axis, AXIS_GAIN) for axis in self._axes]
        self._gains += self._holds.gains
        self._lag, self.swing_gain = -1.0, SWING_GAIN
        self.follow(0.0)

    def follow(self, lag: float) -> None:
        """Gains for joints that follow their commands by so much later [s]."""
        if abs(lag - self._lag) <= 0.1 * self._lag + 1e-3:
            return
        self._lag, most = lag, CRITICAL / max(lag, 1e-9)
        self.swing_gain = min(SWING_GAIN, most)
        for item, gain in self._gains:
            item.gain = min(gain, most)
        for arm, part in dict(self._rising).items():
            self._rise(arm, part)

    def begin(self, q: Array) -> None:
        """A walk begins at ``q`` ``[nq]``, at rest: nothing is left of the walk that was on this stack before."""
        self.controller.reset(q)
        self._posture[:], self._turning[:], self._mask[:] = self.walker.robot.neutral, 0.0, RESTING
        self._near = (-1, False)
        self.follow(0.0)
        self._rest.target, self._rest.feedforward, self._rest.mask = q, self._turning, self._mask

    def hold(self, arm: int, hold: int, roll: int = ANY) -> None:
        """A closed hand, at one of the rolls of its hold: the hold is exact; a hand that may tilt prefers not to.

        Raises:
            RangeError: a hold of a kind that the stack was not compiled for.
        """
        tilts = self._holds.hold(arm, self.structure, hold, roll)
        self._swings[arm].enabled, self._axes[arm].enabled = False, tilts
        if tilts:
            axis = self._axes[arm]
            axis.target, axis.feedforward, axis.weight = self.structure.axes[hold], np.zeros(3), UPRIGHT
        self._rising[arm] = 0.0
        self._rise(arm, 0.0)
        self._mask[self._joints(arm)] = RESTING
        self._still(arm)
        self._rest.mask = self._mask

    def release(self, arm: int) -> None:
        """An open hand, which follows aims."""
        self._holds.release(arm)
        self._swings[arm].enabled = self._axes[arm].enabled = True
        self._rise(arm, 1.0)
        self._catch_up()

    def rest(self, arm: int, place: Array, axis: Array) -> None:
        """A free hand that stays where it is."""
        swing, aligned = self._swings[arm], self._axes[arm]
        swing.target, swing.feedforward = place, np.zeros(3)
        aligned.target, aligned.feedforward, aligned.weight = axis, np.zeros(3), AXIS
        self._still(arm)

    def body(self, aim: Array) -> None:
        """The pose that the body goes to, rotation by columns and position, and its rate in the structure's axes
        (linear; angular) ``[18]`` [m, m/s, rad/s].
        """
        self._body.write(aim)
        for arm in tuple(self._rising):
            self._rise(arm, self._rising[arm] + self.dt / RISING)

    def lead(self, q: Array, v: Array, held: Mapping[int, int], away: Array | None = None) -> None:
        """Closed hands are told what keeps them on their holds, see :class:`Curvature`.

        Args:
            q: configuration. v: rates of the last tick ``[nv]``. held: row of the arm -> row of the hold.
            away: turn by which the body is off where its hands would have it; None: it is not. They lean by it, and no
                joint could take that back: it would move the body.
        """
        self._curvature.go(q, v)
        for arm, hold in held.items() if away is not None else ():
            self._axes[arm].target = away @ self.structure.axes[hold]
        for arm in held:
            gain = self._hold_gain(self._rising.get(arm, 1.0))
            if gain > 0.0:
                # As far ahead as the gain makes that rate of it
                self._holds.lead(arm, self._curvature.drift(arm, -1.0 / gain))

    def swing(self, arm: int, followed: Array, at_hold: Axes | None, part: float = 1.0) -> None:
        """What a free hand follows.

        Args:
            followed: its position [m] and velocity [m/s], joints 4 to 6 [rad] and their rates [rad/s] ``[12]``.
            at_hold: axes of a hand near its hold: they then count and not the wrist; else None.
            part: of the weight of its z axis.
        """
        near = at_hold is not None
        if self._near != (arm, near):
            self._catch_up()
            aligned, resting, joints = self._axes[arm], self._rest, self._joints(arm)
            self._posture[7:][joints][3:], self._turning[6:][joints][3:] = followed[6:9], followed[9:]
            aligned.weight = part * AXIS if near else FREE_AXIS
            self._mask[joints][:3] = 0.0
            self._mask[joints][3:] = 1.0 if near else FREE_WRIST
            self._holds.turn(arm, None)
            resting.target, resting.feedforward, resting.mask = self._posture, self._turning, self._mask
            self._near = arm, near
        if at_hold is not None:
            self._axes[arm].target, self._axes[arm].feedforward = at_hold.z, at_hold.z_rate
            self._axes[arm].weight = part * AXIS
            self._holds.turn(arm, at_hold.x, at_hold.x_rate)
        self._hands[arm].write(followed)

    def joints(self, arm: int, posture: Array, rates: Array) -> None:
        """A free hand follows the joints of its arm: ``[6]`` [rad] and their rates [rad/s]."""
        self._swings[arm].enabled = self._axes[arm].enabled = False
        mine = self._joints(arm)
        self._catch_up()
        self._mask[mine] = FREE_WRIST
        self._posture[7:][mine], self._turning[6:][mine] = posture, rates
        self._rest.mask, self._rest.target, self._rest.feedforward = self._mask, self._posture, self._turning

    def settle(self, arm: int, place: Array, axis: Array, x: Array | None) -> None:
        """A hand that follows joints comes to rest at a place, with a z axis, and an x axis if its roll counts."""
        self._swings[arm].enabled = self._axes[arm].enabled = True
        self._holds.turn(arm, x)
        self.rest(arm, place, axis)
        self._mask[self._joints(arm)] = RESTING
        self._rest.mask = self._mask

    def _rise(self, arm: int, part: float) -> None:
        """The gains of a hand's hold and of its axis become a part of what they are to be."""
        if arm in self._rising:
            self._axes[arm].gain = min(part, 1.0) * min(AXIS_GAIN, CRITICAL / max(self._lag, 1e-9))
            self._holds.follow(arm, self._hold_gain(part))
            self._rising[arm] = part
            if part >= 1.0:
                del self._rising[arm]

    def _hold_gain(self, part: float) -> float:
        """A part, of 1 at most, of the gain of holds on joints that lag as these do [1/s]."""
        return min(part, 1.0) * min(self._holds.gain, CRITICAL / max(self._lag, 1e-9))

    def _still(self, arm: int) -> None:
        """Wrists of arms that do not swing have no rates of their own."""
        self._catch_up()
        self._turning[6:][self._joints(arm)] = 0.0
        self._rest.feedforward = self._turning

    def _catch_up(self) -> None:
        """Postures and rates become what was written last: of a swinging hand only joints 4 to 6 are, tick by tick."""
        arm = self._near[0]
        followed = None if arm < 0 else self._hands[arm].written
        if followed is not None:
            joints = self._joints(arm)
            self._posture[7:][joints][3:], self._turning[6:][joints][3:] = followed[6:9], followed[9:]
        self._near = (-1, False)

    def _joints(self, arm: int) -> slice:
        of = self.walker.arms[arm].v
        return slice(of.start - 6, of.stop - 6)

    def _hand(self, arm: WalkerArm) -> InputGroup:
        """What a swinging hand follows: its place and velocity, joints 4 to 6 and their rates."""
        name = f"{arm.name} swing"
        wrist, turning = slice(arm.q.start + 3, arm.q.stop), slice(arm.v.start + 3, arm.v.stop)
        posture = ("posture", "target", wrist), ("posture", "feedforward", turning)
        return InputGroup(core_of(self.controller), [(name, "target", None), (name, "feedforward", None), *posture])
