"""Ways of body and limbs between two postures, pulled short and pushed off all that they may not touch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.spatial.transform import Rotation

from wbc.climb.world import ClimbWorld, SampleAims
from wbc.rotations import exponential
from wbc.validation import Array

#: Weight of the straightness of a band beside that of its length [1]
STIFF = 4.0
#: Weight of both beside those of rows in ``native/posture.h`` [1]
TENSION = 0.3
#: Iterations in which limbs in the air stay on their curves and the body hardly moves, at most
ON_CURVES = 5
#: Iterations after these, at most
ITERATIONS = 35
#: An iteration after which the cost has fallen by less than this share gains nothing [1]
GAINS = 2e-2
#: Iterations that gain nothing, one after the other, after which a band that touches or does not bear is given up
STALLED = 4
#: Weight of a step beside all else at first [1]
DAMPED = 0.02
#: What that weight is at least after a step that did not lower the cost [1]
LEAST_DAMPED = 1e-3
#: Its factor after a step that lowers the cost
LIGHTER = 0.25
#: Its factor after one that does not
HEAVIER = 6.0
#: How often a step is sought that lowers the cost
SHORTER = 6
#: Longest step of an iteration [lengths of the robot, rad]
LONGEST_STEP = 0.3
#: How much further apart than they have to be links are led [lengths of the robot]
ASIDE = 2.5e-2
#: How much more slack than there has to be the robot is led to [weights]
MORE_SLACK = 0.03
#: Error of contacts that is left to their limbs [lengths of the robot]
LEFT_OPEN = 1e-3
#: From limits of joints, where the ends of a band are no nearer to them [m, rad]
FROM_LIMITS = 5e-3
#: What holds the body in the first iterations [1]
HELD_BODY = 1e3
#: What holds an angle at its limit [1]
HARD = 1e6


@dataclass(frozen=True, eq=False)
class BandRows:
    """What samples ``(n)`` of a band keep.

    Attributes:
        near: places near which tips of limbs may be ``(n, limbs)``.
        poses: of contacts in the world ``(n, limbs, 12)``.
        closed: which contacts are there ``(n, limbs)``; on curves those of a limb that is anywhere are all.
        bears: contacts that bear the robot ``(limbs)``.
    """

    near: NDArray[np.int32]
    poses: Array
    closed: NDArray[np.bool_]
    bears: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class ElasticBand:
    """An elastic band (Quinlan and Khatib, ICRA 1993) of states x of body and angles,

        min  w sum |x' - x|^2 + w STIFF sum |x'' - 2 x' + x|^2 + contacts + pairs that are too near + slack that lacks

    by damped steps of Gauss and Newton of all samples at once: a banded matrix.

    Attributes:
        world: the climber and what it climbs.
        balance: in which slack is told; None: it does not count. slack: that there is to be at least [weights].
        aside: how much further apart than they have to be links are led, in parts of ``ASIDE``.
        still: whether the body stays where it is. on_curves: whether limbs in the air are on their curves at first.
    """

    world: ClimbWorld
    balance: ClimbWorld | None = None
    slack: float = 0.0
    aside: float = 1.0
    still: bool = False
    on_curves: bool = True

    def relaxed(self, states: Array, rows: BandRows) -> Array:
        """The band from a first one, whose ends stay.

        Args:
            states: rows of :meth:`ClimbWorld.state_of` ``(n, ...)``.
        """
        descent = _BandDescent(self, states, rows)
        return descent.run(descent.run(states, False) if self.on_curves else states, True)


class _Look(NamedTuple):
    """Normal equations of a band's samples, and what they say: cost, clearances [m], squared errors of
    contacts and centres of mass.
    """

    H: Array
    g: Array
    cost: float
    clear: Array
    open: Array
    centers: Array


class _BandDescent:
    """The steps from one band to the next."""

    def __init__(self, band: ElasticBand, states: Array, rows: BandRows) -> None:
        self._band, self._rows, self._bounds = band, rows, np.empty((0, 4))
        self._count, self._size = len(states) - 2, states.shape[1] - 6
        self._on_curves = np.broadcast_to(rows.closed.any(axis=0), rows.closed.shape)
        length, table, ends = band.world.length, band.world.limbs, states[[0, -1], 12:]
        self._scale = np.concatenate([np.full(3, 1.0 / length**2), np.ones(self._size - 3)])
        self._stretch, self._bend = (np.diff(np.eye(len(states)), n=k, axis=0)[:, 1:-1] for k in (1, 2))
        self._tension = TENSION * (self._stretch.T @ self._stretch + STIFF * self._bend.T @ self._bend)
        self._low = np.minimum(np.concatenate(table.lower) + FROM_LIMITS, ends.min(axis=0))
        self._high = np.maximum(np.concatenate(table.upper) - FROM_LIMITS, ends.max(axis=0))

    def run(self, states: Array, free: bool) -> Array:
        """The band after steps that lower its cost, with limbs in the air free or on their curves."""
        damped, idle, look = DAMPED, 0, self._look(states, free)
        if free and self._bounded(look.centers, np.inf):
            look = self._look(states, free)
        for _ in range(ITERATIONS if free else ON_CURVES):
            matrix, g = self._equations(states, look, free)
            for _ in range(SHORTER):
                move = self._solved(matrix, g, damped)
                moved = self._moved(states, move)
                after = self._look(moved, free)
                if after.cost < look.cost:
                    break
                damped = HEAVIER * max(damped, LEAST_DAMPED)
            else:
                break
            idle = 0 if after.cost < (1.0 - GAINS) * look.cost else idle + 1
            states, damped = moved, LIGHTER * damped
            if free and self._bounded(after.centers, self._band.slack + MORE_SLACK):
                look = self._look(states, free)
                continue
            look = after
            if idle and (idle == STALLED or not free or self._stands(look)):
                break
        return states

    def _look(self, states: Array, free: bool) -> _Look:
        band, rows = self._band, self._rows
        closed, aside = (rows.closed, band.aside * ASIDE) if free else (self._on_curves, -1.0)
        aims = SampleAims(rows.near, closed, rows.poses)
        H, g, cost, clear, left, centers = band.world.band(
            aims, self._bounds, band.slack + MORE_SLACK, aside * band.world.length, states
        )
        turned = states[:, :9].reshape(-1, 3, 3)
        turns = Rotation.from_matrix(turned[1:] @ np.swapaxes(turned[:-1], 1, 2)).as_rotvec()
        steps = np.hstack([np.diff(states[:, 9:12], axis=0), turns, np.diff(states[:, 12:], axis=0)])
        bends = np.diff(steps, axis=0)
        cost += TENSION * float(((steps**2).sum(axis=0) + STIFF * (bends**2).sum(axis=0)) @ self._scale)
        pull = TENSION * self._scale * (self._stretch.T @ steps + STIFF * self._bend.T @ bends)
        return _Look(H[1:-1], g[1:-1] - pull, cost, clear, left, centers)

    def _equations(self, states: Array, look: _Look, free: bool) -> tuple[Array, Array]:
        """The matrix below its diagonal, band by band, and the right side."""
        size, g = self._size, look.g.copy()
        matrix, (i, j) = np.zeros((2 * size + 1, self._count, size)), np.tril_indices(size)
        matrix[i - j, :, j] = look.H[:, i, j].T
        for k in range(3):
            matrix[k * size, : self._count - k] += np.diagonal(self._tension, -k)[:, None] * self._scale
        held = HARD if self._band.still else 0.0 if free else HELD_BODY
        matrix[0][:, :6] += held * self._scale[:6]
        angles = states[1:-1, 12:]
        stopped = ((angles <= self._low) & (g[:, 6:] < 0.0)) | ((angles >= self._high) & (g[:, 6:] > 0.0))
        matrix[0][:, 6:][stopped] += HARD
        g[:, 6:][stopped] = 0.0
        return matrix, g

    def _solved(self, matrix: Array, g: Array, damped: float) -> Array:
        """A step of twists of the body and angles ``(n - 2, m)``."""
        damping = matrix.copy()
        damping[0] += damped * self._scale
        move = solveh_banded(damping.reshape(len(damping), -1), g.ravel(), lower=True).reshape(g.shape)
        if self._band.still:
            move[:, :6] = 0.0
        longest = max(float(np.abs(move[:, :3]).max()) / self._band.world.length, float(np.abs(move[:, 3:]).max()))
        return np.asarray(move * min(1.0, LONGEST_STEP / max(longest, LONGEST_STEP)))

    def _moved(self, states: Array, move: Array) -> Array:
        out = states.copy()
        out[1:-1, 9:12] += move[:, :3]
        out[1:-1, :9] = (exponential(move[:, 3:6]) @ out[1:-1, :9].reshape(-1, 3, 3)).reshape(-1, 9)
        out[1:-1, 12:] = np.clip(out[1:-1, 12:] + move[:, 6:], self._low, self._high)
        return out

    def _bounded(self, centers: Array, known: float) -> bool:
        """Adds bounds for centres of mass of which none says less slack than is known; whether there were any."""
        balance, before = self._band.balance, len(self._bounds)
        if balance is None:
            return False
        for center in centers[1:-1]:
            if (self._bounds[:, 0] + self._bounds[:, 1:] @ center < known).any():
                continue
            slack, bound = balance.slack(self._rows.bears.tolist(), center, self._rows.poses[0])
            if slack < known and np.isfinite(bound).all():
                self._bounds = np.unique(np.vstack([self._bounds, bound.round(9)]), axis=0)
        return len(self._bounds) > before

    def _stands(self, look: _Look) -> bool:
        """Whether links are clear, and contacts where they have to be and bear, at all samples."""
        slacks = self._bounds[:, 0] + look.centers[1:-1] @ self._bounds[:, 1:].T
        near = look.clear[1:-1].min() >= 0.0 and look.open.max() <= LEFT_OPEN**2
        return bool(near and slacks.min(initial=np.inf) >= self._band.slack)
