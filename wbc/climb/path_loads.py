"""What contacts have to give while a robot moves along a path, and how fast it may go for them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.climb.balance import Equilibrium
from wbc.climb.move_path import MovePath
from wbc.multibody import pin
from wbc.validation import Array

#: Path step over which velocities are differentiated [1]
DIFFERENCE = 1e-5
#: Least slack at rest from which on a robot moves [weights]
LEAST = 5e-4
#: Of the grid, every so many points are looked at for what motors give
DRIVEN_EVERY = 6
#: Least share of accelerations to which a law is slowed for motors [1]
SLOWEST = 0.01
#: Rows that are added at once, those that lack most
ADDED = 12


class PathLoads:
    """The wrench w that contacts give along a path q(s), of path acceleration u and squared path speed x,

        w(s) = C(s) + A(s) u + B(s) x          about the path's first centre of mass [weights, weights m]

    and rows a u + b x <= 1 for which its slack (:class:`Equilibrium`) keeps what motion may not use of that at rest:

        slack(w) >= (1 - share) slack(C)

    Each solution of the dual program bounds the slack at every s, as contacts stay where they are: rows are added where
    a law lacks slack (cutting planes), and at last a law is slowed by what is left. Slack is concave in w, so a law
    that is slower has no less of it.

    Args:
        balance: of climber and scene. path: from rest to rest. contacts: that hold all along it, ``FREE_LIMB`` else.
        s: grid ``(n)``. share: of the slack at rest that motion may use (0, 1].

    Attributes:
        s: as given.
        at_rest: slack at the grid ``(n)`` [weights]; the rows are for those of ``LEAST`` and more.
    """

    def __init__(
        self, balance: Equilibrium, path: MovePath, contacts: Sequence[int], s: Array, share: float
    ) -> None:  # fmt: skip
        self.s = s
        self._balance, self._contacts, self._q = balance, contacts, path.configurations(path.at(s))
        self._center = balance.climber.center_of_mass(path.q[0])
        self._still, self._pull, self._speed = self._wrenches(path, s)
        self.at_rest, bounds = self._slacks(self._still)
        self._least = (1.0 - share) * self.at_rest
        self._bounds = np.unique(bounds.round(12), axis=0)

    @property
    def rows(self) -> tuple[Array, Array]:
        """a and b of the rows so far ``(n, rows)``."""
        slopes = self._bounds[:, 1:]
        # More than the share at rest, as a bound is no less than the slack
        spare = self._bounds[:, 0] + self._still @ slopes.T - self._least[:, None]
        return -(self._pull @ slopes.T) / spare, -(self._speed @ slopes.T) / spare

    def lacking(self, u: Array, x: Array) -> float:
        """By which factor a law has to be slower, 1 for none; what it lacks becomes rows.

        Args:
            u: of the intervals ``(n - 1)``. x: at the grid ``(n)``.
        """
        ends = np.concatenate([np.arange(len(u)), np.arange(1, len(u) + 1)])
        moving = self._pull[ends] * np.tile(u, 2)[:, None] + self._speed[ends] * x[ends, None]
        slacks, bounds = self._slacks(self._still[ends] + moving)
        lacks = self._least[ends] - slacks
        # Slack is concave: a share of this wrench's difference from rest leaves at least that share of the slack's
        part = (self.at_rest - self._least)[ends] / np.maximum(self.at_rest[ends] - slacks, 1e-12)
        worst = np.argsort(-lacks)[:ADDED]
        new = bounds[worst[lacks[worst] > 0.0]]
        self._bounds = np.unique(np.concatenate([self._bounds, new.round(12)]), axis=0)
        return float(1.0 / np.sqrt(min(1.0, part.min())))

    def overdriven(self, u: Array, x: Array, effort: float) -> float:
        """By which factor a law has to be slower, 1 for none, for motors that give this share of their efforts.

        Args:
            u, x: as of :meth:`lacking`. effort: [1].
        """
        least = 1.0
        for k in range(0, len(self.s), DRIVEN_EVERY):
            law = np.array([u[max(k - 1, 0)], u[min(k, len(u) - 1)]])[:, None]
            wrenches, torques = (law * pull[k] + x[k] * speed[k] for pull, speed in
                                 ((self._pull, self._speed), self._driving))  # fmt: skip
            off = self._center - self._balance.climber.center_of_mass(self._q[k])
            wrenches[:, 3:] += np.cross(off, wrenches[:, :3])
            shares = self._balance.driven_shares(self._contacts, self._q[k], effort, wrenches, torques)
            least = min(least, *shares)
        return float(1.0 / np.sqrt(max(least, SLOWEST)))

    def _slacks(self, wrenches: Array) -> tuple[Array, Array]:
        return self._balance.wrench_slacks(self._contacts, self._q[0], self._center, wrenches)

    def _wrenches(self, path: MovePath, s: Array) -> tuple[Array, Array, Array]:
        """C, A, B."""
        model, climber = self._balance.moving_model, self._balance.climber
        data, zero = model.createData(), np.zeros(model.nv)

        def velocities(s: Array) -> Array:
            return path.velocities(path.at(s), path.at(s, 1))

        first, second = velocities(s), (velocities(s + DIFFERENCE) - velocities(s - DIFFERENCE)) / (2.0 * DIFFERENCE)
        q, weight = self._q, self._balance.world.weight
        torques = np.empty((3, len(s), model.nv))
        for k in range(len(s)):
            torques[0, k] = pin.rnea(model, data, q[k], zero, zero)
            torques[1, k] = pin.rnea(model, data, q[k], zero, first[k])
            torques[2, k] = pin.rnea(model, data, q[k], first[k], second[k])
        torques[1:] -= torques[0]
        self._driving, own = torques[1:] / weight, torques[..., :6]
        states = climber.states(q)
        turns, arms = states[:, :9].reshape(-1, 3, 3), states[:, 9:12] - self._center
        force, moment = (np.einsum("nij,cnj->cni", turns, part) for part in (own[..., :3], own[..., 3:]))
        still, pull, speed = np.concatenate([force, moment + np.cross(arms, force)], axis=2) / weight
        return still, pull, speed
