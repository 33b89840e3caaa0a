"""Which motor no longer does what it is commanded."""

from __future__ import annotations

import numpy as np

from wbc.estimation import MomentumObserver
from wbc.multibody import pin
from wbc.validation import Array

#: Of the observer [1/s], and what noise of the rates may make of it, the lesser counts: as its residual is commanded
#: against, noise of so many rad/s moves the joints by gain times that [rad/s^2]
GAIN, SHAKEN = 200.0, 0.05
#: A motor is judged while more than this part of its largest torque is asked of it, ...
ASKED = 0.08
#: ... and is limp when it gives less than this part of what is asked, ...
GIVEN = 0.3
#: ... for so long [s] where that is more than friction that nobody knows of may take [N m]: blows of hands that close
#: pass; or for so long where it is more with what is added, as friction has been compensated by then
FRICTION, LASTING, LONG = 6.0, 0.015, 0.1


class MotorWatch:
    """Compares what the motors give with what is asked of them: with the residual r of a :class:`MomentumObserver`, the
    torque u that the stack asks for and what is added to it against friction, c, both behind a filter of the same lag,
    joint k gives the part (u_k + c_k + r_k) / u_k.

    Args:
        model: with masses. effort: largest torques ``[nv]``, 0 for a base [N m; N]. dt: [s]. noise: of the rates that
            are read [rad/s].

    Attributes:
        share: of what is asked that each motor gives, as far as it is judged; else 1 ``[nv]``.
        residual: r, what acts beside what is known ``[nv]`` [N m; N].
        limp: degrees of freedom whose motors have been found limp.
    """

    def __init__(self, model: pin.Model, effort: Array, dt: float, noise: float = 0.0) -> None:
        gain = SHAKEN / max(noise, SHAKEN / GAIN)
        self._observer = MomentumObserver(model, gain, dt)
        self._least, self._rate = np.where(effort > 0.0, ASKED * effort, np.inf), gain * dt
        self._ticks = round(LASTING / dt), round(LONG / dt)
        self.share, self.limp = np.ones(model.nv), list[int]()
        self._asked, self._added = np.zeros((2, model.nv))
        self._low, self._long = np.zeros((2, model.nv), dtype=int)
        self.residual = self._observer.residual

    def begin(self, q: Array, v: Array) -> None:
        """At a state, with motors that work."""
        self._observer.begin(q, v)
        self._asked[:], self._added[:], self.share[:] = 0.0, 0.0, 1.0
        self._low[:], self._long[:] = 0, 0
        self.limp = []

    def struck(self, q: Array, v: Array) -> None:
        """A hand has closed, which changed the velocity at once."""
        self._observer.struck(q, v)

    def see(self, q: Array, v: Array, torque: Array, added: Array, contacts: Array) -> list[int]:
        """A tick on; the degrees of freedom that are found limp in it.

        Args:
            q, v: at its end. torque: asked for by the stack, that took hold in it. added: commanded beside it.
            contacts: J'w of what touched ``[nv]``.
        """
        residual, asked, more = self._observer.update(q, v, torque + added + contacts), self._asked, self._added
        asked += self._rate * (torque - asked)
        more += self._rate * (added - more)
        judged = np.abs(asked) > self._least
        self.share[:] = 1.0
        np.divide(asked + more + residual, asked, out=self.share, where=judged)
        low = self.share < GIVEN
        self._low = np.where(low & (np.abs(asked) > FRICTION), self._low + 1, 0)
        self._long = np.where(low & (np.abs(asked + more) > FRICTION), self._long + 1, 0)
        dead = (self._low == self._ticks[0]) | (self._long == self._ticks[1])
        found = [int(k) for k in np.flatnonzero(dead) if int(k) not in self.limp]
        self.limp += found
        return found
