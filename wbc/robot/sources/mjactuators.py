"""What the actuators of a ``mujoco.MjModel`` can do at its joints: the generalised force that they can make."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wbc.robot.sources.mjnames import BALL, FREE
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco


def on_joint(model: mujoco.MjModel, joint: int) -> list[int]:
    """The actuators that push on a joint, about whatever axes."""
    import mujoco

    kinds = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    return np.flatnonzero(np.isin(model.actuator_trntype, kinds) & (model.actuator_trnid[:, 0] == joint)).tolist()


def driven_joints(model: mujoco.MjModel) -> tuple[int, ...]:
    """Joints that some actuator moves, by itself or through a tendon or site, at a configuration like any other."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_integratePos(model, data.qpos, np.random.default_rng(0).uniform(0.1, 0.5, model.nv), 1.0)
    mujoco.mj_forward(model, data)
    moment = np.zeros((len(data.moment_rownnz), model.nv))
    mujoco.mju_sparse2dense(moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    return tuple(sorted({int(j) for j in model.dof_jntid[moment.any(axis=0)]}))


def joint_actuators(model: mujoco.MjModel, joint: int) -> list[int]:
    """Those of them that push on a hinge, slide or ball joint about axes that turn with it."""
    import mujoco

    kind, ours = int(model.jnt_type[joint]), int(mujoco.mjtTrn.mjTRN_JOINT)
    if kind == FREE:
        return []
    return [a for a in on_joint(model, joint) if kind != BALL or model.actuator_trntype[a] == ours]


def of_actuators(model: mujoco.MjModel, joint: int, what: str) -> float:
    """Armature or damping that actuators bring to each degree of freedom of a joint: the sum of gear[0]^2 times theirs,
    whatever the axis of the gear is.
    """
    given = getattr(model, f"actuator_{what}", np.zeros(_count(model)))  # not in all versions
    return float(sum(gears(model, a, 1)[0] ** 2 * given[a] for a in on_joint(model, joint)))


def gears(model: mujoco.MjModel, actuator: int, size: int) -> Array:
    """Generalised force of a joint's ``size`` degrees of freedom per unit of an actuator's force."""
    return np.array(model.actuator_gear[_first(model, "actuator_outadr", actuator)][:size], dtype=float)


def control(model: mujoco.MjModel, actuator: int) -> int:
    """Where an actuator's first number is in ctrl."""
    return _first(model, "actuator_ctrladr", actuator)


def force_range(model: mujoco.MjModel, joint: int, size: int) -> tuple[Array, Array]:
    """(least, largest) generalised force that a joint's actuators make together, of ``size`` degrees of freedom:

        sum_a gear_a [lo_a, hi_a], cut by the joint's own range,

    infinite where nothing limits it, and 0 for a joint that nothing drives. A joint without actuators that has a range
    of its own has that.
    """
    import mujoco

    low, high = np.zeros(size), np.zeros(size)
    actuators = joint_actuators(model, joint)
    for a in actuators:
        group = int(model.actuator_group[a])
        off = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
        if off or (0 <= group < 31 and model.opt.disableactuator >> group & 1):
            continue
        ends, gear = force_ends(model, a), gears(model, a, size)
        with np.errstate(invalid="ignore"):  # 0 inf, where an axis has no gear
            both = np.where(gear == 0.0, 0.0, np.outer(ends, gear))
        low, high = low + both.min(axis=0), high + both.max(axis=0)
    if model.jnt_actfrclimited[joint]:
        if not actuators:
            low, high = low - np.inf, high + np.inf
        low, high = (np.clip(x, *model.jnt_actfrcrange[joint]) for x in (low, high))
    return low, high


def elsewhere(model: mujoco.MjModel) -> list[str]:
    """Actuators that push on something else than joints, such as tendons and sites, and those on joints of which only
    MuJoCo knows what they can: muscles and the like without a range of force.
    """
    import mujoco

    plain = (int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE))
    known = {
        a
        for j in range(model.njnt)
        for a in joint_actuators(model, j)
        if model.actuator_forcelimited[a] or model.actuator_gaintype[a] in plain
    }
    return [str(model.actuator(a).name) or f"actuator {a}" for a in range(_count(model)) if a not in known]


def force_ends(model: mujoco.MjModel, a: int) -> Array:
    """Least and largest force of an actuator, before its gear; infinite where nothing limits it."""
    import mujoco

    low, high = -np.inf, np.inf
    gain, bias = model.actuator_gainprm[a], model.actuator_biasprm[a]
    fixed = int(model.actuator_gaintype[a]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    affine = int(model.actuator_biastype[a]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
    constant = int(model.actuator_biastype[a]) == int(mujoco.mjtBias.mjBIAS_NONE) or (affine and not bias[1:3].any())
    if fixed and constant:
        inputs = _inputs(model, a) if gain[0] else np.zeros(2)
        low, high = np.sort(gain[0] * inputs) + (bias[0] if affine else 0.0)
    if model.actuator_forcelimited[a]:
        low, high = np.clip([low, high], *model.actuator_forcerange[a])
    return np.array([low, high])


def _inputs(model: mujoco.MjModel, a: int) -> Array:
    """Range of what an actuator's gain multiplies: its control, or its activation where it has one."""
    import mujoco

    kinds = mujoco.mjtDyn
    kind = int(model.actuator_dyntype[a])
    clamped = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    out, at = np.array([-np.inf, np.inf]), control(model, a)
    # A filter stays within what goes in, an integrator does not
    follows = kind in (int(kinds.mjDYN_NONE), int(kinds.mjDYN_FILTER), int(kinds.mjDYN_FILTEREXACT))
    if follows and clamped and model.actuator_ctrllimited[at]:
        out = np.array(model.actuator_ctrlrange[at], dtype=float)
    if kind != int(kinds.mjDYN_NONE) and model.actuator_actlimited[a]:
        out = np.clip(out, *model.actuator_actrange[a])
    return out


def _count(model: mujoco.MjModel) -> int:
    return int(getattr(model, "nactuator", model.nu))


def _first(model: mujoco.MjModel, addresses: str, a: int) -> int:
    """Where an actuator's controls or outputs begin: before MuJoCo 4 it had one of each."""
    return int(getattr(model, addresses)[a]) if hasattr(model, addresses) else a
