"""Configurations in which given contacts are where they hold: the closed chains of a climber."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wbc.climb.chain import ROWS, LimbTable, address_of as _at, library, limb_table
from wbc.climb.climber import Climber
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Largest error of a contact after closing [m], turns times the length of its limb
CLOSED = 1e-9
#: Newton's steps at most: from an error of 0.1 m, convergence takes 4 to 6
STEPS = 12
#: A body that goes where it is asked to be: 1 rad of a joint weighs as much as this way of it [m, rad]
HEAVY_BODY = 0.03
#: A body that yields, as where limbs pass a singular posture [m, rad]
LIGHT_BODY = 0.3


@dataclass(frozen=True, eq=False)
class Closure:
    """Newton's method on the contacts of a climber, with the least change of its joints and body.

        min ||S^-1 dz||  with  J Z dz = e,      q <- q (+) Z dz

    with J and e the fixed rows of the contacts' poses, z the angles of the limbs and the pose of the body, Z what
    couplings make of them, S 1 for angles and a length or angle for the body: one that is heavy goes where it was asked
    to be unless limbs cannot follow.
    """

    climber: Climber

    def closed(
        self, q: Array, contacts: Mapping[int, pin.SE3], body: float = HEAVY_BODY, turned: bool = True
    ) -> tuple[Array, float]:
        """The configuration near q with contact frames of limbs where they hold, and the largest error left.

        Args:
            contacts: limb -> pose of its contact frame in the world; only the rows that its kind fixes count.
            body, turned: as of :meth:`bring`.
        """
        out = np.array(q, dtype=np.float64)[None]
        left = self.bring(out, {limb: place(pose)[None] for limb, pose in contacts.items()}, body, turned)
        return out[0], float(left[0])

    def bring(
        self, q: Array, poses: Mapping[int, Array], body: float = HEAVY_BODY, turned: bool = True, steps: int = STEPS
    ) -> Array:
        """Closes configurations ``(n, nq)`` in place; the largest errors of a contact left ``(n)`` [m], turns
        times the length of its limb.

        Args:
            poses: limb -> poses of its contact frame in the world ``(n, 12)``, rotation row by row, then position.
            body: way of the body that weighs as much as 1 rad of a joint [m, rad]; 0: it stays where it is.
            turned: whether rows of turns count; else only positions do.
            steps: at most; 0: nothing moves.
        """
        left = np.zeros(len(q))
        if not poses or not len(q):
            return left
        which = np.array(list(poses), dtype=np.int32)
        wanted = np.ascontiguousarray(np.stack(list(poses.values()), axis=1))
        state = self.climber.states(q)
        library().wbc_close(
            ctypes.byref(self._table.numbers), _at(self._offsets), state.shape[1], len(which), _at(which),
            _at(wanted), int(turned), ctypes.c_double(body), ctypes.c_double(CLOSED), steps, ctypes.c_long(len(q)),
            _at(state), _at(left),
        )  # fmt: skip
        if steps:
            q[:] = self.climber.with_states(q, state, bool(body))
        return left

    def followed(self, limb: int, q: Array, poses: Array, turned: bool = True) -> int:
        """Brings a limb's contact to poses in the world ``(n, 12)``, in some configurations ``(n, nq)`` and in place,
        the body as it is; how many of them were found, from the first on. Where they are not all nothing is changed.

        Args:
            turned: whether rows of turns count; else only positions do.
        """
        states, wanted = self.climber.states(q), np.empty_like(poses)
        rotation = np.swapaxes(states[:, :9].reshape(-1, 3, 3), 1, 2)
        wanted[:, :9] = (rotation @ poses[:, :9].reshape(-1, 3, 3)).reshape(-1, 9)
        wanted[:, 9:] = np.einsum("nij,nj->ni", rotation, poses[:, 9:] - states[:, 9:12])
        angles = np.array(states[:, 12 + self._offsets[limb] : 12 + self._offsets[limb + 1]], order="C")
        code, rows = library(), ROWS["pose" if turned else "position"]
        code.wbc_reach_each.restype = ctypes.c_long
        one = ctypes.byref(self._table.numbers[limb])
        count = int(code.wbc_reach_each(one, ctypes.c_long(len(wanted)), _at(wanted), rows, _at(angles)))
        if count == len(q):
            q[:] = self.climber.with_limb(q, limb, angles)
        return count

    @cached_property
    def short(self) -> frozenset[int]:
        """Limbs that fix more rows than they have joints."""
        limbs = range(len(self.climber.limbs))
        return frozenset(k for k in limbs if len(self.climber.joints(k)) < ROWS[self.climber.fixed(k)])

    def error(self, q: Array, poses: Mapping[int, Array]) -> float:
        """Largest error of the fixed rows of contacts [m, rad] in configurations, of poses as of :meth:`bring`."""
        return float(self.bring(q, poses, steps=0).max(initial=0.0))

    def poses(self, q: Array) -> tuple[pin.SE3, ...]:
        """Pose in the world of every limb's contact frame."""
        return tuple(self.climber.contact_pose(q, limb) for limb in range(len(self.climber.limbs)))

    @cached_property
    def _offsets(self) -> NDArray[np.int32]:
        """Where each limb's angles begin."""
        return np.cumsum([0, *(len(rest) for rest in self._table.rest)]).astype(np.int32)

    @property
    def _table(self) -> LimbTable:
        return limb_table(self.climber, 0.0)
