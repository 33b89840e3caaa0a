"""Whether a hand can swing from hold to hold while the body stands at a cell."""

from __future__ import annotations

import numpy as np

from wbc.robots import Walker
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.detours.cell_grips import LANDING_AXIS, LANDING_REACH, CellGrips, Flags
from wbc.walking.planner.detours.cells import Cells, Ints

#: Points of a way that are looked at, as parts of it: before, the body may be elsewhere
PARTS = np.linspace(0.5, 1.0, 5)
#: Joints 1 to 3 keep so much of their limits [rad]
ANGLE_ROOM = 0.04


class CellSwings:
    """Swings over an arch whose top is 0.75 of the lift height above the chord."""

    def __init__(self, walker: Walker, structure: Structure, cells: Cells, grips: CellGrips) -> None:
        self._structure, self._cells, self._grips = structure, cells, grips
        self._kinematics = ArmKinematics(walker.data)  # type: ignore[arg-type]
        self._bases = [arm.base.homogeneous for arm in walker.arms]
        self._height = walker.data.lift_height  # type: ignore[union-attr]
        self._limits = np.array(self._kinematics.data.position_limits)[:3] - ANGLE_ROOM

    def possible(self, cells: Ints, source: int, target: int) -> Flags:
        """At cells, between the holds of two grips of one arm."""
        grips, structure = self._grips, self._structure
        a, b = (structure.positions[grips.hold[g]] for g in (source, target))
        za, zb = (structure.axes[grips.hold[g]] for g in (source, target))
        part = PARTS[:, None]
        axis = za + part * (zb - za)
        axis /= np.maximum(np.linalg.norm(axis, axis=1), 1e-9)[:, None]
        places = a + part * (b - a) - 4.0 * self._height * part * (1.0 - part) * axis
        frames = self._cells.frames[cells] @ self._bases[int(grips.arm[source])]
        points = np.einsum("nji,nmj->nmi", frames[:, :3, :3], places - frames[:, None, :3, 3])
        axes = np.einsum("nji,mj->nmi", frames[:, :3, :3], axis)
        wrists = self._kinematics.wrist_of(points, axes)
        out = (self._kinematics.wrist_reach(wrists) > LANDING_REACH).all(axis=1)
        out &= (np.hypot(wrists[..., 0], wrists[..., 1]) > LANDING_AXIS).all(axis=1)
        flat, _ = self._kinematics.inverse_axis(points.reshape(-1, 3), axes.reshape(-1, 3), limits=False)
        angles = np.unwrap(flat[:, 0, :3].reshape(points.shape), axis=1)
        return np.asarray(out & (np.abs(angles) < self._limits).all(axis=(1, 2)))
