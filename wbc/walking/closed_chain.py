"""Where the body is, given the joints and the holds that hands are on: the closed chains decide, nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dsyev

from wbc.errors import RangeError
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.grip_rolls import allowed_x
from wbc.walking.hand_tilt import LEAST_TILT
from wbc.walking.structure import Structure

#: Metres that a unit of misalignment of a hand's axis counts for: hands give way to turning before they slip
AXIS_LENGTH = 0.05
#: The same of a compliant hold: origins keep their place to 1e-7 m against it
BALL_LENGTH = 1e-3


def _davenport() -> Array:
    """The linear map from A ``[9]`` by rows to K ``[16]``, for quaternions (x, y, z, w)."""
    out = np.zeros((4, 4, 3, 3))
    for i in range(3):
        out[3, 3, i, i] = 1.0
        for j in range(3):
            # K_vv = A + A' - tr(A) 1
            out[i, j, i, j] += 1.0
            out[i, j, j, i] += 1.0
            out[i, i, j, j] -= 1.0
        # K_vw = (A32 - A23, A13 - A31, A21 - A12)
        k, m = (i + 1) % 3, (i + 2) % 3
        out[i, 3, m, k] = out[3, i, m, k] = 1.0
        out[i, 3, k, m] = out[3, i, k, m] = -1.0
    return out.reshape(16, 9)


DAVENPORT = _davenport()


class ClosedChain:
    """The pose X = (R, t) of the body at which the holding hands fit their holds best:

        min  sum_k |R p_k + t - h_k|^2 + L^2 |R z_k - a_k|^2

    with p_k and z_k the hand's origin and z axis in the body's frame, h_k and a_k those of its hold, L =
    :data:`AXIS_LENGTH`; holds that fix the roll add their x axes in the same way. A compliant hold is a ball with a
    weak spring, L = :data:`BALL_LENGTH`, which decides what the origins leave open. This is Wahba's problem, solved by
    Davenport's q method: with A = sum (h_k - mean h) p_k' + L^2 a_k z_k', tr(R' A) = q' K q for the quaternion q of R.

    Args:
        walker: its joints are what moves. structure: whose holds are meant.

    Attributes:
        origins, axes, sides: of all hands in the structure, and their z and x axes, after the last :meth:`settle`:
            ``[arms, 3]`` each, origins in m.
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self.walker, self.structure = walker, structure
        model = walker.robot.model
        self._model, self._data = model, model.createData()
        self._still = np.array(pin.neutral(model))
        # Views of what Pinocchio computes: origins, z axes and x axes of the hands
        frames = [self._data.oMf[model.getFrameId(arm.hand)] for arm in walker.arms]
        self._rows = [*(f.translation for f in frames), *(f.rotation[:, k] for k in (2, 0) for f in frames)]
        count = len(walker.arms)
        self.origins, self.axes, self.sides = np.zeros((3, count, 3))
        self._held: dict[int, int] | None = None
        self._leans = False

    def on(self, structure: Structure) -> ClosedChain:
        """The same robot, at the same place, on another structure."""
        out = ClosedChain(self.walker, structure)
        out.origins, out.axes, out.sides = self.origins, self.axes, self.sides
        return out

    def place(self, q: Array) -> None:
        """Where the hands are, of a body that is where a configuration has it."""
        self._still[7:] = q[7:]
        pin.framesForwardKinematics(self._model, self._data, self._still)
        turn, count = pin.Quaternion(q[3:7]).matrix(), len(self.origins)
        moved = np.concatenate(self._rows).reshape(-1, 3).dot(turn.T)
        self.origins = moved[:count] + q[:3]
        self.axes, self.sides = moved[count : 2 * count], moved[2 * count :]

    def slip(self, held: Mapping[int, int]) -> float:
        """Largest distance of a held hand from its hold [m]."""
        gaps = [self.origins[arm] - self.structure.positions[hold] for arm, hold in held.items()]
        return max((sqrt(gap.dot(gap)) for gap in gaps), default=0.0)

    def settle(self, q: Array, held: Mapping[int, int]) -> tuple[Array, float]:
        """A configuration with the same joints and the body where the held hands put it.

        Args:
            q: its joints count; its body pose only says which of the allowed rolls a hand has.
            held: row of the arm -> row of the hold.

        Returns:
            (q, slip): slip is the largest distance of a held hand from its hold [m].

        Raises:
            RangeError: nothing is held, or by one hand that may roll: the body's pose is not determined.
        """
        self._still[7:] = q[7:]
        pin.framesForwardKinematics(self._model, self._data, self._still)
        flat = np.concatenate(self._rows)
        if held != self._held or self._leans:
            self._take(held, flat.reshape(3, -1, 3).dot(pin.Quaternion(q[3:7]).matrix().T))
        quaternion = dsyev(self._quadratic.dot(flat).reshape(4, 4))[1][:, 3]
        out = q.copy()
        # The quaternion keeps its sign from tick to tick
        out[3:7] = quaternion if quaternion.dot(q[3:7]) >= 0.0 else -quaternion
        count = len(self.origins)
        moved = flat.reshape(-1, 3).dot(pin.Quaternion(out[3:7]).matrix().T)
        out[:3] = origin = self._center - self._mean.dot(moved[:count])
        self.origins, self.axes = moved[:count] + origin, moved[count : 2 * count]
        self.sides = moved[2 * count :]
        gap = self._mask * (self.origins - self._holds)
        return out, sqrt(np.maximum.reduce(np.add.reduce(gap * gap, axis=1)))

    def _take(self, held: Mapping[int, int], hands: Array) -> None:
        """What depends on the holds alone, until other ones are held.

        ``hands`` ``[3, arms, 3]`` are origins, z and x axes of the hands on the body as it was. The x axis of a hand
        that leans and must not roll goes with its z axis, so it is taken anew every time.
        """
        structure = self.structure
        if not held or (len(held) == 1 and structure.free_rolls[next(iter(held.values()))]):
            raise RangeError("held", dict(held), "the body's pose needs two hands, or one that cannot roll")
        arms, holds, count = list(held), list(held.values()), len(self.origins)
        rolled = [arm for arm, hold in held.items() if not structure.free_rolls[hold]]
        self._holds = np.zeros((count, 3))
        self._holds[arms] = structure.positions[holds]
        self._mask = np.zeros((count, 1))
        self._mask[arms] = 1.0
        self._mean = self._mask[:, 0] / len(arms)
        self._center = self._mean @ self._holds
        weights = np.zeros((3 * count, 3))
        weights[:count] = self._mask * (self._holds - self._center)
        lengths = np.where(structure.tilts[holds] < LEAST_TILT, AXIS_LENGTH, BALL_LENGTH)
        weights[[count + arm for arm in arms]] = lengths[:, None] ** 2 * structure.axes[holds]
        for arm in rolled:
            weights[2 * count + arm] = AXIS_LENGTH**2 * allowed_x(structure, held[arm], hands[2, arm], hands[1, arm])
        self._leans = any(structure.tilts[held[arm]] >= LEAST_TILT for arm in rolled)
        # The weights of the origins sum to nothing, so their mean does not count in A = weights' ours
        self._quadratic = np.einsum("abc,nb->anc", DAVENPORT.reshape(16, 3, 3), weights).reshape(16, -1)
        self._held = dict(held)
