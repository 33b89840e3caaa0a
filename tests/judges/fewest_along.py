"""The fewest re-grasps along given poses of the body: an exact oracle for planners that follow a path."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians

import numpy as np
import pinocchio as pin

from tests.judges.arm_room import Flags, Ints, clear_between, room_alone
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.holds.structure import Structure

#: Between two poses that are looked at no joint of a hand that holds goes further [rad]
STEP = radians(60.0)


@dataclass(frozen=True, eq=False)
class _Held:
    """What an arm can hold along the poses.

    Attributes:
        hold, branch: of each grip ``[n]``. fits: at each pose ``[n, poses]``. joined: from each pose to the next
            ``[n, poses - 1]``. points: named points in the body's frame, turned so that the arm is the first
            ``[n, poses, 6, 3]``.
    """

    hold: Ints
    branch: Ints
    fits: Flags
    joined: Flags
    points: Array


def fewest_along(
    machine: Walker, structure: Structure, poses: Array, angle_room: float = 0.0, reach_room: float = 0.0
) -> int | None:
    """The fewest re-grasps with which a body with three arms can go along poses ``[n, 4, 4]``, None if it cannot.

    Let N_k(g, h, p) say that grips g and h of two arms carry the body at pose p while the third arm makes re-grasp k.
    The third lands on x where (g, x) and (h, x) hold together too, and then any of the three lifts:

        N_k+1(g, x, p) = (g, x hold at p) and some h: N_k(g, h, p) and (h, x hold at p)

    and N carries the body on from p to p + 1 while both grips last. All three hands hold at the first and last pose.
    Arms keep their clearance from each other, body and structure at each pose; between poses nothing is looked at.

    Args:
        angle_room, reach_room: what joints 1 to 5 keep of their limits [rad], and the wrist of its reach [m].
    """
    room = angle_room, reach_room
    held = [_held(machine, structure, poses, room, arm) for arm in range(3)]
    together = [_together(machine, held[arm], held[(arm + 1) % 3]) for arm in range(3)]
    joined = [held[k].joined[:, None] & held[(k + 1) % 3].joined[None] for k in range(3)]
    return _count(together, joined)


def _count(together: list[Flags], joined: list[Flags]) -> int | None:
    """Levels until the last pose; entry k of the lists is of arm k and the next."""
    whole = [together[k].all(axis=2) & joined[k].all(axis=2) for k in range(3)]
    if (_product(whole[0], whole[1]) & whole[2].T).any():
        return 0
    begin = [table[:, :, 0] for table in together]
    carried = [np.zeros_like(table) for table in together]
    for k in range(3):
        # Two hands that lift the third had it on some hold
        carried[k][:, :, 0] = begin[k] & _product(begin[(k + 1) % 3], begin[(k + 2) % 3]).T
    known, count = 0, 0
    while True:
        for k in range(3):
            _carry(carried[k], together[k], joined[k])
        found = sum(int(table.sum()) for table in carried)
        if found == known:
            return None
        known, count = found, count + 1
        landed = _landed(carried, together)
        if any(table[:, :, -1].any() for table in landed):
            return count
        carried = [carried[k] | landed[k] for k in range(3)]


def _landed(carried: list[Flags], together: list[Flags]) -> list[Flags]:
    """Pairs with one of the two that carried, and the third where it landed."""
    out = [np.zeros_like(table) for table in together]
    for k in range(3):
        after, before = (k + 1) % 3, (k + 2) % 3
        for pose in range(together[0].shape[2]):
            two = carried[k][:, :, pose]
            if two.any():
                third, back = together[after][:, :, pose], together[before][:, :, pose]
                out[after][:, :, pose] |= _product(two.T, back.T) & third
                out[before][:, :, pose] |= _product(third.T, two.T) & back
    return out


def _carry(table: Flags, together: Flags, joined: Flags) -> None:
    """Spreads along the poses, in place."""
    for pose in range(table.shape[2] - 1):
        table[:, :, pose + 1] |= table[:, :, pose] & joined[:, :, pose] & together[:, :, pose + 1]


def _product(one: Flags, other: Flags) -> Flags:
    """Whether some k makes one[i, k] and other[k, j] true."""
    out: Flags = one.astype(np.float32) @ other.astype(np.float32) > 0.5
    return out


def _held(machine: Walker, structure: Structure, frames: Array, room: tuple[float, float], arm: int) -> _Held:
    """Grips of an arm that fit at some pose."""
    kinematics = ArmKinematics(machine.arm_data)
    turn = pin.SE3(pin.utils.rotate("z", 2 * pi * arm / 3), np.zeros(3)).homogeneous
    body, base = frames @ turn, machine.arms[0].base.homogeneous
    bases = body @ base
    count, holds = len(frames), len(structure)
    points = np.einsum("nji,nhj->nhi", bases[:, :3, :3], structure.positions[None] - bases[:, None, :3, 3])
    axes = np.einsum("nji,hj->nhi", bases[:, :3, :3], structure.axes)
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    reach = kinematics.wrist_reach(kinematics.wrist_of(points, axes))
    postures, solved = kinematics.inverse_axis(points.reshape(-1, 3), axes.reshape(-1, 3), limits=False)
    margins = kinematics.margins(postures)
    fits = solved & (margins[..., 6:] >= 0.0).all(axis=-1)
    fits &= (margins[..., :5] >= room[0]).all(axis=-1)
    fits &= reach.reshape(-1)[:, None] >= room[1]
    named = kinematics.points(postures) @ base[:3, :3].T + base[:3, 3]
    rows, branches = np.nonzero(fits)
    near, where = named[rows, branches], body[rows // holds]
    outside = np.einsum("nij,nkj->nki", where[:, :3, :3], near) + where[:, None, :3, 3]
    fits[rows, branches] = room_alone(machine, near, outside, structure) >= 0.0
    shape = (count, holds, 2)
    grips = np.argwhere(fits.reshape(shape).any(axis=0))
    chosen = np.s_[:, grips[:, 0], grips[:, 1]]
    q = postures.reshape(*shape, 6)[chosen].swapaxes(0, 1)
    smooth = np.abs(np.diff(q[..., :5], axis=1)).max(axis=-1, initial=0.0) <= STEP
    return _Held(
        grips[:, 0],
        grips[:, 1],
        fits.reshape(shape)[chosen].T,
        smooth,
        named.reshape(*shape, 6, 3)[chosen].swapaxes(0, 1),
    )


def _together(machine: Walker, one: _Held, other: _Held) -> Flags:
    """Whether grips of an arm and of the next hold together, ``[n, m, poses]``."""
    out: Flags = one.fits[:, None] & other.fits[None] & (one.hold[:, None] != other.hold)[:, :, None]
    i, j, pose = np.nonzero(out)
    count = out.shape[2]
    points = np.concatenate([held.points.reshape(-1, 6, 3) for held in (one, other)])
    second = (len(one.hold) + j) * count + pose
    out[i, j, pose] = clear_between(machine, points, i * count + pose, second)
    return out
