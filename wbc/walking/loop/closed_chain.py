"""Where the body is, given the joints and the holds that hands are on: the closed chains decide, nothing else."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from itertools import combinations
from math import ceil, sqrt

import casadi as ca
import numpy as np

from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.native.compiled_function import compiled
from wbc.robots import Walker
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.operators import quick_operators
from wbc.symbolic.rotations import exp3, from_quaternion, left_jacobian, quaternion_product
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.rolls import allowed_x
from wbc.walking.planner.grips.tilt import LEAST_TILT

#: Sweeps of Jacobi's rotations; four are enough for a matrix of four rows, more change nothing
SWEEPS = 6
#: Keeps 0 / 0 away where a matrix is diagonal
TINY = 1e-300

_KNOWN: weakref.WeakKeyDictionary[object, ca.Function] = weakref.WeakKeyDictionary()
#: Where the hands of a body would be farther off the fit than this, or one that may not tilt turned by more, the body
#: is put there at once [m, rad]
NEAR = 0.002, 0.005
#: What a body takes back in the time that is the least for it; more takes as much longer [m, rad]
QUICKLY = 5e-4, 5e-4
#: Metres that a unit of misalignment of a hand's axis counts for: hands turn before they slip
AXIS_LENGTH = 0.05
#: The same of a compliant hold: origins keep their place to 1e-7 m against it
BALL_LENGTH = 1e-3


def chain_function(walker: Walker) -> ca.Function:
    """f(q, weights, mean, centre, mask, holds, off): see :class:`wbc.walking.loop.closed_chain.ClosedChain`.

    Of n arms, with 3 n rows of numbers for origins, z axes and x axes of the hands: ``weights`` ``[9 n]`` by rows,
    ``mean`` ``[n]``, ``centre`` ``[3]`` [m], ``mask`` ``[n]``, ``holds`` ``[3 n]`` [m], ``off`` ``[6]``: twist
    (linear; angular) whose exponential takes the body from the pose that fits, in the structure [m, rad].

    Returns:
        q with the body where the holds have it, and off that, its quaternion with the sign nearest to the one given;
        the slip [m]; and the 3 n rows in the structure ``[9 n]``.
    """
    known = _KNOWN.get(walker.robot)
    if known is None:
        known = _KNOWN[walker.robot] = compiled(_function(walker))
    return known


@quick_operators()
def _function(walker: Walker) -> ca.Function:
    n, rows = len(walker.arms), _hands(walker)
    q = ca.SX.sym("q", walker.robot.nq)
    joints = q[7:]
    sizes = {"weights": 9 * n, "mean": n, "centre": 3, "mask": n, "holds": 3 * n, "off": 6}
    weights, mean, centre, mask, holds, off = (ca.SX.sym(name, size) for name, size in sizes.items())
    ours = ca.reshape(rows(joints), 3, 3 * n).T
    quaternion = largest(davenport(ca.reshape(weights, 3, 3 * n) @ ours))
    quaternion = ca.if_else(ca.dot(quaternion, q[3:7]) < 0.0, -quaternion, quaternion)
    place, away = centre - (ours[:n, :] @ from_quaternion(quaternion).T).T @ mean, exp3(off[3:])
    place = from_quaternion(away) @ place + left_jacobian(off[3:]) @ off[:3]
    quaternion = quaternion_product(away, quaternion)
    moved = ours @ from_quaternion(quaternion).T
    moved[:n, :] += ca.repmat(place.T, n, 1)
    gaps = moved[:n, :] - ca.reshape(holds, 3, n).T
    slip = ca.sqrt(ca.mmax(mask * ca.sum2(gaps**2)))
    out = ca.vertcat(place, quaternion, joints, slip, ca.vec(moved.T))
    return ca.Function("chain", [q, weights, mean, centre, mask, holds, off], [out])


def _hands(walker: Walker) -> ca.Function:
    """Origins, z axes and x axes of the hands in the body's frame, from the joints."""
    model = walker.robot.model
    kinematics = Kinematics(model)
    poses = [kinematics.pose(arm.hand) for arm in walker.arms]
    rows = [pose.position for pose in poses] + [pose.rotation[:, k] for k in (2, 0) for pose in poses]
    joints = ca.SX.sym("joints", model.nq - 7)
    still = ca.vertcat(*np.array(pin.neutral(model))[:7].tolist(), joints)
    return ca.Function("hands", [joints], [ca.substitute(ca.vertcat(*rows), kinematics.q, still)])


def davenport(a: ca.SX) -> ca.SX:
    """K of A for quaternions (x, y, z, w): tr(R' A) = q' K q.

    K_vv = A + A' - tr(A) 1,    K_vw = (A32 - A23, A13 - A31, A21 - A12),    K_ww = tr(A)
    """
    trace, across = ca.trace(a), ca.vertcat(a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1])
    return ca.blockcat([[a + a.T - trace * ca.SX.eye(3), across], [across.T, trace]])


def largest(matrix: ca.SX) -> ca.SX:
    """The unit eigenvector of the largest eigenvalue of a symmetric matrix, by Jacobi's rotations."""
    count = matrix.size1()
    a, vectors = ca.densify(ca.SX(matrix)), ca.densify(ca.SX.eye(count))
    for _ in range(SWEEPS):
        for i, j in combinations(range(count), 2):
            _rotate(a, vectors, i, j)
    best, value = vectors[:, 0], a[0, 0]
    for k in range(1, count):
        best = ca.if_else(a[k, k] > value, vectors[:, k], best)
        value = ca.fmax(a[k, k], value)
    return best / ca.norm_2(best)


def _rotate(a: ca.SX, vectors: ca.SX, i: int, j: int) -> None:
    """Turn rows and columns i and j so that a_ij becomes 0, by the smaller of the two angles."""
    apart, off = a[j, j] - a[i, i], a[i, j]
    size = ca.fabs(apart) + ca.sqrt(apart * apart + 4.0 * off * off) + TINY
    tangent = ca.if_else(apart < 0.0, -2.0, 2.0) * off / size
    cosine = 1.0 / ca.sqrt(1.0 + tangent * tangent)
    sine = tangent * cosine
    a[i, i], a[j, j] = a[i, i] - tangent * off, a[j, j] + tangent * off
    a[i, j] = a[j, i] = 0.0
    for k in set(range(a.size1())) - {i, j}:
        one, other = a[k, i], a[k, j]
        a[k, i] = a[i, k] = cosine * one - sine * other
        a[k, j] = a[j, k] = sine * one + cosine * other
    one, other = vectors[:, i], vectors[:, j]
    vectors[:, i], vectors[:, j] = cosine * one - sine * other, sine * one + cosine * other


class ClosedChain:
    """The pose X = (R, t) of the body at which the holding hands fit their holds best:

        min  sum_k |R p_k + t - h_k|^2 + L^2 |R z_k - a_k|^2

    with p_k and z_k the hand's origin and z axis in the body's frame, h_k and a_k those of its hold, L =
    :data:`AXIS_LENGTH`; holds that fix the roll add their x axes in the same way. A compliant hold is a ball with a
    weak spring, L = :data:`BALL_LENGTH`, which decides what the origins leave open. This is Wahba's problem, solved by
    Davenport's q method: with A = sum (h_k - mean h) p_k' + L^2 a_k z_k', tr(R' A) = q' K q for the quaternion q of R.

    Where other hands hold than before, the best fit jumps by some tenths of a millimetre: with three hands the last
    microns of one decide the turn about the line between the two others; by centimetres where two are left that lean,
    and what leaned the other way has let go. A latch is not as sudden as that: the body goes on from where it is, and
    the motion by which it is off the fit is taken back by 1 - 10 s^3 + 15 s^4 - 6 s^5: over ``ease`` calls, or as many
    more as it is beyond :data:`QUICKLY`.

    Args:
        walker: its joints are what moves. structure: whose holds are meant. ease: least calls of :meth:`settle`; 0: at
            once.

    Attributes:
        origins, axes, x_axes: of all hands in the structure, and their z and x axes, after the last :meth:`settle`:
            ``[arms, 3]`` each, origins in m.
        away: turn by which the body is off the fit after it; None: it is not.
    """

    def __init__(self, walker: Walker, structure: Structure, ease: int = 0) -> None:
        self.walker, self.structure = walker, structure
        # What the body was off the fit when other hands held, in how many calls it is taken back, and those left
        self._jump, self._ease, self._calls, self._left = np.zeros(6), ease, ease, 0
        self.away: Array | None = None
        model = walker.robot.model
        self._model, self._data = model, model.createData()
        self._still = np.array(pin.neutral(model))
        # Views of what Pinocchio computes: origins, z axes and x axes of the hands
        frames = [self._data.oMf[model.getFrameId(arm.hand)] for arm in walker.arms]
        self._rows = [*(f.translation for f in frames), *(f.rotation[:, k] for k in (2, 0) for f in frames)]
        count = len(walker.arms)
        self.origins, self.axes, self.x_axes = np.zeros((3, count, 3))
        self._fit = SingleState(chain_function(walker))
        self._q, *self._fitted, self._off = self._fit.inputs
        self._held: dict[int, int] | None = None
        self._leans = False

    def on(self, structure: Structure) -> ClosedChain:
        """The same robot, at the same place, on another structure."""
        out = ClosedChain(self.walker, structure, self._ease)
        out.origins, out.axes, out.x_axes = self.origins, self.axes, self.x_axes
        return out

    def place(self, q: Array) -> None:
        """Where the hands are, of a body that is where a configuration has it."""
        origins, self.axes, self.x_axes = self._hands(q)
        self.origins = origins + q[:3]

    def slip(self, held: Mapping[int, int]) -> float:
        """Largest distance of a held hand from its hold [m]."""
        gaps = [self.origins[arm] - self.structure.positions[hold] for arm, hold in held.items()]
        return max((sqrt(gap.dot(gap)) for gap in gaps), default=0.0)

    def settle(self, q: Array, held: Mapping[int, int], joints: Array | None = None) -> tuple[Array, float]:
        """A configuration with the body where the held hands put it.

        Args:
            q: the one before, which says which of the allowed rolls a hand has, and the sign of the body's quaternion.
            held: row of the arm -> row of the hold. joints: where they are now; None: as in ``q``.

        Returns:
            (q, slip): slip is the largest distance of a held hand from its hold [m].

        Raises:
            RangeError: nothing is held, or by one hand that may roll: the body's pose is not determined.
        """
        if held != self._held:
            self._take(held, q)
            if self._ease:
                self._begin_easing(held, q)
        elif self._leans:
            self._take(held, q)
        if self._left:
            self._left -= 1
            s = self._left / self._calls
            self._off[:] = s**3 * (10.0 - 15.0 * s + 6.0 * s * s) * self._jump
            self.away = pin.exp3(self._off[3:])
        else:
            self.away = None
        self._q[:] = q
        if joints is not None:
            self._q[7:] = joints
        self._fit.run()
        found, nq, count = self._fit.output.copy(), len(q), len(self.origins)
        moved = found[nq + 1 :].reshape(-1, 3)
        self.origins, self.axes, self.x_axes = moved[:count], moved[count : 2 * count], moved[2 * count :]
        return found[:nq], found.item(nq)

    def _begin_easing(self, held: Mapping[int, int], q: Array) -> None:
        """The body goes on from a configuration."""
        self._off[:] = 0.0
        self._q[:] = q
        self._fit.run()
        found, hands = self._fit.output, list(held)
        fit = pin.XYZQUATToSE3(found[:7])
        self._jump[:] = pin.log6(pin.XYZQUATToSE3(q[:7]) * fit.inverse()).vector
        far, turned = float(np.linalg.norm(q[:3] - found[:3])), float(np.linalg.norm(self._jump[3:]))
        origins = found[len(q) + 1 :].reshape(-1, 3)[hands]
        off = float(np.linalg.norm(self._hands(q)[0][hands] + q[:3] - origins, axis=1).max())
        tilts = bool((self.structure.tilts[list(held.values())] >= LEAST_TILT).all())
        self._calls = ceil(self._ease * max(1.0, far / QUICKLY[0], turned / QUICKLY[1]))
        self._left = self._calls if off < NEAR[0] and (tilts or turned < NEAR[1]) else 0

    def _take(self, held: Mapping[int, int], q: Array) -> None:
        """What depends on the holds alone, until other ones are held.

        The x axis of a hand that leans and must not roll goes with its z axis, so it is taken anew every time, from the
        hands on the body as it was.
        """
        structure = self.structure
        if not held or (len(held) == 1 and structure.free_rolls[next(iter(held.values()))]):
            raise RangeError("held", dict(held), "the body's pose needs two hands, or one that cannot roll")
        arms, holds, count = list(held), list(held.values()), len(self.origins)
        rolled = [arm for arm, hold in held.items() if not structure.free_rolls[hold]]
        theirs, mask = np.zeros((count, 3)), np.zeros((count, 1))
        theirs[arms], mask[arms] = structure.positions[holds], 1.0
        mean = mask[:, 0] / len(arms)
        centre = mean @ theirs
        weights = np.zeros((3 * count, 3))
        weights[:count] = mask * (theirs - centre)
        lengths = np.where(structure.tilts[holds] < LEAST_TILT, AXIS_LENGTH, BALL_LENGTH)
        weights[[count + arm for arm in arms]] = lengths[:, None] ** 2 * structure.axes[holds]
        if rolled:
            _, axes, x_axes = self._hands(q)
        for arm in rolled:
            weights[2 * count + arm] = AXIS_LENGTH**2 * allowed_x(structure, held[arm], x_axes[arm], axes[arm])
        self._leans = any(structure.tilts[held[arm]] >= LEAST_TILT for arm in rolled)
        # The weights of the origins sum to nothing, so their mean does not count in A = weights' ours
        for numbers, given in zip(self._fitted, (weights, mean, centre, mask, theirs), strict=True):
            numbers[:] = given.ravel()
        self._held = dict(held)

    def _hands(self, q: Array) -> Array:
        """Origins, z axes and x axes of the hands ``[3, arms, 3]``, turned as a configuration has the body."""
        self._still[7:] = q[7:]
        pin.framesForwardKinematics(self._model, self._data, self._still)
        out: Array = np.concatenate(self._rows).reshape(3, -1, 3).dot(pin.Quaternion(q[3:7]).matrix().T)
        return out
