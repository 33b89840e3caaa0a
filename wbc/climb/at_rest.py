"""Where a robot stands whose description says of no posture that it does."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np

from wbc.climb.climber import Climber
from wbc.climb.idle_joints import aside
from wbc.climb.reach import LimbReach
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Heights of the body that are tried, as parts of the length of its shortest limb
STANDING_HEIGHTS = np.linspace(0.95, 0.25, 15)
#: Postures of a limb that are compared at a height
BRANCHES = 8
#: Distance from a joint's limits from which more counts no longer [rad or m]
ROOM_ENOUGH = 0.3
#: Of the best height's worth: a body that is higher asks less of motors and has more room below it
WORTH_KEPT = 0.8
#: What a posture as far from rest as a joint turns once counts, beside bearing: it decides between mirror images alone
MIRRORED = 1e-3


def standing(climber: Climber) -> Climber:
    """The same climber, at rest where all limbs hold on one plane below the body, each under that joint of its own that
    is farthest from the centre of mass, and at the largest height that has :data:`WORTH_KEPT` of the largest

        min over limbs of  min(sigma_min(J) / length, distance from limits of joints / ROOM_ENOUGH)

    J: of the contact's position by the limb's angles; length: of the limb stretched out. Knees are bent by about a
    right angle then. Where limbs have no such postures it rests as before. Joints of no limb are as of :func:`aside`.
    """
    model, reach = climber.robot.model, LimbReach(climber)
    body, data, every = climber.body_pose(climber.rest), model.createData(), range(len(climber.limbs))
    middle = climber.center_of_mass(climber.rest)
    pin.forwardKinematics(model, data, climber.rest)
    lengths = [numbers.length for numbers in reach.table.numbers]
    heights, found = STANDING_HEIGHTS * min(lengths), list[tuple[Array, Array]]()
    for limb in every:
        kind, joints = climber.limbs[limb].contact, [data.oMi[joint].translation for joint in climber.chains[limb]]
        below = max(joints, key=lambda point: float(np.linalg.norm((point - middle)[:2])))
        upright = _upright(climber.contact_pose(climber.rest, limb))
        ground = [pin.SE3(np.eye(3), np.array([*below[:2], middle[2] - height])) for height in heights]
        wanted = [body.actInv(pin.SE3(upright, kind.held_at(pose).translation)) for pose in ground]
        angles, solved = reach.postures(limb, np.array([place(pose) for pose in wanted]), count=BRANCHES)
        worth = np.where(solved, _worth(climber, limb, angles, lengths[limb]), -np.inf)
        best = worth.argmax(axis=1)
        found.append((angles[np.arange(len(best)), best], worth.max(axis=1)))
    least = np.min([worth for _, worth in found], axis=0)
    if not (most := float(least.max())) > 0.0:
        return climber
    row = int(np.flatnonzero(least >= WORTH_KEPT * most)[0])
    rest = reduce(lambda q, limb: climber.with_limb(q, limb, found[limb][0][row]), every, climber.rest)
    stands = replace(climber, rest=rest)
    return replace(stands, rest=aside(stands, min(lengths)))


def _upright(tip: pin.SE3) -> Array:
    """A contact's rotation with z up, and x ahead as it is."""
    ahead = tip.rotation[:, 0] * [1.0, 1.0, 0.0]
    if (length := float(np.linalg.norm(ahead))) < 1e-3:
        ahead, length = np.array([1.0, 0.0, 0.0]), 1.0
    x, z = ahead / length, np.array([0.0, 0.0, 1.0])
    return np.column_stack([x, np.cross(z, x), z])


def _worth(climber: Climber, limb: int, angles: Array, length: float) -> Array:
    """How well postures ``(n, count, k)`` of a limb bear and move ``(n, count)``, see :func:`standing`."""
    low, high = climber.limits[limb]
    room = np.minimum(np.minimum(angles - low, high - angles).min(axis=2) / ROOM_ENOUGH, 1.0)
    robot, frame, rows = climber.robot, climber.limbs[limb].frame, climber.joints(limb)
    far = np.abs(angles - climber.angles(climber.rest, limb)).max(axis=2)
    bent = np.empty(angles.shape[:2])
    for posture in np.ndindex(*bent.shape):
        q = climber.with_limb(climber.rest, limb, angles[posture])
        least = np.linalg.svd(robot.jacobian(q, frame)[:3, rows], compute_uv=False)[-1]
        bent[posture] = least / length if length else 0.0
    return np.asarray(np.minimum(bent, room) - MIRRORED * far / (2.0 * np.pi))
