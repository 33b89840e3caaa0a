"""Whether a hand can swing from hold to hold while the body stands at a cell."""

from __future__ import annotations

import numpy as np

from wbc.robots import Walker
from wbc.walking.arms.puma import limb_of
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.detours.cell_grips import CellGrips, Flags, may_land
from wbc.walking.planner.detours.cells import Cells, Ints

#: Points of a swing that are looked at, as parts of it: before, the body may be elsewhere
PARTS = np.linspace(0.5, 1.0, 5)


class CellSwings:
    """Swings over an arch whose top is 0.75 of the lift height above the chord."""

    def __init__(self, walker: Walker, structure: Structure, cells: Cells, grips: CellGrips) -> None:
        self._structure, self._cells, self._grips = structure, cells, grips
        self._limb, self._margins = limb_of(walker), walker.margins
        self._bases = [arm.base.homogeneous for arm in walker.arms]
        self._height = walker.tolerances.lift_height
        # The guided joints go from posture to posture, which are within their limits
        self._limits = np.array(self._limb.position_limits)[: self._limb.guided] - self._margins.cell_swing_angle

    def possible(self, cells: Ints, source: int, target: int) -> Flags:
        """At cells, between the holds of two grips of one arm."""
        grips, structure, limb = self._grips, self._structure, self._limb
        a, b = (structure.positions[grips.hold[g]] for g in (source, target))
        za, zb = (structure.axes[grips.hold[g]] for g in (source, target))
        part = PARTS[:, None]
        axis = za + part * (zb - za)
        axis /= np.maximum(np.linalg.norm(axis, axis=1), 1e-9)[:, None]
        places = a + part * (b - a) - 4.0 * self._height * part * (1.0 - part) * axis
        frames = self._cells.frames[cells] @ self._bases[int(grips.arm[source])]
        points = np.einsum("nji,nmj->nmi", frames[:, :3, :3], places - frames[:, None, :3, 3])
        axes = np.einsum("nji,mj->nmi", frames[:, :3, :3], axis)
        wrists = limb.wrist_of(points, axes)
        out = may_land(self._margins, limb.wrist_reach(wrists), wrists).all(axis=1)
        postures, _ = limb.held(points.reshape(-1, 3), axes.reshape(-1, 3))
        angles = postures[:, 0, : limb.guided].reshape(*points.shape[:2], limb.guided)
        return np.asarray(out & (np.abs(np.unwrap(angles, axis=1)) < self._limits).all(axis=(1, 2)))
