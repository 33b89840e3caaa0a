"""Random MJCF against MuJoCo's own engine: poses, masses, inertia, bias forces, limits, couplings."""

from __future__ import annotations

import copy
import re
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.refusals import assert_refused
from tests.repeats import repeats
from tests.robots.random_mjcf import random_mjcf
from wbc.errors import BoundsError, RobotFileError
from wbc.robot import Robot
from wbc.robot.sources.mjmodel import trees_of
from wbc.robots import LoopError, MujocoJoints
from wbc.shapes import Box, Capsule, Cylinder, Sphere

NEAR = 1e-10
#: Of time, for the turning of free bodies [s]
STEP = 1e-6
#: Folders of this repository with MJCF files
OURS = ("examples", "bench", "tests")
#: Far beyond every range of the family
FAR = 1e9


def near(ours: object, theirs: object, what: str) -> None:
    """Alike to 1e-10 of the largest number."""
    one, other = np.asarray(ours, dtype=float), np.asarray(theirs, dtype=float)
    np.testing.assert_allclose(one, other, rtol=0.0, atol=NEAR * max(1.0, np.abs(other).max(initial=0.0)), err_msg=what)


def check_poses(model: mujoco.MjModel, data: mujoco.MjData, robot: Robot, joints: MujocoJoints, q: np.ndarray) -> None:
    """Of every body and site that the robot's joints carry, and of all others that the robot has."""
    where = robot.model.createData()
    pin.framesForwardKinematics(robot.model, where, q)
    carried = {int(model.jnt_bodyid[j]) for j in joints.columns}
    for b in range(1, model.nbody):
        carried |= {b} if int(model.body_parentid[b]) in carried else set()
    bodies = [(model.body(b).name, b, "_body", data.xpos[b], data.xmat[b]) for b in range(1, model.nbody)]
    sites = [
        (model.site(s).name, int(model.site_bodyid[s]), "_site", data.site_xpos[s], data.site_xmat[s])
        for s in range(model.nsite)
    ]
    for name, body, suffix, place, turn in bodies + sites:
        if body not in carried and robot.notes.get("objects"):  # of something else
            continue
        kind = pin.FrameType.BODY if suffix == "_body" else pin.FrameType.OP_FRAME
        labels = [label for label in (name, name + suffix, f"{name}{suffix}_") if robot.model.existFrame(label, kind)]
        assert labels or body not in carried or not name, name
        if labels and name:
            gaps = [where.oMf[robot.model.getFrameId(label, kind)].homogeneous[:3] for label in labels]
            theirs = np.column_stack([turn.reshape(3, 3), place])
            near(min(gaps, key=lambda ours: np.abs(ours - theirs).max()), theirs, name)


def weight(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Bias force at rest."""
    rest = mujoco.MjData(model)
    rest.qpos[:] = data.qpos
    mujoco.mj_forward(model, rest)
    return np.array(rest.qfrc_bias)


def largest_force(model: mujoco.MjModel, data: mujoco.MjData, joint: int) -> float:
    """What the joint's actuators can make at most, tried in MuJoCo: every control, state and position pushed far."""
    dof, best = int(model.jnt_dofadr[joint]), 0.0
    for side in (-1.0, 1.0):
        data.ctrl[:], data.act[:] = 0.0, 0.0
        data.qvel[:] = 0.0
        for a in range(model.nu):
            if model.actuator_trnid[a, 0] != joint or model.actuator_trntype[a] > 1:
                continue
            gain = model.actuator_gainprm[a, 0]
            push = FAR * side * np.sign(model.actuator_gear[a, 0] * gain) if gain else FAR
            data.ctrl[a] = push
            at = int(model.actuator_actadr[a])
            if at >= 0:
                filtered = model.actuator_dyntype[a] != int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
                if filtered and model.actuator_ctrllimited[a]:
                    push = np.clip(push, *model.actuator_ctrlrange[a])
                if model.actuator_actlimited[a]:
                    push = np.clip(push, *model.actuator_actrange[a])
                data.act[at] = push
            if model.actuator_biasprm[a, 1:3].any() or model.actuator_gainprm[a, 1:3].any():
                # A servo: the joint is as far away, and as fast
                servo = np.sign(model.actuator_gear[a, 0]) * side * FAR
                data.actuator_length[a], data.actuator_velocity[a] = -servo, -servo
        mujoco.mj_fwdActuation(model, data)
        best = max(best, abs(float(data.qfrc_actuator[dof])))
    return best if best < 0.01 * FAR else np.inf


def check_shapes(model: mujoco.MjModel, robot: Robot) -> None:
    """Geoms that can touch something, of the sizes and at the places that MuJoCo has."""
    kinds = mujoco.mjtGeom
    for g in range(model.ngeom):
        name = model.body(model.geom_bodyid[g]).name
        kind, size = int(model.geom_type[g]), model.geom_size[g]
        if name in ("", "universe", "world") or not model.geom_contype[g]:
            continue
        if not robot.model.existFrame(name, pin.FrameType.BODY):
            continue
        made: Sphere | Capsule | Cylinder | Box
        if kind == kinds.mjGEOM_SPHERE:
            made = Sphere(size[0])
        elif kind == kinds.mjGEOM_CAPSULE:
            made = Capsule(size[0], 2.0 * size[1])
        elif kind == kinds.mjGEOM_CYLINDER:
            made = Cylinder(size[0], 2.0 * size[1])
        elif kind == kinds.mjGEOM_BOX:
            made = Box((2.0 * size[0], 2.0 * size[1], 2.0 * size[2]))
        else:
            continue
        place = pin.SE3(pin.Quaternion(np.array(model.geom_quat[g])[[1, 2, 3, 0]]), np.array(model.geom_pos[g]))
        alike = [one.placement for one in robot.shapes[name] if one.shape == made]
        assert any(one.isApprox(place, NEAR) for one in alike), (name, made)


def check_limits(model: mujoco.MjModel, robot: Robot, joints: MujocoJoints) -> None:
    model = copy.copy(model)
    model.actuator_gear[np.asarray(model.actuator_trntype) > 1] = 0.0  # what drives tendons
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    off = model.opt.disableflags & (
        int(mujoco.mjtDisableBit.mjDSBL_LIMIT) | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    )
    for j, column in joints.columns.items():
        if int(model.jnt_type[j]) < 2:
            continue
        ends = model.jnt_range[j] if model.jnt_limited[j] and not off else (-np.inf, np.inf)
        found = robot.limits.position_lower[column], robot.limits.position_upper[column]
        assert found == pytest.approx(tuple(ends), abs=1e-12)
        most = largest_force(model, data, j)
        driven = any(model.actuator_trnid[a, 0] == j and model.actuator_trntype[a] < 2 for a in range(model.nu))
        if not driven and model.jnt_actfrclimited[j]:
            most = float(np.abs(model.jnt_actfrcrange[j]).max())
        assert robot.limits.effort[column] == pytest.approx(most or np.inf, rel=1e-9), model.joint(j).name
    assert np.isinf(robot.limits.velocity).all()


def check_couplings(model: mujoco.MjModel, robot: Robot, joints: MujocoJoints, qpos: np.ndarray) -> None:
    """Where couplings hold, MuJoCo's linear equalities do; a robot that says that one is not kept may lose it."""
    off = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY) | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    for k in range(model.neq):
        one, two, terms = int(model.eq_obj1id[k]), int(model.eq_obj2id[k]), model.eq_data[k, :5]
        if int(model.eq_type[k]) != int(mujoco.mjtEq.mjEQ_JOINT) or two < 0 or model.opt.disableflags & off:
            continue
        name = model.eq(k).name or f"equality {k}"
        if not model.eq_active0[k] or f"{name}'" in robot.notes.get("mimic", ""):
            continue
        if not {one, two} & joints.columns.keys():  # of something else
            continue
        at = [int(model.jnt_qposadr[j]) for j in (one, two)]
        y, x = (qpos[i] - model.qpos0[i] for i in at)
        near(y, np.polyval(terms[::-1], x), f"equality {k}")


def loaded(seed: int) -> tuple[mujoco.MjModel, Robot] | None:
    """The model and the robot of a seed's text; None where both refuse it, or it is no robot and that is said."""
    text = random_mjcf(seed)
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        refusal = error
    else:
        ours = {j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in trees_of(model).robot}
        armed = model.tendon_armature.any() or model.actuator_armature[model.actuator_trntype == 3].any()
        armed = armed and not ours.isdisjoint(model.wrap_objid.tolist())
        if ours and not armed:
            try:
                return model, wbc.robots.load(text, shapes="exact")
            except LoopError:  # equalities are drawn without regard to each other
                model.eq_active0[:] = 0
                return model, wbc.robots.load(text, shapes="exact", loops=False)
            except BoundsError:  # so are ranges
                free = re.sub("<equality>.*?</equality>", "", text, flags=re.DOTALL)
                return mujoco.MjModel.from_xml_string(free), wbc.robots.load(free, shapes="exact")
        refusal = ValueError("armature of tendons: cord" if armed else "no joint that moves")
    reason = " ".join(str(refusal).split())[:60]
    assert_refused(lambda: wbc.robots.load(text), RobotFileError, reason)
    return None


def check(model: mujoco.MjModel, robot: Robot, seed: int) -> None:
    """Everything that both say of the robot, in a random state."""
    joints, data, rng = MujocoJoints(model, robot), mujoco.MjData(model), np.random.default_rng(seed)
    q, v = robot.random(seed), rng.uniform(-1.0, 1.0, robot.nv)
    joints.put_q(data.qpos, q)
    joints.put_v(data.qvel, q, v)
    near(joints.q(data.qpos), q, "q")
    near(joints.v(data.qpos, data.qvel), v, "v")
    later = np.array(data.qpos)
    mujoco.mj_integratePos(model, later, data.qvel, STEP)
    near(joints.q(later), pin.integrate(robot.model, q, STEP * v), "q after a step")
    check_couplings(model, robot, joints, data.qpos)
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    check_poses(model, data, robot, joints, q)
    where = robot.model.createData()
    # The velocity of each degree of freedom in MuJoCo's axes, in which v turns with a free body
    axes, moved, rates = np.zeros((robot.nv, model.nv)), np.zeros((robot.nv, model.nv)), np.zeros((2, model.nv))
    for column, row, pushed in zip(np.eye(robot.nv), axes, moved, strict=True):
        joints.put_v(row, q, column)
        mujoco.mj_mulM(model, data, pushed, row)
    mass = np.triu(pin.crba(robot.model, where, q))
    near(mass + np.triu(mass, 1).T, axes @ moved.T, "inertia")
    near(pin.computeGeneralizedGravity(robot.model, where, q), axes @ weight(model, data), "weight")
    for rate, side in zip(rates, (-STEP, STEP), strict=True):
        joints.put_v(rate, pin.integrate(robot.model, q, side * v), v)
    turning = axes @ data.qfrc_bias + moved @ ((rates[1] - rates[0]) / (2.0 * STEP))
    free = any(int(model.jnt_type[j]) == 0 for j in joints.columns)
    bias = pin.nonLinearEffects(robot.model, where, q, v)
    assert np.abs(bias - turning).max() < (1e-7 if free else NEAR) * max(1.0, np.abs(turning).max())
    kept = [b for b in range(1, model.nbody) if model.body(b).name in robot.frame_names or model.body(b).name == ""]
    if len(kept) == model.nbody - 1 and not robot.notes.get("objects"):
        near(sum(body.mass for body in robot.model.inertias), model.body_subtreemass[0], "mass")
    check_limits(model, robot, joints)
    check_shapes(model, robot)


@pytest.mark.parametrize("part", range(20))
def test_a_random_text_is_what_mujoco_makes_of_it(part: int) -> None:
    for seed in range(part, repeats(20), 20):
        found = loaded(seed)
        if found is not None:
            check(*found, seed)


def test_installed_models() -> None:
    """Of every package beside MuJoCo, and of this repository; what MuJoCo refuses is left out."""
    folders = [Path(mujoco.__file__).resolve().parents[1], *(Path(__file__).parents[2] / one for one in OURS)]
    files = [file for folder in folders for file in folder.glob("**/*.xml")]
    seen = 0
    for file in sorted(file for file in files if b"<mujoco" in file.read_bytes()):
        try:
            model = mujoco.MjModel.from_xml_path(str(file))
            robot = wbc.robots.load(file, shapes="exact")
        except (ValueError, RobotFileError):
            continue
        check(model, robot, 1)
        seen += 1
    assert seen >= 3
