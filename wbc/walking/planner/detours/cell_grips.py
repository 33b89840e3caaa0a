"""Which cells let a hand hold: one bit a cell for each arm, hold and branch of the wrist."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.detours.cells import Cells, Ints

Flags = NDArray[np.bool_]

#: What a cell keeps of the limits, as between cells there is less: angle [rad] and reach [m]
ANGLE_ROOM, REACH_ROOM = radians(4.0), 0.4 * 0.0254
#: |sin theta5| of a cell: the wrist's branch is clear
BENT = 0.08
#: Reach [m], and distance from the axis of joint 1 [m], of a hand that is to lift or land
LANDING_REACH, LANDING_AXIS = 0.9 * 0.0254, 7.6 * 0.0254
#: The hand's approach and the body's z axis enclose less than 60 degrees: arms do not reach round the body
LEAST_FACING = 0.5


@dataclass(frozen=True, eq=False)
class CellGrips:
    """All (arm, hold, branch) that hold at some cell.

    Attributes:
        arm, hold, branch: ``[grips]``.
        fits: at each cell ``[grips, cells]``. lands: a hand may land there.
        row: of :attr:`postures` ``[grips, cells]``; -1 where it does not fit.
        postures: ``[rows, 6]`` [rad].
    """

    arm: Ints
    hold: Ints
    branch: Ints
    fits: Flags
    lands: Flags
    row: NDArray[np.int32]
    postures: Array

    def of_arm(self, arm: int) -> Ints:
        """Grips of an arm."""
        return np.nonzero(self.arm == arm)[0]


def cell_grips(walker: Walker, structure: Structure, cells: Cells) -> CellGrips:
    """Closed-form inverse kinematics of every arm on every hold at every cell."""
    kinematics = ArmKinematics(walker.data)  # type: ignore[arg-type]
    block = len(cells) // cells.shape[0]
    parts, found = list[Array](), list[tuple[Ints, Array, Flags]]()
    for arm in range(len(walker.arms)):
        base = walker.arms[arm].base.homogeneous
        for begin in range(0, len(cells), block):
            frames = cells.frames[begin : begin + block] @ base
            keys, q, lands = _held(kinematics, structure, frames)
            keys[:, 0] += begin
            found.append((np.column_stack([np.full(len(keys), arm), keys]), q, lands))
            parts.append(q)
    keys = np.concatenate([part[0] for part in found])
    lands = np.concatenate([part[2] for part in found])
    packed = (keys[:, 0] * len(structure) + keys[:, 2]) * 2 + keys[:, 3]
    there = np.bincount(packed, minlength=len(walker.arms) * len(structure) * 2) > 0
    names, number = np.nonzero(there)[0], (np.cumsum(there) - 1)[packed]
    row = np.full((len(names), len(cells)), -1, dtype=np.int32)
    row[number, keys[:, 1]] = np.arange(len(keys), dtype=np.int32)
    landing = np.zeros(row.shape, dtype=bool)
    landing[number, keys[:, 1]] = lands
    rest, branches = np.divmod(names, 2)
    arms, holds = np.divmod(rest, len(structure))
    return CellGrips(arms, holds, branches, row >= 0, landing, row, np.concatenate(parts))


def _held(kinematics: ArmKinematics, structure: Structure, frames: Array) -> tuple[Ints, Array, Flags]:
    """(cell, hold, branch) ``[n, 3]`` that fit, their postures, and whether a hand may land."""
    data = kinematics.data
    far = data.shoulder_offset + data.upper_arm_length + data.forearm_length + data.hand_length
    neck = frames[:, :3, 3] + data.neck_length * frames[:, :3, 2]
    square = (neck**2).sum(1)[:, None] - 2 * neck @ structure.positions.T + (structure.positions**2).sum(1)
    cell, hold = np.nonzero(square < far**2)
    turn = frames[cell, :3, :3]
    points = np.einsum("nji,nj->ni", turn, structure.positions[hold] - frames[cell, :3, 3])
    axes = np.einsum("nji,nj->ni", turn, structure.axes[hold])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    wrist = kinematics.wrist_of(points, axes)
    reach = kinematics.wrist_reach(wrist)
    near = (reach > REACH_ROOM) & (axes[:, 2] > LEAST_FACING)
    postures, solved = kinematics.inverse_axis(points[near], axes[near])
    margins = kinematics.margins(postures)
    margins[..., 5] = np.inf  # joint 6 turns the hand about its own axis, which is free
    good = solved & (margins.min(axis=-1) > ANGLE_ROOM) & (np.abs(np.sin(postures[..., 4])) > BENT)
    rows, branch = np.nonzero(good)
    lands = (reach[near] > LANDING_REACH) & (np.hypot(wrist[near, 0], wrist[near, 1]) > LANDING_AXIS)
    keys = np.column_stack([cell[near][rows], hold[near][rows], branch])
    return keys, postures[rows, branch], lands[rows]
