"""Which angles put a limb's contact frame where it is wanted."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.climb.chain import address_of as _at, library, limb_table
from wbc.climb.climber import Climber
from wbc.validation import Array

#: How far postures stay from limits of joints [m, rad]; at most a tenth of a joint's range
LIMIT_MARGIN = 0.02


class LimbReach:
    """Inverse kinematics of every limb of a climber, many poses in one call of compiled code.

        e(angles) = 0     the rows of the contact's pose that its limb fixes: position; position and z axis; pose

    by Newton's iteration, damped by a share of |e|^2, within the joints' limits less ``margin``. It begins at a seed if
    there is one, then at those of a table of sampled postures whose contact poses are nearest (Sobol's sequence over
    the limits), so that branches, or postures of a limb with more joints than rows, are found beside each other.

    Args:
        climber: the robot. margin: from limits [m, rad], at most a tenth of a joint's range.

    Raises:
        ShapeError: more than 12 limbs or 16 joints a limb. CompileError: as of
        :func:`wbc.geometry.kernel.library`.

    Cannot do: prove that no posture reaches a pose; it misses fewer than one in a thousand of reachable ones.
    """

    def __init__(self, climber: Climber, margin: float = LIMIT_MARGIN) -> None:
        self.climber = validation.instance("climber", climber, Climber, "a Climber")
        self.margin = validation.scalar("margin", margin, low=0.0, unit="rad")
        self.table = limb_table(climber, self.margin)

    def postures(self, limb: int, poses: Any, seeds: Any = None, count: int = 1) -> tuple[Array, NDArray[np.bool_]]:
        """Postures of a limb that hold at poses.

        Args:
            limb: its row.
            poses: of the contact frame in the body's frame ``(n, 12)``: rotation row by row, then position [m].
            seeds: angles ``(n, k)`` [m, rad] from which the first posture is sought, None: the table alone.
            count: postures apart from each other that are wanted of each pose.

        Returns:
            Angles ``(n, count, k)`` and which of them are solutions ``(n, count)``; others are 0. Where there is a
            seed and a posture near it, that comes first.

        Raises:
            RangeError, ShapeError, NotFiniteError: no such limb, poses, seeds or count.
        """
        row = validation.integer("limb", limb, 0, len(self.climber.limbs) - 1)
        most = validation.integer("count", count, 1, 64)
        n, k = np.shape(poses)[0] if np.ndim(poses) else 0, len(self.table.rest[row])
        wanted = validation.real_array("poses", poses, (n, 12))
        start = None if seeds is None else np.ascontiguousarray(validation.real_array("seeds", seeds, (n, k)))
        angles, counts = np.zeros((n, most, k)), np.zeros(n, dtype=np.int32)
        library().wbc_postures(
            ctypes.byref(self.table.numbers[row]), ctypes.c_long(n), _at(wanted), None if start is None else _at(start),
            most, _at(angles), _at(counts),
        )  # fmt: skip
        solved = np.arange(most) < counts[:, None]
        angles[~solved] = 0.0
        return angles, solved
