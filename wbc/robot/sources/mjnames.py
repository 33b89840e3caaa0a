"""Names of bodies, joints and sites of a ``mujoco.MjModel``, made unique where the file does not; joints' numbers."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wbc.multibody import own
from wbc.rotations import TO_PINOCCHIO
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

#: What Pinocchio calls the fixed root, as a joint and as a frame, and what it is called here
UNIVERSE = "universe"
_RESERVED = (UNIVERSE, "world")
#: MuJoCo's kinds of joints (``mjtJoint``)
FREE = 0
BALL = 1
SLIDE = 2
HINGE = 3
SIZES = {FREE: (7, 6), BALL: (4, 3), SLIDE: (1, 1), HINGE: (1, 1)}


@dataclass(frozen=True)
class MjNames:
    """A name for each body, joint and site, by MuJoCo's number of it.

    Attributes:
        bodies: the world is :data:`UNIVERSE`; a body without a name has its number.
        joints: one without a name has that of its body, with ``_joint``, its number where there are several, or
            ``_free``.
        sites: ``""`` where the file gives none; one that shares its name with a body or joint has ``_site`` appended.
    """

    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    sites: tuple[str, ...]


def names_of(model: mujoco.MjModel) -> MjNames:
    """The names in a model: each once among bodies, among joints, and those of sites once among all three."""
    bodies = _unique(
        [str(model.body(b).name) for b in range(1, model.nbody)],
        [f"body{b}" for b in range(1, model.nbody)],
        _RESERVED,
        "_body",
    )
    bodies = [UNIVERSE, *bodies]
    made = []
    for j in range(model.njnt):
        body = int(model.jnt_bodyid[j])
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        suffix = "_joint" + (f"{j - first}" if count > 1 else "")
        made.append(bodies[body] + ("_free" if int(model.jnt_type[j]) == FREE else suffix))
    joints = _unique([str(model.joint(j).name) for j in range(model.njnt)], made, _RESERVED, "_joint")
    given = [str(model.site(s).name) for s in range(model.nsite)]
    sites = _unique(given, [""] * len(given), {*_RESERVED, *bodies, *joints}, "_site")
    return MjNames(tuple(bodies), tuple(joints), tuple(sites))


def coordinates(model: mujoco.MjModel, joint: int, qpos: Array) -> Array:
    """A joint's numbers in a qpos as they are in q: quaternions x, y, z, w instead of w, x, y, z."""
    start, (size, _) = int(model.jnt_qposadr[joint]), SIZES[int(model.jnt_type[joint])]
    out = np.array(qpos[start : start + size], dtype=float)
    if size > 1:
        out[-4:] = out[-4:][TO_PINOCCHIO]
    return out


def held_bodies(model: mujoco.MjModel, equality: int) -> tuple[int, int]:
    """Both bodies that a connect or weld holds together, given by themselves or by their sites; 0 is the world."""
    import mujoco

    first, second = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
    if int(model.eq_objtype[equality]) == int(mujoco.mjtObj.mjOBJ_SITE):
        return int(model.site_bodyid[first]), int(model.site_bodyid[second])
    return first, second


def _unique(given: Sequence[str], made: Sequence[str], reserved: Collection[str], suffix: str) -> list[str]:
    """The given names, with the suffix where they are reserved; the made ones where there is none. Underscores until
    it is no other's.
    """
    out, taken = [], {*given, *reserved}
    for name, instead in zip(given, made, strict=True):
        new = name or instead
        if new and (not name or name in reserved):
            new += suffix if name else ""
            while new in taken:
                new += "_"
            taken.add(new)
        out.append(new)
    return out


def pose_of(position: Array, quaternion: Array) -> own.SE3:
    """A pose from MuJoCo's w, x, y, z."""
    turn = own.Quaternion(np.array(quaternion)[TO_PINOCCHIO])
    turn.normalize()
    return own.SE3(turn.toRotationMatrix(), np.array(position, dtype=float))
