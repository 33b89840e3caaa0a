"""Where the body is, given the joints and the holds that hands are on: the closed chains decide, nothing else."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from wbc.errors import RangeError
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.structure import Structure

#: Metres that a unit of misalignment of a hand's axis counts for: hands give way to turning before they slip
AXIS_LENGTH = 0.05


class ClosedChain:
    """The pose X = (R, t) of the body at which the holding hands fit their holds best:

        min  sum_k |R p_k + t - h_k|^2 + L^2 |R z_k - a_k|^2

    with p_k and z_k the hand's origin and z axis in the body's frame, h_k and a_k those of its hold, L =
    :data:`AXIS_LENGTH`. The optimum is that of Wahba's problem, by one singular value decomposition (Markley, 1988).

    Args:
        walker: its joints are what moves. structure: whose holds are meant.

    Attributes:
        origins, rotations: of all hands in the structure, after the last :meth:`settle`: ``[arms, 3]`` [m] and
            ``[arms, 3, 3]``.
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self.walker, self.structure = walker, structure
        model = walker.robot.model
        self._model, self._data = model, model.createData()
        self._hands = [model.getFrameId(arm.hand) for arm in walker.arms]
        self._still = np.array(pin.neutral(model))
        count = len(walker.arms)
        self.origins, self.rotations = np.zeros((count, 3)), np.zeros((count, 3, 3))

    def on(self, structure: Structure) -> ClosedChain:
        """The same robot, at the same place, on another structure."""
        out = ClosedChain(self.walker, structure)
        out.origins, out.rotations = self.origins, self.rotations
        return out

    def hands(self, q: Array) -> tuple[Array, Array]:
        """Origins and rotations of all hands in the body's frame: ``[arms, 3]`` [m] and ``[arms, 3, 3]``."""
        self._still[7:] = q[7:]
        pin.framesForwardKinematics(self._model, self._data, self._still)
        frames = [self._data.oMf[k] for k in self._hands]
        return np.array([f.translation for f in frames]), np.array([f.rotation for f in frames])

    def settle(self, q: Array, held: Mapping[int, int]) -> tuple[Array, float]:
        """A configuration with the same joints and the body where the held hands put it.

        Args:
            q: its joints count; its body pose does not.
            held: row of the arm -> row of the hold.

        Returns:
            (q, slip): slip is the largest distance of a held hand from its hold [m].

        Raises:
            RangeError: nothing is held, or by one hand that may roll: the body's pose is not determined.
        """
        if not held or (len(held) == 1 and self.structure.free_rolls[next(iter(held.values()))]):
            raise RangeError("held", dict(held), "the body's pose needs two hands, or one that cannot roll")
        arms, holds = list(held), list(held.values())
        place, turn = self.hands(q)
        count = len(arms)
        # Rows: origins, less their means, then axes; of the hands in the body, and of the holds
        ours, theirs = np.empty((2 * count, 3)), np.empty((2 * count, 3))
        ours[:count], ours[count:] = place[arms], AXIS_LENGTH * turn[arms, :, 2]
        theirs[:count], theirs[count:] = self.structure.positions[holds], AXIS_LENGTH * self.structure.axes[holds]
        middle, center = ours[:count].sum(axis=0) / count, theirs[:count].sum(axis=0) / count
        ours[:count] -= middle
        theirs[:count] -= center
        attitude = theirs.T @ ours
        for arm, hold in held.items():
            if not self.structure.free_rolls[hold]:
                attitude += AXIS_LENGTH**2 * np.outer(self.structure.references[hold], turn[arm][:, 0])
        u, _, vt = np.linalg.svd(attitude)
        rotation = u @ vt
        if np.linalg.det(rotation) < 0.0:
            rotation -= 2.0 * np.outer(u[:, 2], vt[2])
        origin = center - rotation @ middle
        out = q.copy()
        out[:3] = origin
        # The quaternion keeps its sign from tick to tick
        quaternion = pin.Quaternion(rotation).coeffs()
        out[3:7] = quaternion if quaternion @ q[3:7] >= 0.0 else -quaternion
        gap = ours[:count] @ rotation.T - theirs[:count]
        slip = float(np.sqrt((gap * gap).sum(axis=1).max()))
        self.origins, self.rotations = place @ rotation.T + origin, rotation @ turn
        return out, slip
