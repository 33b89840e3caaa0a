"""Reading a compiled ``mujoco.MjModel``: whatever MuJoCo's own compiler made of a file or of a specification.

Joints, inertias and frames are taken from the compiled arrays, so nothing that MJCF can say is read a second time
here: <frame>, <replicate>, <attach>, defaults, masses of geoms that touch nothing.
"""

from __future__ import annotations

import os
import pathlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from wbc.errors import RobotFileError
from wbc.robot.sources.description import Description, Mimic, with_base
from wbc.rotations import TO_PINOCCHIO
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

#: Numbers of a joint in qpos and in qvel, by MuJoCo's type
FREE, BALL, SLIDE, HINGE = range(4)
SIZES = {FREE: (7, 6), BALL: (4, 3), SLIDE: (1, 1), HINGE: (1, 1)}
#: Types of transmissions to a joint and of equalities of joints
TO_JOINT, JOINT_EQUALITY = (0, 1), 2


def is_mjmodel(source: Any) -> bool:
    """Whether a user handed in a ``mujoco.MjModel``; MuJoCo is not imported for it."""
    kind = type(source)
    return kind.__name__ == "MjModel" and kind.__module__.startswith("mujoco")


def model_name(model: mujoco.MjModel) -> str:
    """What the file calls its model."""
    return bytes(model.names).split(b"\0", 1)[0].decode() or "mujoco"


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """A joint's name, or one made of its body's where it has none, as Pinocchio's reader of MJCF makes it."""
    given = str(model.joint(joint).name)
    if given:
        return given
    body = int(model.jnt_bodyid[joint])
    if int(model.jnt_type[joint]) == FREE:
        return f"{body_name(model, body)}_free"
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    return f"{body_name(model, body)}_joint" + (f"{joint - first}" if count > 1 else "")


def body_name(model: mujoco.MjModel, body: int) -> str:
    """A body's name, or its number where it has none."""
    return str(model.body(body).name) or f"body{body}"


@dataclass(frozen=True, eq=False)
class MjTrees:
    """Which bodies of a model are the robot.

    Attributes:
        robot: numbers of its bodies, parents first; bodies that are fixed to the world are among them.
        objects: names of bodies that move freely and alone beside the robot, and are no part of it.
    """

    robot: tuple[int, ...]
    objects: tuple[str, ...]


def trees_of(model: mujoco.MjModel) -> MjTrees:
    """The robot's bodies: all but mocap bodies, and, where other joints move, trees that only have a free joint."""
    joints: dict[int, list[int]] = {}
    for j in range(model.njnt):
        joints.setdefault(int(model.body_rootid[model.jnt_bodyid[j]]), []).append(j)
    alone = [root for root, own in joints.items() if len(own) == 1 and int(model.jnt_type[own[0]]) == FREE]
    driven = [root for root in alone if _is_pushed(model, root)]
    objects = {root for root in alone if root not in driven} if len(alone) - len(driven) < len(joints) else set()
    mocap = {b for b in range(1, model.nbody) if int(model.body_mocapid[int(model.body_rootid[b])]) >= 0}
    kept = (b for b in range(1, model.nbody) if b not in mocap and int(model.body_rootid[b]) not in objects)
    return MjTrees(tuple(kept), tuple(body_name(model, root) for root in sorted(objects)))


def _is_pushed(model: mujoco.MjModel, root: int) -> bool:
    """Whether an actuator acts on a joint or a site of this tree, as a drone's propellers do."""
    for a in range(model.nu):
        target, kind = int(model.actuator_trnid[a, 0]), int(model.actuator_trntype[a])
        bodies = {0: model.jnt_bodyid, 1: model.jnt_bodyid, 4: model.site_bodyid}.get(kind)
        if bodies is not None and int(model.body_rootid[bodies[target]]) == root:
            return True
    return False


def read_mjmodel(model: mujoco.MjModel, base: str | None = None, source: str = "") -> Description:
    """The description in a compiled model: q is its qpos with quaternions x, y, z, w.

    Several joints of one body become joints one after the other. Keyframes are states, the model's own qpos0
    too. Bodies that a program moves (mocap), and freely moving objects beside the robot, are left out.

    Raises:
        RobotFileError: a model without joints; a base that contradicts it.
    """
    trees = trees_of(model)
    if not any(int(model.body_jntnum[b]) for b in trees.robot):
        raise RobotFileError("robot", source or "MjModel", "the model has no joint")
    whole, order = _built(model, trees)
    notes = {"reader": "compiled by MuJoCo"}
    if trees.objects:
        notes["objects"] = f"move freely and are no part of the robot: {', '.join(trees.objects)}"
    _set_limits(model, whole, order)
    mimics, lost = _couplings(model, set(order))
    if lost:
        notes["mimic"] = f"equalities that are not represented: {', '.join(lost)}"
    states = {"qpos0": _state(model, order, model.qpos0)}
    for k in range(model.nkey):
        states[str(model.key(k).name) or f"key{k}"] = _state(model, order, model.key_qpos[k])
    drawn = np.concatenate(list(states["qpos0"].values()))
    based, kind = with_base(whole, base, drawn)
    return Description(based, kind, mimics, states, notes=notes, source=source)


def _built(model: mujoco.MjModel, trees: MjTrees) -> tuple[pin.Model, list[int]]:
    """(the model with its frames, MuJoCo's joints in the order of q)."""
    out, order = pin.Model(), list[int]()
    out.name = model_name(model)
    out.gravity = pin.Motion(np.array(model.opt.gravity), np.zeros(3))
    # Of each body: the joint that carries it, its pose there, its frame
    at: dict[int, tuple[int, pin.SE3, int]] = {0: (0, pin.SE3.Identity(), 0)}
    armature, damping, friction = list[Array](), list[Array](), list[Array]()
    for body in trees.robot:
        joint, pose, frame = at[int(model.body_parentid[body])]
        pose = pose * pose_of(model.body_pos[body], model.body_quat[body])
        for j in _joints(model, body):
            kind = int(model.jnt_type[j])
            if kind == FREE:
                pose, anchor, made = pin.SE3.Identity(), pin.SE3.Identity(), pin.JointModelFreeFlyer()
            else:
                anchor, made = _joint(model, j)
            name = joint_name(model, j)
            joint = out.addJoint(joint, made, pose * anchor, name)
            frame = out.addJointFrame(joint, frame)
            back = pin.SE3(np.eye(3), -np.array(model.jnt_pos[j])) if kind in (BALL, HINGE) else pin.SE3.Identity()
            pose = back
            order.append(j)
            dofs = slice(int(model.jnt_dofadr[j]), int(model.jnt_dofadr[j]) + SIZES[kind][1])
            armature.append(np.array(model.dof_armature[dofs]))
            damping.append(np.array(model.dof_damping[dofs]))
            friction.append(np.array(model.dof_frictionloss[dofs]))
        frame = out.addBodyFrame(body_name(model, body), joint, pose, frame)
        out.appendBodyToJoint(joint, _inertia(model, body), pose)
        at[body] = joint, pose, frame
    for s in range(model.nsite):
        body, site = int(model.site_bodyid[s]), str(model.site(s).name)
        if site and body in at:
            joint, pose, frame = at[body]
            placed = pose * pose_of(model.site_pos[s], model.site_quat[s])
            # A site may share its name with a body; its frame is then the one that comes second
            label = f"{site}_site" if out.existFrame(site) else site
            out.addFrame(pin.Frame(label, joint, frame, placed, pin.FrameType.OP_FRAME))
    out.armature, out.damping = np.concatenate(armature), np.concatenate(damping)
    out.upperDryFrictionLimit = np.concatenate(friction)
    out.lowerDryFrictionLimit = -np.concatenate(friction)
    return out, order


def _joints(model: mujoco.MjModel, body: int) -> Iterator[int]:
    first = int(model.body_jntadr[body])
    return iter(range(first, first + int(model.body_jntnum[body])))


def _joint(model: mujoco.MjModel, j: int) -> tuple[pin.SE3, pin.JointModel]:
    """(placement in the body, joint): turned or moved back by qpos0, from which MuJoCo counts, so that q is qpos."""
    anchor, axis = np.array(model.jnt_pos[j]), np.array(model.jnt_axis[j])
    if int(model.jnt_type[j]) == BALL:
        return pin.SE3(np.eye(3), anchor), pin.JointModelSpherical()
    axis, ref = axis / np.linalg.norm(axis), float(model.qpos0[int(model.jnt_qposadr[j])])
    along = np.flatnonzero(axis > 1.0 - 1e-12)
    if int(model.jnt_type[j]) == SLIDE:
        kinds = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ)
        made = kinds[along[0]]() if along.size else pin.JointModelPrismaticUnaligned(axis)
        return pin.SE3(np.eye(3), -ref * axis), made
    kinds = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)
    made = kinds[along[0]]() if along.size else pin.JointModelRevoluteUnaligned(axis)
    return pin.SE3(pin.exp3(-ref * axis), anchor), made


def pose_of(position: Array, quaternion: Array) -> pin.SE3:
    """A pose from MuJoCo's w, x, y, z."""
    turn = pin.Quaternion(np.array(quaternion)[TO_PINOCCHIO])
    turn.normalize()
    return pin.SE3(turn.toRotationMatrix(), np.array(position, dtype=float))


def _inertia(model: mujoco.MjModel, body: int) -> pin.Inertia:
    axes = pose_of(model.body_ipos[body], model.body_iquat[body])
    turned = axes.rotation @ np.diag(model.body_inertia[body]) @ axes.rotation.T
    return pin.Inertia(float(model.body_mass[body]), axes.translation, turned)


def _set_limits(model: mujoco.MjModel, out: pin.Model, order: list[int]) -> None:
    """Ranges of joints, and what its actuators or the joint itself allow as force; MuJoCo knows no rates."""
    lower, upper = np.full(out.nq, -np.inf), np.full(out.nq, np.inf)
    effort = np.zeros(out.nv)
    for k, j in enumerate(order, start=1):
        if int(model.jnt_type[j]) not in (SLIDE, HINGE):
            continue
        if model.jnt_limited[j]:
            lower[out.idx_qs[k]], upper[out.idx_qs[k]] = model.jnt_range[j]
        limits = [float(np.abs(model.jnt_actfrcrange[j]).max())] if model.jnt_actfrclimited[j] else []
        for a in range(model.nu):
            if int(model.actuator_trntype[a]) in TO_JOINT and int(model.actuator_trnid[a, 0]) == j:
                gear = abs(float(model.actuator_gear[a, 0]))
                if model.actuator_forcelimited[a]:
                    limits.append(gear * float(np.abs(model.actuator_forcerange[a]).max()))
                elif model.actuator_ctrllimited[a] and not model.actuator_biasprm[a, 1:3].any():
                    reach = float(np.abs(model.actuator_ctrlrange[a]).max())
                    limits.append(gear * abs(float(model.actuator_gainprm[a, 0])) * reach)
        effort[out.idx_vs[k]] = min(limits, default=0.0)
    out.lowerPositionLimit, out.upperPositionLimit = lower, upper
    out.upperEffortLimit, out.lowerEffortLimit = effort, -effort
    out.upperVelocityLimit, out.lowerVelocityLimit = np.full(out.nv, np.inf), np.full(out.nv, -np.inf)


def _couplings(model: mujoco.MjModel, joints: set[int]) -> tuple[tuple[Mimic, ...], list[str]]:
    """Linear equalities of two joints, and the names of equalities that are none."""
    mimics, lost = [], []
    for k in range(model.neq):
        if not model.eq_active0[k]:
            continue
        first, second, terms = int(model.eq_obj1id[k]), int(model.eq_obj2id[k]), model.eq_data[k, :5]
        kinds = int(model.eq_type[k]) == JOINT_EQUALITY and second >= 0 and not terms[2:].any()
        if not (kinds and {first, second} <= joints):
            lost.append(str(model.eq(k).name) or f"equality {k}")
            continue
        # y - y0 = a + b (x - x0)
        y0, x0 = (float(model.qpos0[int(model.jnt_qposadr[j])]) for j in (first, second))
        offset, ratio = y0 + float(terms[0]) - float(terms[1]) * x0, float(terms[1])
        mimics.append(Mimic(joint_name(model, first), joint_name(model, second), ratio, offset))
    return tuple(mimics), lost


def _state(model: mujoco.MjModel, order: list[int], qpos: Array) -> dict[str, Array]:
    out = {}
    for j in order:
        start = int(model.jnt_qposadr[j])
        numbers = np.array(qpos[start : start + SIZES[int(model.jnt_type[j])][0]], dtype=float)
        if len(numbers) in (4, 7):
            numbers[-4:] = numbers[-4:][TO_PINOCCHIO]
        out[joint_name(model, j)] = numbers
    return out


def compiled(source: Any) -> mujoco.MjModel | None:
    """An MJCF file compiled by MuJoCo; None where that is not installed or refuses it, and for what is no such file."""
    if not isinstance(source, (str, os.PathLike)) or pathlib.Path(source).suffix.lower() not in (".xml", ".mjcf"):
        return None
    try:
        import mujoco

        return mujoco.MjModel.from_xml_path(str(source))
    except (ModuleNotFoundError, ValueError):
        return None
