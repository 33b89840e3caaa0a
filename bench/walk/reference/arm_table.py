"""At which poses of the body an arm can hold a hold: one bit a relative pose, as the cylinder is the same everywhere.

Moving by T turns about the cylinder's axis, moving by A shifts along it; both leave the cylinder as it is. So one table
over the pose relative to the hold serves all holds, and, as the body is the same after a third of a turn, all arms: arm
k at a heading stands where arm 1 is at the heading 120 k degrees further.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from bench.walk.reference.lattice import FAR, HEADINGS, SIDE, Lattice
from bench.walk.reference.room import room_alone
from bench.walk.reference.rules import Rules
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.holds.built_in import RADIUS, grid_pose
from wbc.walking.holds.surface import CylinderSurface

Flags = NDArray[np.bool_]

#: Middles of the faces of a box about a cell, and its corners, in halves of a cell
FACES = np.concatenate([np.eye(4, dtype=np.int64), -np.eye(4, dtype=np.int64)])
CORNERS = np.array(list(product((-1, 1), repeat=4)), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class ArmTable:
    """Arm 1 on the hold (0, 0).

    Attributes:
        fits: ``[branches, heights, headings, SIDE, SIDE]``; the last two are 4 (T - T_hold) + FAR and 4 (A - A_hold) +
            FAR. Without branches in the rules there is one.
        postures: ``[2, heights, headings, SIDE, SIDE, 6]`` [rad], joint 6 at 0; finite everywhere.
        points: the points O, N, S, E, W, H in the body's frame, ``[2, heights, headings, SIDE, SIDE, 6, 3]`` [m].
    """

    fits: Flags
    postures: Array
    points: Array


def arm_table(walker: Walker, lattice: Lattice, rules: Rules) -> ArmTable:
    """The table of a walker with three arms."""
    shape = (len(lattice.heights), HEADINGS, SIDE, SIDE)
    cells = np.stack([k.ravel() for k in np.indices(shape)], axis=-1).astype(np.int64)
    cells[:, 2:] -= FAR
    fits, postures, named, frames = _held(walker, lattice, rules, cells)
    if rules.collisions:
        surface = CylinderSurface(pin.SE3.Identity(), RADIUS)
        rows, branches = np.nonzero(fits)
        near = named[rows, branches]
        outside = np.einsum("nij,nkj->nki", frames[rows, :3, :3], near) + frames[rows, None, :3, 3]
        fits[rows, branches] = room_alone(walker, near, outside, surface) >= 0.0
    table: Flags = fits.T.reshape(2, *shape)
    if not rules.branches:
        table = np.asarray(table.any(axis=0))[None]
    if rules.dilated:
        wide = _dilated(table)
        if rules.dilated < 1.0:
            _sample(walker, lattice, rules, table, wide)
        else:
            table = wide
    return ArmTable(
        table,
        np.moveaxis(postures, 1, 0).reshape(2, *shape, 6),
        np.moveaxis(named, 1, 0).reshape(2, *shape, 6, 3),
    )


def _held(walker: Walker, lattice: Lattice, rules: Rules, cells: Any) -> tuple[Flags, Array, Array, Array]:
    """Whether both branches hold at cells ``[n, 2]``; postures, points in the body's frame, and body frames."""
    kinematics = ArmKinematics(walker.arm_data)
    frames = lattice.frames(cells)
    base = walker.arms[0].base.homogeneous
    arm_frames = frames @ base
    hold = grid_pose(0.0, 0.0)
    turned = np.swapaxes(arm_frames[:, :3, :3], 1, 2)
    points = np.einsum("nij,nj->ni", turned, hold.translation - arm_frames[:, :3, 3])
    axes = np.einsum("nij,j->ni", turned, hold.rotation[:, 2])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    postures, solved = kinematics.inverse_axis(points, axes, limits=False)
    limits = np.array(kinematics.data.position_limits[:5])
    reach = kinematics.wrist_reach(kinematics.wrist_of(points, axes))
    fits = (reach >= rules.reach_room)[:, None] & np.ones(2, dtype=bool)
    margins = kinematics.margins(postures)
    # Joint 6 turns the hand about its own axis, which is free; where there is no solution, the arm is straight
    fits &= (margins[..., :5] >= (1.0 - rules.limit_part) * limits + rules.angle_room).all(axis=-1)
    if rules.reach_room >= 0.0:
        fits &= solved & (margins[..., 6:] >= 0.0).all(axis=-1)
    return fits, postures, kinematics.points(postures) @ base[:3, :3].T + base[:3, 3], frames


def _sample(walker: Walker, lattice: Lattice, rules: Rules, table: Flags, wide: Flags) -> None:
    """Adds to a table the cells whose boxes have corners or middles of faces that can be held."""
    for offsets in (FACES, CORNERS):
        cells = np.argwhere(wide[0] & ~table[0])
        cells[:, 2:] -= FAR
        # Twice the cells: corners and middles of faces are whole numbers, shared by boxes
        twice = 2 * cells[:, None] + offsets
        twice[..., 0] = np.clip(twice[..., 0], 0, 2 * (len(lattice.heights) - 1))
        twice[..., 1] %= 2 * HEADINGS
        points, back = np.unique(twice.reshape(-1, 4), axis=0, return_inverse=True)
        fits = np.asarray(_held(walker, lattice, rules, points / 2.0)[0].any(axis=1))
        good = fits[back.reshape(-1)].reshape(len(cells), -1).any(axis=1)
        height, heading, x, y = cells[good].T
        table[0, height, heading, x + FAR, y + FAR] = True


def _dilated(fits: Flags) -> Flags:
    """What is so at a cell or at one of its neighbours, diagonal ones included."""
    for axis in (1, 2, 3, 4):
        out = fits.copy()
        for step in (-1, 1):
            moved = np.roll(fits, step, axis=axis)
            if axis != 2:  # only headings close in a circle
                moved[tuple([slice(None)] * axis + [0 if step == 1 else -1])] = False
            out |= moved
        fits = out
    return fits
