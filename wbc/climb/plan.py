"""Contact plans: the timed motion of a climber from stance to stance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB
from wbc.validation import Array


@dataclass(frozen=True)
class ContactMove:
    """A limb that lets go, moves and lands.

    Attributes:
        limb: row of the climber's limbs.
        leaves: row of the foothold that it holds before, or ``FREE_LIMB``.
        lands: row of the foothold that it holds after, or ``FREE_LIMB``.
        lift: when it lets go [s].
        land: when it holds again [s].
    """

    limb: int
    leaves: int
    lands: int
    lift: float
    land: float


@dataclass(frozen=True, eq=False)
class ContactPlan:
    """What :func:`wbc.climb.plan_climb` finds: a motion q(t), cubic between knots, and which limb holds what.

    Attributes:
        climber: the robot.
        scene: what it climbs.
        start: contacts at time 0, as of :class:`wbc.climb.Stance`.
        moves: by time of lift; any number may be in the air at once.
        times: knots ``(n)`` [s], from 0 on.
        q: configurations at the knots ``(n, nq)`` [m, rad].
        v: velocities at the knots ``(n, nv)`` [m/s, rad/s].
        margin: least margin of equilibrium at the instants that were looked at, in shares of the weight; None: none
            were.
    """

    climber: Climber
    scene: ClimbScene
    start: tuple[int, ...]
    moves: Sequence[ContactMove]
    times: Array
    q: Array
    v: Array
    margin: float | None = None

    def contacts_at(self, time: float) -> tuple[int, ...]:
        """Of each limb the row of the foothold that it holds at a time [s], or ``FREE_LIMB``."""
        out = list(self.start)
        for move in sorted(self.moves, key=lambda move: move.lift):
            if time >= move.lift:
                out[move.limb] = move.lands if time >= move.land else FREE_LIMB
        return tuple(out)

    def told(self, move: ContactMove) -> str:
        """A move in words, "LIMB: FOOTHOLD -> FOOTHOLD"."""
        source, target = (self.scene.footholds[k].id if k >= 0 else "the air" for k in (move.leaves, move.lands))
        return f"{self.climber.limbs[move.limb].name}: {source} -> {target}"
