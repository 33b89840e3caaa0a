"""What a closed chain does beside what its joints were told, taken back by where its hands are to be."""

from __future__ import annotations

from math import dist, hypot

import numpy as np
import pinocchio as pin

from wbc.validation import Array
from wbc.walking.loop.machine import Machine
from wbc.walking.loop.stack import WalkStack

#: A body that is faster or slower than commanded by this is looked at; by less it is left alone [m/s]
SEEN = 0.002
#: Part of it that is taken back in a tick
PART = 0.5


class ChainDrift:
    """Rates that last for a tick move a hand off its hold by what its Jacobian changes meanwhile, some microns. Where
    three hands that may tilt are nearly on one line, these microns turn the body about it by a hundred times as much.
    The twist D by which the body moves beside its command comes again in the next tick, so the hands are told

        J_k v = D_linear + D_angular x (p_k - p_body)

    in place of 0: D is summed up in parts until the body moves as commanded, and forgotten when other hands hold.
    Joints that lag have errors of another kind, which are left alone.
    """

    def __init__(self, machine: Machine, stack: WalkStack) -> None:
        self._machine, self._stack = machine, stack
        self._held: dict[int, int] = {}
        self._twist: Array | None = None

    def go(self, before: Array) -> None:
        """After a tick that began at ``before`` ``[nq]``."""
        machine = self._machine
        if machine.held != self._held:
            # Hands that have just closed are told where to be by the stack
            self._held, self._twist = dict(machine.held), None
            return
        x, y, z = machine.v[:3].tolist()
        speed = dist(machine.q[:3].tolist(), before[:3].tolist()) / machine.dt
        if machine.lag > 0.0 or machine.fixed or (self._twist is None and abs(speed - hypot(x, y, z)) < SEEN):
            return
        one, other = pin.Quaternion(before[3:7]).matrix(), pin.Quaternion(machine.q[3:7]).matrix()
        linear, angular = machine.v[:3], machine.v[3:6]
        linear = linear + 0.5 * machine.dt * np.cross(angular, linear)
        moved = (machine.q[:3] - before[:3]) / machine.dt - one @ linear
        turned = pin.log3(other @ one.T) / machine.dt - one @ angular
        if self._twist is None:
            self._twist = np.zeros(6)
        self._twist += PART * np.concatenate([moved, turned])
        for arm in machine.held:
            off = machine.chain.origins[arm] - machine.q[:3]
            self._stack.lead(arm, self._twist[:3] + np.cross(self._twist[3:], off), self._twist[3:])
