"""The body's pose out of the holding hands: least squares over their closed chains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array
from wbc.walking.checker.holds import HoldTable

#: Length [m] that weighs angles against distances
LEVER = 0.3
#: Eigenvalues of the normal equations: along freedoms with less than the first the body stays as it was logged, along
#: those with more than the second it is where the hands have it. Hands on holds that let them tilt leave the turn about
#: the line between them nearly free, and what they are off their holds would count a thousand times in it
FREE, FIXED = 1e-5, 1e-3
#: Steps at most, and the step [m, rad] at which they end
STEPS, SMALL = 12, 1e-8
#: Eigenvalues of the normal equations below this are freedoms that no hand fixes
OPEN = 1e-6


@dataclass(frozen=True, eq=False)
class Bodies:
    """Poses [s, 3], [s, 3, 3] of the body, and ``open``: [s] whether the hands leave freedoms."""

    position: Array
    rotation: Array
    open: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Hands:
    """Hands [s, a, 3] and [s, a, 3, 3] in the body's frame, or in the structure's."""

    position: Array
    rotation: Array

    def placed(self, position: Array, rotation: Array) -> Hands:
        """Hands in the frame in which their body is at ``position`` [s, 3], ``rotation`` [s, 3, 3]."""
        turned = rotation[:, None] @ self.rotation
        return Hands((rotation[:, None] @ self.position[..., None])[..., 0] + position[:, None], turned)


def estimate(
    hands: Hands,
    hold: NDArray[np.int64],
    held: NDArray[np.bool_],
    table: HoldTable,
    position: Array,
    rotation: Array,
) -> Bodies:
    """min over the body's pose of the sum over holding hands of |p - P|^2 + LEVER^2 (|z - Z|^2 + |x - X|^2).

    The z axes count for holds with max_tilt = 0, the x axes for those whose roll is not free; where the hand may tilt
    too, only what turns it: the part of x along the y axis that its roll has. Gauss-Newton from the
    logged pose ``position`` [s, 3], ``rotation`` [s, 3, 3].

    Args:
        hands: in the body's frame. hold: [s, a] rows of ``table``; those of hands that do not hold are not read.
    """
    row = np.where(held, hold, 0)
    position, rotation, moved = position.copy(), rotation.copy(), np.zeros((len(position), 6))
    weights = [
        held.astype(float),
        LEVER * (held & (table.max_tilt[row] == 0.0)),
        LEVER * (held & (table.roll[row] > 0)),
    ]
    loose = np.zeros(len(position), dtype=bool)
    left = np.flatnonzero(held.any(axis=1))
    loose[:] = ~held.any(axis=1)
    for step in range(STEPS):
        if not len(left):
            break
        part = Hands(hands.position[left], hands.rotation[left])
        jacobian, error = _rows(part, row[left], [w[left] for w in weights], table, position[left], rotation[left])
        values, axes = np.linalg.eigh(np.swapaxes(jacobian, 1, 2) @ jacobian)
        back = np.swapaxes(axes, 1, 2)
        if step == 0:
            loose[left] = values[:, 0] < OPEN
        right = (back @ np.swapaxes(jacobian, 1, 2) @ error[..., None])[..., 0]
        so_far = (back @ moved[left, :, None])[..., 0]
        # Logarithmically between the two, so that no freedom comes or goes from one sample to the next
        values = np.maximum(values, FREE)
        part_fixed = np.clip(np.log(values / FREE) / np.log(FIXED / FREE), 0.0, 1.0)
        move = (axes @ (part_fixed * (so_far - right / values) - so_far)[..., None])[..., 0]
        moved[left] += move
        position[left] += move[:, :3]
        rotation[left] = _turn(move[:, 3:]) @ rotation[left]
        left = left[np.abs(move).max(axis=1) > SMALL]
    return Bodies(position, rotation, loose)


def single(hand: Array, turn: Array, table: HoldTable, hold: NDArray[np.int64], near: Array) -> tuple[Array, Array]:
    """Poses of the body from one hand on holds that fix all six freedoms: X = hold Rz(roll) hand^-1.

    Args:
        hand, turn: [s, 3], [s, 3, 3] in the body's frame. hold: [s]. near: [s, 3, 3], the hand in the structure's
            frame, which decides among the rolls of an n-fold hold.
    """
    x, z = table.references(hold, near), table.rotation[hold][:, :, 2]
    frame = np.stack([x, np.cross(z, x), z], axis=-1)
    rotation = frame @ np.swapaxes(turn, 1, 2)
    return table.position[hold] - (rotation @ hand[..., None])[..., 0], rotation


def _rows(
    hands: Hands, hold: NDArray[np.int64], weights: list[Array], table: HoldTable, position: Array, rotation: Array
) -> tuple[Array, Array]:
    """Weighted rows [s, 9 a, 6] and errors [s, 9 a]; columns: translation, then turn about the body's origin."""
    count, arms = hold.shape
    placed = hands.placed(np.zeros((count, 3)), rotation)
    frames = table.rotation[hold]
    wanted = (table.position[hold] - position[:, None], frames[..., 2], table.references(hold, placed.rotation))
    found = (placed.position, placed.rotation[..., 2], placed.rotation[..., 0])
    jacobian, error = np.zeros((count, arms, 3, 3, 6)), np.zeros((count, arms, 3, 3))
    for k, weight in enumerate(weights):
        # A turn w moves a vector r by w x r = -[r]x w
        jacobian[:, :, k, :, 3:] = -weight[..., None, None] * _cross(found[k])
        error[:, :, k] = weight[..., None] * (found[k] - wanted[k])
    y = np.cross(wanted[1], wanted[2])
    onto = np.where((table.max_tilt[hold] > 0.0)[..., None, None], y[..., :, None] * y[..., None, :], np.eye(3))
    jacobian[:, :, 2] = onto @ jacobian[:, :, 2]
    error[:, :, 2] = (onto @ error[:, :, 2, :, None])[..., 0]
    jacobian[:, :, 0, :, :3] = weights[0][..., None, None] * np.eye(3)
    return jacobian.reshape(count, -1, 6), error.reshape(count, -1)


def _cross(r: Array) -> Array:
    """[r]x, [..., 3, 3]."""
    out = np.zeros((*r.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -r[..., 2], r[..., 1], -r[..., 0]
    return np.asarray(out - np.swapaxes(out, -1, -2))


def _turn(w: Array) -> Array:
    """exp([w]x) by Rodrigues' formula, [s, 3, 3]."""
    angle = np.linalg.norm(w, axis=1)[:, None, None]
    k = _cross(w)
    safe = np.where(angle > 1e-8, angle, 1.0)
    first = np.where(angle > 1e-8, np.sin(safe) / safe, 1.0)
    second = np.where(angle > 1e-8, (1.0 - np.cos(safe)) / safe**2, 0.5)
    out: Array = np.eye(3) + first * k + second * (k @ k)
    return out
