"""Which motor no longer does what it is commanded."""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

import numpy as np

from wbc.estimation import MomentumObserver
from wbc.robot import Robot
from wbc.validation import Array

#: Gain of the observer of the momentum [1/s]
GAIN = 50.0
#: A motor is judged while more than this part of its largest torque is asked of it: friction that nobody knows is less;
ASKED = 0.15
#: ... and gives too little below this part of what is asked, ...
GIVEN = 0.15
#: ... for so long that blows of limbs that close have passed [s]
LASTING = 0.05
#: Ticks from one look at the momentum to the next: torques between are their mean
LOOKS = 5


@runtime_checkable
class FeltPlant(Protocol):
    """What a plant has besides that measures what its contacts exert."""

    @property
    def contact_torques(self) -> Array:
        """Generalised force of all contacts in the last time step ``[nv]`` [N; N m]."""


class MotorWatch:
    """Compares what motors give with what is asked of them: with the residual r of a :class:`MomentumObserver` and the
    torque u that was asked, behind a filter of the same lag, joint k gives the part (u_k + r_k) / u_k.

    Args:
        robot: with masses; motors without a limit of effort are not judged. dt: period [s].
        delay: after which torques take hold [s].

    Attributes:
        share: of what is asked that each motor gives as far as it is judged, else 1 ``[nv]``.
        limp: degrees of freedom whose motors give too little.
    """

    def __init__(self, robot: Robot, dt: float, delay: float = 0.0) -> None:
        effort = np.full(robot.nv, np.inf)
        effort[list(robot.motors)] = robot.limits.effort[list(robot.motors)]
        period = LOOKS * dt
        gain = min(GAIN, 0.5 / period)
        self._observer, self._rate = MomentumObserver(robot.model, gain, period), gain * period
        self._least, self._looks = ASKED * effort, math.ceil(LASTING / period)
        # Torques on their way, the oldest first; which of them takes hold, in parts
        late, self._part = divmod(round(delay / dt, 9), 1.0)
        self._sent, self._took, self._ticks = np.zeros((int(late) + 2, robot.nv)), np.zeros(robot.nv), 0
        self.share, self.limp = np.ones(robot.nv), list[int]()
        self._asked, self._low = np.zeros(robot.nv), np.zeros(robot.nv, dtype=int)

    def begin(self, q: Array, v: Array) -> None:
        """At a state."""
        self._observer.begin(q, v)

    def sends(self, torque: Array) -> bool:
        """A tick on, with what was commanded for it ``[nv]``; whether it is time to :meth:`see`."""
        sent, part = self._sent, self._part
        sent[:-1] = sent[1:]
        sent[-1] = torque
        self._took += (1.0 - part) / LOOKS * sent[1]
        if part:
            self._took += part / LOOKS * sent[0]
        self._ticks = (self._ticks + 1) % LOOKS
        return self._ticks == 0

    def see(self, q: Array, v: Array, contacts: Array) -> list[int]:
        """The degrees of freedom whose motors are found limp at a state.

        Args:
            q, v: now. contacts: generalised force of contacts ``[nv]``.
        """
        took, asked = self._took, self._asked
        residual = self._observer.update(q, v, took + contacts)
        asked += self._rate * (took - asked)
        took[:] = 0.0
        judged = np.abs(asked) > self._least
        self.share[:] = 1.0
        np.divide(asked + residual, asked, out=self.share, where=judged)
        self._low = np.where(self.share < GIVEN, self._low + 1, 0)
        new = [int(k) for k in np.flatnonzero(self._low == self._looks) if int(k) not in self.limp]
        self.limp += new
        return new
