"""Which cells let a hand hold: one bit a cell for each arm, hold and branch of the wrist."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Margins, Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.around import NONE_MET, Around, around
from wbc.walking.planner.detours.cells import Cells, Ints
from wbc.walking.planner.grips.held import held, near_holds
from wbc.walking.planner.grips.stretches import postures_at

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class CellGrips:
    """All (arm, hold, branch) that hold at some cell.

    Attributes:
        arm, hold, branch: ``[grips]``.
        fits: at each cell ``[grips, cells]``. lands: a hand may land there.
        row: of :attr:`postures` ``[grips, cells]``; -1 where it does not fit.
        postures: ``[rows, joints]`` [rad].
    """

    arm: Ints
    hold: Ints
    branch: Ints
    fits: Flags
    lands: Flags
    row: NDArray[np.int32]
    postures: Array

    def only(self, cells: Flags) -> CellGrips:
        """The same at some cells ``[cells]`` alone."""
        left = (self.fits & cells).any(axis=1)
        fits, lands, row = self.fits[left] & cells, self.lands[left] & cells, np.where(cells, self.row[left], -1)
        return CellGrips(self.arm[left], self.hold[left], self.branch[left], fits, lands, row, self.postures)

    def of_arm(self, arm: int) -> Ints:
        """Grips of an arm."""
        return np.nonzero(self.arm == arm)[0]


def cell_grips(walker: Walker, structure: Structure, cells: Cells) -> CellGrips:
    """Every arm on every hold at every cell."""
    limb, margins, about = limb_of(walker), walker.margins, around(walker, structure)
    free = about.bodies(cells.frames) == NONE_MET
    block = len(cells) // cells.shape[0]
    parts, found = list[Array](), list[tuple[Ints, Flags]]()
    for arm in range(len(walker.arms)):
        base = walker.arms[arm].base.homogeneous
        for begin in range(0, len(cells), block):
            here = begin + np.nonzero(free[begin : begin + block])[0]
            if not len(here):
                continue
            frames = cells.frames[here] @ base
            among = near_holds(limb, structure, frames)
            quick = postures_at(about, arm, frames, among, margins)
            (poses, holds, branch, lands), q = (
                _postures(about, margins, arm, frames, among) if quick is None else (quick[0].T, quick[1])
            )
            found.append((np.column_stack([np.full(len(q), arm), here[poses], holds, branch]), lands.astype(bool)))
            parts.append(q)
    if not found:
        found, parts = (
            [(np.zeros((0, 4), dtype=np.int64), np.zeros(0, bool))],
            [np.zeros((0, len(limb.position_limits)))],
        )
    keys, lands = (np.concatenate(columns) for columns in zip(*found, strict=True))
    branches = 1 + int(keys[:, 3].max(initial=0))
    packed = (keys[:, 0] * len(structure) + keys[:, 2]) * branches + keys[:, 3]
    there_is = np.bincount(packed, minlength=len(walker.arms) * len(structure) * branches) > 0
    names, number = np.nonzero(there_is)[0], (np.cumsum(there_is) - 1)[packed]
    row = np.full((len(names), len(cells)), -1, dtype=np.int32)
    row[number, keys[:, 1]] = np.arange(len(keys), dtype=np.int32)
    landing = np.zeros(row.shape, dtype=bool)
    landing[number, keys[:, 1]] = lands
    rest, branch = np.divmod(names, branches)
    arms, holds = np.divmod(rest, len(structure))
    return CellGrips(arms, holds, branch, row >= 0, landing, row, np.concatenate(parts))


def _postures(
    about: Around, margins: Margins, arm: int, frames: Array, among: Ints
) -> tuple[tuple[Ints, Ints, Ints, Ints], Array]:
    """Of an arm on some holds from frames of its base: frame, hold, branch, whether it may land there; and joints."""
    limb = about.limb
    there = held(limb, about.structure, frames, among, reach=margins.cell_reach, facing=margins.facing)
    good = there.within(margins.cell_angle) & (limb.wrist_bend(there.q) > margins.landing_wrist)
    rows, branch = np.nonzero(good)
    q, poses = there.q[rows, branch], there.pose[rows]
    clear = about.postures(arm, frames[poses], q, there.hold[rows]) == NONE_MET
    rows, branch, q, poses = rows[clear], branch[clear], q[clear], poses[clear]
    lands = may_land(margins, there.reach, there.wrists)[rows].astype(np.int64)
    return (poses, there.hold[rows], branch, lands), q


def may_land(margins: Margins, reach: Array, wrists: Array) -> Flags:
    """Whether hands with their wrists in the base ``[..., 3]``, and so much reach left, may lift or land."""
    from_axis = np.hypot(wrists[..., 0], wrists[..., 1])
    return np.asarray((reach > margins.cell_landing_reach) & (from_axis > margins.cell_landing_axis))
