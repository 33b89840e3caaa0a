"""How a mechanism moves by its base and motors, where loops and couplings hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from wbc.robot.shortest_steps import DEPENDENT
from wbc.validation import Array


class MotorSpace:
    """Motions that rows J(q) v = 0 leave, v = B z, by the velocities of some degrees of freedom, v_m = B_m z.

    How many motions there are, and how many of them v_m says, is known from configurations like any other: a loop that
    is open by rounding has rows that depend on others where it is closed.

    Args:
        rows: q -> J [rows, nv]. said: the degrees of freedom of v_m. looks: closed configurations like any other.
    """

    def __init__(self, rows: Callable[[Array], Array], said: Sequence[int], looks: Sequence[Array]) -> None:
        self._rows, self._said = rows, list(said)
        found = [self._split(q) for q in looks]
        self._held = max(int((sizes > DEPENDENT).sum()) for sizes, _ in found)
        moved = [np.linalg.svd(axes[self._held :, self._said])[1] for _, axes in found]
        self._mobility = max(int((sizes > DEPENDENT).sum()) for sizes in moved)

    def jacobian(self, q: Array) -> tuple[Array, int]:
        """(G = B B_m^+, with which v = G v_m [nv, said]; -1, or at a dead point, where v_m or the rows say less than
        elsewhere, the degree of freedom that takes most part in what they do not say).
        """
        (sizes, axes), count = self._split(q), self._mobility
        free = axes[self._held :].T
        left, moved, right = np.linalg.svd(free[self._said])
        lost = -1
        for least, motion in (
            (sizes[: self._held], axes[self._held - 1 : self._held]),
            (moved[:count], right[count - 1 : count] @ free.T),
        ):
            if (least <= DEPENDENT).any():
                lost = int(np.abs(motion).argmax())
        inverse = right[:count].T @ (left[:, :count] / np.maximum(moved[:count], DEPENDENT)).T
        return np.asarray(free @ inverse), lost

    def _split(self, q: Array) -> tuple[Array, Array]:
        """Singular values of J, as parts of the largest, and its right singular vectors as rows [nv, nv]."""
        _, sizes, axes = np.linalg.svd(self._rows(q))
        return sizes / max(float(sizes.max(initial=0.0)), 1e-300), axes
