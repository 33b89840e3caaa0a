"""Which cells let a hand hold: one bit a cell for each arm, hold and branch of the wrist."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

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

#: Numbers of branches of an arm's wrist are below this
BRANCHES = 8


@dataclass(frozen=True, eq=False)
class CellGrips:
    """All (arm, hold, branch) that hold at some cell.

    Attributes:
        arm, hold, branch: ``[grips]``.
        count: of cells.
        begin: first row of each grip, and the end of the last one ``[grips + 1]``.
        cells: at which they hold, grip by grip in their order ``[rows]``. lands: a hand may land there.
        at: row of :attr:`postures` ``[rows]``.
        postures: [rad] ``[k, joints]``.
    """

    arm: Ints
    hold: Ints
    branch: Ints
    count: int
    begin: Ints
    cells: NDArray[np.int32]
    lands: Flags
    at: NDArray[np.int32]
    postures: Array

    def __len__(self) -> int:
        return len(self.arm)

    def rows(self, grip: int) -> slice:
        """Rows of a grip."""
        return slice(int(self.begin[grip]), int(self.begin[grip + 1]))

    @cached_property
    def fits(self) -> NDArray[np.uint8]:
        """Whether grips hold at cells, eight cells a byte ``[grips, cells / 8]``."""
        return self._bits(np.ones(len(self.cells), dtype=bool))

    @cached_property
    def landing(self) -> NDArray[np.uint8]:
        """Whether hands may land on grips at cells, eight cells a byte ``[grips, cells / 8]``."""
        return self._bits(self.lands)

    def fits_at(self, grips: Ints, cell: int) -> Flags:
        """Whether grips hold at a cell."""
        return np.asarray(self.fits[grips, cell >> 3] >> (7 - (cell & 7)) & 1, dtype=bool)

    def flags(self, bits: NDArray[np.uint8]) -> Flags:
        """Eight cells a byte -> one flag a cell."""
        return np.unpackbits(bits, axis=-1, count=self.count).view(bool)

    def arms_at(self) -> Ints:
        """How many grips each arm has at each cell ``[arms, cells]``."""
        arms = int(self.arm.max(initial=-1)) + 1
        first = np.searchsorted(self.arm, np.arange(arms + 1))
        ends = self.begin[first].tolist()
        return np.array([np.bincount(self.cells[a:b], minlength=self.count) for a, b in pairwise(ends)])

    def only(self, cells: Flags) -> CellGrips:
        """The same at some cells ``[cells]`` alone."""
        there = cells[self.cells]
        which = np.repeat(np.arange(len(self)), np.diff(self.begin))[there]
        left, begin = np.unique(which, return_index=True)
        begin = np.append(begin, len(which))
        rest = self.cells[there], self.lands[there], self.at[there], self.postures
        return CellGrips(self.arm[left], self.hold[left], self.branch[left], self.count, begin, *rest)

    def of_arm(self, arm: int) -> Ints:
        """Grips of an arm."""
        return np.nonzero(self.arm == arm)[0]

    def _bits(self, rows: Flags) -> NDArray[np.uint8]:
        out = np.zeros((len(self), -(-self.count // 8)), dtype=np.uint8)
        for grip, (a, b) in enumerate(pairwise(self.begin.tolist())):
            here = np.zeros(self.count, dtype=bool)
            here[self.cells[a:b]] = rows[a:b]
            out[grip] = np.packbits(here)
        return out


def cell_grips(walker: Walker, structure: Structure, cells: Cells) -> CellGrips:
    """Every arm on every hold at every cell."""
    limb, margins, about = limb_of(walker), walker.margins, around(walker, structure)
    free = about.bodies(cells.frames) == NONE_MET
    block = len(cells) // cells.shape[0]
    # What there is: arm, hold and branch in one number, cell, whether the hand may land; and joints
    codes, places = [np.zeros(0, dtype=np.int32)], [np.zeros(0, dtype=np.int32)]
    landing, joints = [np.zeros(0, dtype=bool)], [np.zeros((0, len(limb.position_limits)))]
    for arm in range(len(walker.arms)):
        base = walker.arms[arm].base.homogeneous
        for begin in range(0, len(cells), block):
            here = begin + np.nonzero(free[begin : begin + block])[0].astype(np.int32)
            if not len(here):
                continue
            frames = cells.frames[here] @ base
            among = near_holds(limb, structure, frames)
            quick = postures_at(about, arm, frames, among, margins)
            (poses, holds, branch, lands), q = (
                _postures(about, margins, arm, frames, among) if quick is None else (quick[0].T, quick[1])
            )
            codes.append(((arm * len(structure) + holds) * BRANCHES + branch).astype(np.int32))
            places.append(here[poses])
            landing.append(lands.astype(bool))
            joints.append(q)
    code, cell = np.concatenate(codes), np.concatenate(places)
    there = np.bincount(code, minlength=1)
    names = np.nonzero(there)[0]
    # Cells of a grip stay in their order
    order = np.argsort(code, kind="stable").astype(np.int32)
    ends = np.concatenate([[0], np.cumsum(there[names])])
    rest, branches = np.divmod(names, BRANCHES)
    arms, held_on = np.divmod(rest, len(structure))
    return CellGrips(
        arms,
        held_on,
        branches,
        len(cells),
        ends,
        cell[order],
        np.concatenate(landing)[order],
        order,
        np.concatenate(joints),
    )


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
