"""Body poses about a path: stations along it, beside it, higher and lower, turned."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, pi, radians

import numpy as np
from numpy.typing import NDArray

from wbc.multibody import pin
from wbc.robots import BodyLimb
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure

Ints = NDArray[np.int64]

#: A turn that counts as much as the step from station to station [rad]
TURN = radians(15.0)


@dataclass(frozen=True)
class CellSpacing:
    """How far cells are apart.

    Attributes:
        step: from station to station along the path [m]. side: from cell to cell beside it [m].
        beside: cells on each side of the path.
        lower: into the structure, from the path [m]; one is 0.
        turns: headings in a turn.
    """

    step: float
    side: float
    beside: int
    lower: tuple[float, ...]
    turns: int

    def of(self, limb: BodyLimb, arms: int) -> CellSpacing:
        """As large for an arm as this one is for a PUMA 600; turned from heading to heading, each of some arms comes to
        where the first one was.
        """
        scale = round(limb.hand_span / HAND_SPAN, 9)
        lower = tuple(scale * height for height in self.lower)
        turns = ceil(self.turns / arms) * arms
        return CellSpacing(scale * self.step, scale * self.side, self.beside, lower, turns)


#: Reach of the arm that the meshes below were chosen for, a PUMA 600 from neck to hand [m]
HAND_SPAN = 1.1684
#: Along the path alone, as closely a little beside it, far beside it, and beside it through gaps that are little wider
#: than the body; 54 to 44 in for a path at 52 in
ALONG = CellSpacing(0.1175, 0.0, 0, tuple(inch * 0.0254 for inch in (-2.0, 0.0, 2.0, 4.0, 6.0, 8.0)), 24)
BESIDE = replace(ALONG, side=0.2, beside=2)
WIDE = CellSpacing(0.14, 0.2, 7, tuple(inch * 0.0254 for inch in (-2.0, 0.0, 4.0, 8.0)), 18)
NARROW = CellSpacing(0.12, 0.1, 12, tuple(inch * 0.0254 for inch in (-2.0, 0.0, 3.0, 6.0, 8.0)), 24)


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells (station, side, lower, turned), numbered in this order; after the last heading comes the first.

    Attributes:
        mesh: how far they are apart. shape: how many there are of each.
        frames: of the body ``[cells, 4, 4]`` [m].
        at: path time of each station [s].
    """

    mesh: CellSpacing
    shape: tuple[int, int, int, int]
    frames: Array
    at: Array

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def start(self) -> int:
        """The path's first pose."""
        return self._plain(0)

    @property
    def goal(self) -> int:
        """The path's last pose."""
        return self._plain(self.shape[0] - 1)

    def offsets(self, cells: Ints) -> Array:
        """(path time [s], side [m], lower [m], turned from -pi to pi [rad]) ``[n, 4]``."""
        station, side, lower, turned = np.unravel_index(cells, self.shape)
        mesh, half = self.mesh, self.shape[3] // 2
        turn = ((turned + half) % self.shape[3] - half) * (2.0 * pi / mesh.turns)
        place = self.at[station], (side - mesh.beside) * mesh.side, np.array(mesh.lower)[lower], turn
        return np.stack(place, axis=-1)

    def _plain(self, station: int) -> int:
        return int(np.ravel_multi_index((station, self.mesh.beside, self.mesh.lower.index(0.0), 0), self.shape))


def cells_about(path: BodyPath, structure: Structure, mesh: CellSpacing) -> Cells:
    """Cells about a path."""
    at = stations(path, mesh.step)
    sides = [k * mesh.side for k in range(-mesh.beside, mesh.beside + 1)]
    turned = [2.0 * pi * k / mesh.turns for k in range(mesh.turns)]
    offsets = np.array([[_offset(lower, turn) for turn in turned] for lower in mesh.lower])
    poses = path.blended(at / path.spacing)
    ahead = np.gradient(poses[:, :3, 3], axis=0) if len(at) > 1 else np.zeros((1, 3))
    out = np.empty((len(at), len(sides), *offsets.shape))
    for k, pose in enumerate(poses):
        # Between samples the blended matrix is nearly a rotation
        u, _, v = np.linalg.svd(pose[:3, :3])
        middle = pin.SE3(u @ v, pose[:3, 3])
        for j, side in enumerate(sides):
            there = beside_of(middle, ahead[k], side, structure).homogeneous
            out[k, j] = there @ offsets
    shape = (len(at), len(sides), len(mesh.lower), mesh.turns)
    return Cells(mesh, shape, out.reshape(-1, 4, 4), at)


def stations(path: BodyPath, step: float) -> Array:
    """Path times that are about ``step`` [m] or :data:`TURN` apart, the first and the last included [s]."""
    poses = path.poses
    moved = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    cosine = (np.einsum("nij,nij->n", poses[1:, :3, :3], poses[:-1, :3, :3]) - 1.0) / 2.0
    far = np.maximum(moved / step, np.arccos(np.clip(cosine, -1.0, 1.0)) / TURN)
    # Samples that stand still add (nearly) no length
    total = np.concatenate([[0.0], np.cumsum(far + 1e-9)])
    count = max(round(total[-1]), 1)
    return np.asarray(np.interp(np.linspace(0.0, total[-1], count + 1), total, np.arange(len(poses)) * path.spacing))


def beside_of(pose: pin.SE3, ahead: Array, side: float, structure: Structure) -> pin.SE3:
    """A pose beside another, at the same height above the surface, turned as the normal is."""
    z = pose.rotation[:, 2]
    across = np.cross(z, ahead - (ahead @ z) * z)
    length = float(np.linalg.norm(across))
    across = across / length if length > 1e-9 else pose.rotation[:, 1]
    place, surface = pose.translation + side * across, structure.surface
    if surface is None or side == 0.0:
        return pin.SE3(pose.rotation, place)
    before, after = surface.normal(pose.translation), surface.normal(place)
    place = place + (surface.height(pose.translation) - surface.height(place)) * after
    return pin.SE3(pin.Quaternion.FromTwoVectors(before, after).toRotationMatrix() @ pose.rotation, place)


def _offset(lower: float, turned: float) -> Array:
    return np.array(pin.SE3(pin.utils.rotate("z", turned), np.array([0.0, 0.0, lower])).homogeneous)
