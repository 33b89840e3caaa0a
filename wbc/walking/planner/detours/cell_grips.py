"""At which cells a hand holds: for each arm, hold and branch of the wrist."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, pi

import numpy as np
from numpy.typing import NDArray

from wbc.multibody import pin
from wbc.robots import Margins, Walker
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.around import NONE_MET, Around, around
from wbc.walking.planner.detours.cells import Cells, Ints
from wbc.walking.planner.grips.held import held, near_holds
from wbc.walking.planner.grips.stretches import postures_at

#: Numbers of branches of an arm's wrist are below this
BRANCHES = 8
#: An arm is where another one is when that is turned, within [m]; and the body beside it, to so many digits of a metre
SAME, DIGITS = 1e-9, 6

Rows = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class CellGrips:
    """All (arm, hold, branch) that hold at some cell.

    Attributes:
        arm, hold: ``[grips]``. count: of cells.
        grip, cell: which grip holds at which cell ``[rows]``.
    """

    arm: Ints
    hold: Ints
    count: int
    grip: Rows
    cell: Rows

    def sets(self, arm: int) -> NDArray[np.uint64]:
        """At each cell the set of an arm's grips, a bit each ``[cells, words]``."""
        first, last = np.searchsorted(self.arm, [arm, arm + 1]).tolist()
        mine = (self.grip >= first) & (self.grip < last)
        bits = np.zeros((self.count, 64 * max(-(-(last - first) // 64), 1)), dtype=bool)
        bits[self.cell[mine], self.grip[mine] - first] = True
        return np.packbits(bits, axis=1).view(np.uint64)

    def at_any(self, cells: Ints) -> Ints:
        """Grips that hold at some of some cells."""
        some = np.zeros(self.count, dtype=bool)
        some[cells] = True
        return np.unique(self.grip[some[self.cell]])


def cell_grips(walker: Walker, structure: Structure, cells: Cells) -> CellGrips:
    """Every arm on every hold at every cell."""
    about = around(walker, structure)
    free = about.bodies(cells.frames) == NONE_MET
    codes, places = [np.zeros(0, dtype=np.int32)], [np.zeros(0, dtype=np.int32)]
    first = _of_arm(walker, about, cells, 0, free)
    for arm in range(len(walker.arms)):
        turned = _turned(about, cells, arm)
        code, place = _of_arm(walker, about, cells, arm, free) if turned is None else first
        if turned:
            # Where the first arm is when the body is turned by the angle between the two
            headings = cells.shape[3]
            place = place - place % headings + (place % headings - turned) % headings
            code, place = code[free[place]], place[free[place]]
        codes.append(arm * len(structure) * BRANCHES + code)
        places.append(place)
    # Arm, hold and branch in one number; they are few, and sorting their millions of rows would take seconds
    code = np.concatenate(codes)
    there = np.bincount(code, minlength=1) > 0
    names, numbers = np.nonzero(there)[0], np.cumsum(there, dtype=np.int32) - 1
    arms, holds = np.divmod(names // BRANCHES, len(structure))
    return CellGrips(arms, holds, len(cells), numbers[code], np.concatenate(places))


def _of_arm(walker: Walker, about: Around, cells: Cells, arm: int, free: NDArray[np.bool_]) -> tuple[Rows, Rows]:
    """Holds and branches of one arm, in one number, and cells, of those that are free."""
    limb, structure, base = about.limb, about.structure, walker.arms[arm].base.homogeneous
    codes, places = [np.zeros(0, dtype=np.int32)], [np.zeros(0, dtype=np.int32)]
    block = len(cells) // cells.shape[0]
    for begin in range(0, len(cells), block):
        here = begin + np.nonzero(free[begin : begin + block])[0].astype(np.int32)
        if not len(here):
            continue
        frames = cells.frames[here] @ base
        among = near_holds(limb, structure, frames)
        quick = postures_at(about, arm, frames, among, walker.margins)
        poses, holds, branch = _postures(about, walker.margins, arm, frames, among) if quick is None else quick.T
        codes.append((holds * BRANCHES + branch).astype(np.int32))
        places.append(here[poses])
    return np.concatenate(codes), np.concatenate(places)


def _turned(about: Around, cells: Cells, arm: int) -> int | None:
    """By how many headings an arm is turned from the first one about the body's z axis, with the same body about it;
    None: it is elsewhere.
    """
    steps, bases = cells.mesh.turns, about.bases
    angle = atan2(bases[arm, 1, 3], bases[arm, 0, 3]) - atan2(bases[0, 1, 3], bases[0, 0, 3])
    count = round(angle / (2.0 * pi) * steps)
    turn = pin.SE3(pin.utils.rotate("z", 2.0 * pi * count / steps), np.zeros(3)).homogeneous
    alike = np.abs(turn @ bases[0] - bases[arm]).max() < SAME and _beside(about, arm) == _beside(about, 0)
    return count if alike else None


def _beside(about: Around, arm: int) -> set[tuple[float, ...]]:
    """The capsules of the body beside an arm, in the frame of its base, whichever end comes first."""
    rows = about.own[arm][about.own[arm][:, 6] > 0.0].round(DIGITS) + 0.0
    return {(*min(a, b), *max(a, b), r) for a, b, r in ((tuple(x[:3]), tuple(x[3:6]), x[6]) for x in rows.tolist())}


def _postures(about: Around, margins: Margins, arm: int, frames: Array, among: Ints) -> tuple[Ints, Ints, Ints]:
    """Of an arm on some holds from frames of its base: frame, hold and branch."""
    limb = about.limb
    there = held(limb, about.structure, frames, among, reach=margins.cell_reach, facing=margins.facing)
    good = there.within(margins.cell_angle) & (limb.wrist_bend(there.q) > margins.landing_wrist)
    rows, branch = np.nonzero(good)
    clear = about.postures(arm, frames[there.pose[rows]], there.q[rows, branch], there.hold[rows]) == NONE_MET
    return there.pose[rows[clear]], there.hold[rows[clear]], branch[clear]
