"""Items of a stack that hold closed hands, each as its hold is declared."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pinocchio as pin

from wbc import tasks
from wbc.controller.controller import Controller
from wbc.controller.stack import Stack
from wbc.errors import RangeError
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.rolls import frame_on
from wbc.walking.planner.grips.tilt import LEAST_TILT, TILT_PART

HoldKind = Literal["pose", "position", "axis", "roll"]
#: Kind of ``tasks.Hold`` by (hand may roll, hand may tilt)
KINDS: dict[tuple[bool, bool], HoldKind] = {
    (True, False): "axis",
    (False, False): "pose",
    (True, True): "position",
    (False, True): "roll",
}
#: Gain of holds [1/s] is 1 / (HOLD_TICKS dt)
HOLD_TICKS = 5
#: A hand that rolls into its hold: weight, gain [1/s]
ROLL, ROLL_GAIN = 3.0, 12.0


def hold_kind(structure: Structure, hold: int) -> HoldKind:
    """How a hold (its row) is held: the kind of ``tasks.Hold``."""
    return KINDS[structure.free_rolls[hold], bool(structure.tilts[hold] >= LEAST_TILT)]


class HoldItems:
    """For each arm one ``Hold`` of every kind that a structure needs, an ``AxisCone`` where hands may tilt, and an
    ``AxisAlign`` of the x axis that turns an open hand to a roll.

    Args:
        stack: to which they are added, before it is compiled.
    """

    def __init__(self, stack: Stack, walker: Walker, structure: Structure, dt: float) -> None:
        self._names = [arm.name for arm in walker.arms]
        self.kinds = sorted({hold_kind(structure, k) for k in range(len(structure))})
        self._tilts = bool({"position", "roll"} & set(self.kinds))
        self._rolls = bool({"pose", "roll"} & set(self.kinds))
        for arm in walker.arms:
            for kind in self.kinds:
                item = tasks.Hold(arm.hand, kind=kind, gain=1.0 / (HOLD_TICKS * dt))
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
        for turned in self._turned:
            turned.gain = ROLL_GAIN
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
        item.enabled, item.target = True, pin.SE3(frame_on(structure, hold, roll))
        if tilts:
            cone = self._cones[arm]
            cone.enabled, cone.direction = True, structure.axes[hold]
            cone.half_angle = TILT_PART * structure.tilts[hold]
        return tilts

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
