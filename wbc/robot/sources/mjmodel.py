"""Reading MJCF: MuJoCo compiles it, and the robot is made of the compiled arrays.

Nothing that MJCF can say is interpreted here: defaults, orientations, <frame>, <replicate>, <attach>, masses of
geoms and meshes are numbers of the ``mujoco.MjModel``. What it says and a robot cannot hold is found in
:mod:`wbc.robot.sources.mjcompared` by what MuJoCo itself computes.
"""

from __future__ import annotations

import logging
import pathlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wbc import extras
from wbc.errors import RobotFileError
from wbc.multibody import own, single_joint
from wbc.robot.sources.description import Description, Mimic, own_base, with_base
from wbc.robot.sources.files import captured_stderr
from wbc.robot.sources.mjactuators import driven_joints, elsewhere, force_range, of_actuators
from wbc.robot.sources.mjcompared import MjCompared, sentence
from wbc.robot.sources.mjloops import loops_of
from wbc.robot.sources.mjnames import (
    BALL,
    FREE,
    HINGE,
    SIZES,
    SLIDE,
    MjNames,
    coordinates,
    held_bodies,
    names_of,
    pose_of,
)
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

log = logging.getLogger("wbc")

#: Degrees of freedom of the largest robot: Pinocchio's data of a model has four tensors of nv^3 doubles, 0.9 GB
MOST = 300
#: Equality of two joints
_JOINT_EQUALITY = 2
#: Numbers this much apart, for a coordinate of 1, say the same of two couplings
_SAME = 1e-12


def compiled(source: str | pathlib.Path) -> mujoco.MjModel:
    """What MuJoCo's compiler makes of an MJCF file, or of MJCF as a string.

    Raises:
        MissingPackageError: MuJoCo is not installed.
        RobotFileError: it refuses the file, with its reason; a string that is no MJCF.
    """
    value = source if isinstance(source, str) else str(source)
    if isinstance(source, str):
        root = re.search(r"<([^\s<>/!?]+)", re.sub(r"<!--.*?-->", "", source, flags=re.DOTALL))
        if root is None or root[1] != "mujoco":
            reason = f"no MJCF: the root element is <{root[1] if root else ''}>, expected <mujoco>"
            raise RobotFileError("robot", value, f"{reason}; other descriptions are read from files")
    extras.require("mujoco", "MJCF, which MuJoCo's compiler reads,")
    import mujoco

    try:
        read = mujoco.MjModel.from_xml_string if isinstance(source, str) else mujoco.MjModel.from_xml_path
        with captured_stderr() as noise:
            model = read(value)
        if noise.reason:
            label = model_name(model) if isinstance(source, str) else value
            log.warning("MuJoCo on %s: %s", label, noise.reason.replace("WARNING: ", ""))
        return model
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise RobotFileError("robot", value, f"MuJoCo refused it: {' '.join(str(error).split())}") from error


def model_name(model: mujoco.MjModel) -> str:
    """What the file calls its model."""
    return bytes(model.names).split(b"\0", 1)[0].decode() or "mujoco"


@dataclass(frozen=True, eq=False)
class MjTrees:
    """Which bodies of a model are the robot.

    Attributes:
        robot: numbers of its bodies, parents first; bodies that are fixed to the world are among them.
        left_out: what is no part of it -> the bodies' numbers.
    """

    robot: tuple[int, ...]
    left_out: dict[str, list[int]]


def trees_of(model: mujoco.MjModel) -> MjTrees:
    """The robot's bodies. No part of it are, as trees of bodies on the world: those that a program moves (mocap)
    and that have no joint, those of flexes, where anything else moves those that only have a free joint, and beside a
    driven robot that moves freely all that nothing drives. What a loop holds to the robot is part of it.
    """
    import mujoco

    joints: dict[int, list[int]] = {}
    for j in range(model.njnt):
        joints.setdefault(int(model.body_rootid[model.jnt_bodyid[j]]), []).append(j)
    roots = [b for b in range(1, model.nbody) if int(model.body_parentid[b]) == 0]
    # <flexcomp> makes bodies of its own, that slide and twist by joints without names
    flexes = tuple(f"{mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, f)}_" for f in range(model.nflex))
    bent = [
        r
        for r, held in joints.items()
        if flexes and str(model.body(r).name).startswith(flexes) and not any(model.joint(j).name for j in held)
    ]
    alone = [
        r for r, held in joints.items() if len(held) == 1 and int(model.jnt_type[held[0]]) == FREE and r not in bent
    ]
    still = [r for r in joints if r not in bent and not _is_pushed(model, r)]
    floating = [r for r in joints if r not in {*bent, *still} and int(model.jnt_type[joints[r][0]]) == FREE]
    loose = still if len(floating) == 1 else [r for r in alone if r in still]
    if len(loose) == len(joints.keys() - set(bent)) == 1:  # one body that moves freely is a robot
        loose = []
    ties = _ties(model)
    while taken := {r for pair in ties for r in pair if r in loose and {*pair} - {r, *loose}}:
        loose = [r for r in loose if r not in taken]
    left_out = {
        "moved by a program (mocap)": [r for r in roots if model.body_mocapid[r] >= 0 and r not in joints],
        "deformable": sorted(bent),
        "driven by nothing": sorted(loose),
    }
    gone = {root for group in left_out.values() for root in group}
    kept = tuple(b for b in range(1, model.nbody) if int(model.body_rootid[b]) not in gone)
    return MjTrees(kept, {reason: group for reason, group in left_out.items() if group})


def _ties(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Roots of each two trees with joints that an active connect or weld holds together."""
    import mujoco

    moving, out = {int(model.body_rootid[b]) for b in model.jnt_bodyid}, []
    for k in range(model.neq):
        if model.eq_active0[k] and int(model.eq_type[k]) in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
            first, second = (int(model.body_rootid[body]) for body in held_bodies(model, k))
            if first != second and {first, second} <= moving:
                out.append((first, second))
    return out


def _is_pushed(model: mujoco.MjModel, root: int) -> bool:
    """Whether an actuator acts on a joint or a site of this tree, as a drone's propellers do."""
    for a in range(len(model.actuator_trntype)):
        target, kind = int(model.actuator_trnid[a, 0]), int(model.actuator_trntype[a])
        bodies = {0: model.jnt_bodyid, 1: model.jnt_bodyid, 4: model.site_bodyid}.get(kind)
        if bodies is not None and int(model.body_rootid[bodies[target]]) == root:
            return True
    return False


def read_mjmodel(model: mujoco.MjModel, base: str | None = None, source: str = "") -> Description:
    """The description in a compiled model: q is its qpos with quaternions x, y, z, w.

    Several joints of one body become joints one after the other. Keyframes are states, the model's own qpos0
    too. What a robot cannot hold is said in the log, and in the notes.

    Raises:
        RobotFileError: a model without joints, with too many, or whose motion MuJoCo computes otherwise; a base that
            contradicts it.
    """
    import mujoco

    label, names, trees = source or model_name(model), names_of(model), trees_of(model)
    beside = "; ".join(sentence(why, [names.bodies[b] for b in group]) for why, group in trees.left_out.items())
    moving = [j for body in trees.robot for j in _joints(model, body)]
    if not moving:
        raise RobotFileError(
            "robot", label, "the model has no joint that moves a robot" + f" ({beside})" * bool(beside)
        )
    dofs = sum(SIZES[int(model.jnt_type[j])][1] for j in moving)
    if dofs > MOST:
        count = len({int(model.body_rootid[model.jnt_bodyid[j]]) for j in moving})
        reason = f"{dofs} degrees of freedom in {count} trees of bodies, at most {MOST} are held"
        raise RobotFileError("robot", label, f"{reason}: load a model of the robot alone")
    whole, order = _built(model, trees, names)
    mimics, lost = _couplings(model, set(order), names)
    free = [names.joints[j] for j in moving if model.jnt_type[j] == FREE and own_base(whole) == "fixed"]
    heavy = [names.joints[j] for j in moving if model.jnt_type[j] == FREE and model.dof_armature[model.jnt_dofadr[j]]]
    carried = [names.bodies[b] for b in trees.robot if model.body_mocapid[b] >= 0]
    said = {
        "objects": f"no part of the robot are bodies {beside}" if beside else "",
        "mocap": sentence("fixed here, and moved by a program in the file", carried),
        "armature": sentence("armature is along the body's axes here, along the world's in MuJoCo, of", heavy),
        **_set_limits(model, whole, order, names),
    }
    try:
        compared = MjCompared(model, whole, order, names, mimics)
        difference = compared.difference()
        loops, lost = loops_of(model, lost, trees.robot, set(order), names, whole)
        driven = [j for j in order if j in driven_joints(model) and model.jnt_type[j] != FREE]
        said |= compared.forces() | compared.loops(lost, set(trees.robot))
        followers = {mimic.follower for mimic in mimics}
        still = [names.joints[j] for j in order if j not in driven and model.jnt_type[j] != FREE]
        said["motors"] = sentence(
            "no torque is commanded of joints that no actuator drives",
            [name for name in still if driven and name not in followers],
        )
    except (RuntimeError, mujoco.FatalError) as error:  # no memory for a state, a plugin that does not begin
        raise RobotFileError("robot", label, f"MuJoCo cannot compute it: {error}") from error
    if difference:
        raise RobotFileError("robot", label, difference)
    said = {key: words for key, words in said.items() if words}
    for words in said.values():
        log.warning("%s: %s", label, words)
    poses = {str(model.key(k).name) or f"key{k}": model.key_qpos[k] for k in range(model.nkey)}
    states = {
        key: {names.joints[j]: coordinates(model, j, qpos) for j in order}
        for key, qpos in {"qpos0": model.qpos0, **poses}.items()
    }
    drawn = np.concatenate(list(states["qpos0"].values()))
    based, kind = with_base(whole, base, drawn)
    notes = {"reader": "compiled by MuJoCo", **said}
    return Description(
        based, kind, mimics, states, notes=notes, source=source, undriven=tuple(free), geometry=model, loops=loops,
        actuated=tuple(names.joints[j] for j in driven),
    )  # fmt: skip


def _built(model: mujoco.MjModel, trees: MjTrees, names: MjNames) -> tuple[own.Model, list[int]]:
    """(the model with its frames, MuJoCo's joints in the order of q)."""
    out, order = own.Model(), list[int]()
    out.name = model_name(model)
    gravity = np.zeros(3) if _off(model, "GRAVITY") else np.array(model.opt.gravity)
    out.gravity = own.Motion(gravity, np.zeros(3))
    # Of each body: the joint that carries it, its pose there, its frame
    at: dict[int, tuple[int, own.SE3, int]] = {0: (0, own.SE3.Identity(), 0)}
    armature, damping, friction = list[Array](), list[Array](), list[Array]()
    for body in trees.robot:
        made: own.JointModel
        joint, pose, frame = at[int(model.body_parentid[body])]
        pose = pose * pose_of(model.body_pos[body], model.body_quat[body])
        for j in _joints(model, body):
            kind = int(model.jnt_type[j])
            if kind == FREE:
                pose, anchor, made = own.SE3.Identity(), own.SE3.Identity(), own.JointModelFreeFlyer()
            else:
                anchor, made = _joint(model, j)
            joint = out.addJoint(joint, made, pose * anchor, names.joints[j])
            frame = out.addJointFrame(joint, frame)
            back = own.SE3(np.eye(3), -np.array(model.jnt_pos[j])) if kind in (BALL, HINGE) else own.SE3.Identity()
            pose = back
            order.append(j)
            dofs = slice(int(model.jnt_dofadr[j]), int(model.jnt_dofadr[j]) + SIZES[kind][1])
            armature.append(np.array(model.dof_armature[dofs]) + of_actuators(model, j, "armature"))
            damping.append(np.array(model.dof_damping[dofs]) + of_actuators(model, j, "damping"))
            friction.append(np.array(model.dof_frictionloss[dofs]))
        frame = out.addBodyFrame(names.bodies[body], joint, pose, frame)
        out.appendBodyToJoint(joint, _inertia(model, body), pose)
        at[body] = joint, pose, frame
    for s, site in enumerate(names.sites):
        if site and int(model.site_bodyid[s]) in at:
            joint, pose, frame = at[int(model.site_bodyid[s])]
            placed = pose * pose_of(model.site_pos[s], model.site_quat[s])
            out.addFrame(own.Frame(site, joint, frame, placed, own.FrameType.OP_FRAME))
    out.armature, loss = np.concatenate(armature), np.concatenate(friction)
    out.damping = np.concatenate(damping) * (not _off(model, "DAMPER", "PASSIVE"))
    out.upperDryFrictionLimit = loss * (not _off(model, "FRICTIONLOSS", "CONSTRAINT"))
    out.lowerDryFrictionLimit = -out.upperDryFrictionLimit
    return out, order


def _off(model: mujoco.MjModel, *flags: str) -> bool:
    """Whether one of MuJoCo's parts is switched off by the file, of those that this version has."""
    import mujoco

    bits = (getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}", None) for flag in flags)
    return any(bit is not None and model.opt.disableflags & int(bit) for bit in bits)


def _joints(model: mujoco.MjModel, body: int) -> Iterator[int]:
    first = int(model.body_jntadr[body])
    return iter(range(first, first + int(model.body_jntnum[body])))


def _joint(model: mujoco.MjModel, j: int) -> tuple[own.SE3, own.JointModel]:
    """(placement in the body, joint): turned or moved back by qpos0, from which MuJoCo counts, so that q is qpos."""
    anchor, axis = np.array(model.jnt_pos[j]), np.array(model.jnt_axis[j])
    if int(model.jnt_type[j]) == BALL:
        return own.SE3(np.eye(3), anchor), own.JointModelSpherical()
    axis, ref = axis / np.linalg.norm(axis), float(model.qpos0[int(model.jnt_qposadr[j])])
    if int(model.jnt_type[j]) == SLIDE:
        return own.SE3(np.eye(3), -ref * axis), single_joint(axis, slides=True)
    return own.SE3(own.exp3(-ref * axis), anchor), single_joint(axis, slides=False)


def _inertia(model: mujoco.MjModel, body: int) -> own.Inertia:
    axes = pose_of(model.body_ipos[body], model.body_iquat[body])
    turned = axes.rotation @ np.diag(model.body_inertia[body]) @ axes.rotation.T
    return own.Inertia(float(model.body_mass[body]), axes.translation, turned)


def _set_limits(model: mujoco.MjModel, out: own.Model, order: list[int], names: MjNames) -> dict[str, str]:
    """Ranges of joints, and what its actuators or the joint itself allow as force; MuJoCo knows no rates."""
    lower, upper, effort = np.full(out.nq, -np.inf), np.full(out.nq, np.inf), np.zeros(out.nv)
    off, uneven = _off(model, "LIMIT", "CONSTRAINT"), list[str]()
    for k, j in enumerate(order, start=1):
        kind, start = int(model.jnt_type[j]), int(out.idx_vs[k])
        if kind == FREE:
            continue
        if model.jnt_limited[j] and kind != BALL and not off:
            lower[out.idx_qs[k]], upper[out.idx_qs[k]] = model.jnt_range[j]
        size = SIZES[kind][1]
        low, high = force_range(model, j, size)
        effort[start : start + size] = np.maximum(-low, high)
        if not np.allclose(-low, high, rtol=1e-9, atol=0.0):
            ranges = (f"{least:.6g} to {largest:.6g}" for least, largest in zip(low, high, strict=True))
            uneven.append(f"{names.joints[j]} ({', '.join(ranges)})")
    out.lowerPositionLimit, out.upperPositionLimit = lower, upper
    out.upperEffortLimit, out.lowerEffortLimit = effort, -effort
    out.upperVelocityLimit, out.lowerVelocityLimit = np.full(out.nv, np.inf), np.full(out.nv, -np.inf)
    ranged = [j for j in order if model.jnt_limited[j] and (off or int(model.jnt_type[j]) == BALL)]
    tendons = [str(model.tendon(t).name) or f"tendon {t}" for t in range(model.ntendon) if model.tendon_limited[t]]
    return {
        "position": sentence(
            "limits that the file switches off" if off else "the cone of a ball joint is no limit here",
            [names.joints[j] for j in ranged],
        ),
        "tendons": sentence("ranges of tendons are no limits here", [] if off else tendons),
        "actuators": sentence(
            "not held is what drives tendons, sites or free joints, or as a muscle", elsewhere(model)
        ),
        "uneven": sentence("torques are limited alike both ways, by the larger of", uneven),
    }


def _couplings(model: mujoco.MjModel, joints: set[int], names: MjNames) -> tuple[tuple[Mimic, ...], list[int]]:
    """Linear equalities of two joints, and the numbers of active equalities that are no couplings.

    Where two say different things of one joint, the second couples the joints that lead: each joint follows at most
    one, as ``q = ratio q[leader] + offset``.
    """
    mimics, lost = list[Mimic](), list[int]()
    follows: dict[int, tuple[int, float, float]] = {}

    def led(j: int) -> tuple[int, float, float]:
        """(what leads a joint, ratio, offset), itself where nothing does."""
        if j not in follows:
            return j, 1.0, 0.0
        leader, ratio, offset = follows[j]
        above, rate, start = led(leader)
        return above, ratio * rate, ratio * start + offset

    for k in range(model.neq):
        if not model.eq_active0[k] or _off(model, "EQUALITY", "CONSTRAINT"):
            continue
        first, second, terms = int(model.eq_obj1id[k]), int(model.eq_obj2id[k]), model.eq_data[k, :5]
        linear = int(model.eq_type[k]) == _JOINT_EQUALITY and second >= 0 and not terms[2:].any()
        if not (linear and {first, second} <= joints):
            lost.append(k)
            continue
        # y - y0 = a + b (x - x0)
        y0, x0 = (float(model.qpos0[int(model.jnt_qposadr[j])]) for j in (first, second))
        offset, ratio = y0 + float(terms[0]) - float(terms[1]) * x0, float(terms[1])
        (top, rate, start), (leader, pace, begin) = led(first), led(second)
        pace, begin = ratio * pace, ratio * begin + offset
        # rate q[top] + start = pace q[leader] + begin
        if top == leader or rate == 0.0:
            if max(abs(rate - pace), abs(start - begin)) > _SAME * max(1.0, abs(rate), abs(start)) or top != leader:
                lost.append(k)
            continue
        follows[top] = leader, pace / rate, (begin - start) / rate
        mimics.append(Mimic(names.joints[top], names.joints[leader], *follows[top][1:]))
    return tuple(mimics), lost
